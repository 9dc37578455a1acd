//! Differences in words.

use bodyflight_core::Segment;
use bodyflight_core::body::joint_angle::JointAngle;

use super::difference::{Difference, Trust, lead};

/// Turn rate below which a body does not turn either way (rad/s).
const TURNS: f64 = 0.2;

/// What a coach calls a joint.
pub(crate) fn joint(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "pelvis",
        Segment::Abdomen => "lower back",
        Segment::Thorax => "upper back",
        Segment::Head => "neck",
        Segment::LeftUpperArm => "left shoulder",
        Segment::LeftForearm => "left elbow",
        Segment::LeftHand => "left wrist",
        Segment::RightUpperArm => "right shoulder",
        Segment::RightForearm => "right elbow",
        Segment::RightHand => "right wrist",
        Segment::LeftThigh => "left hip",
        Segment::LeftShank => "left knee",
        Segment::LeftFoot => "left ankle",
        Segment::RightThigh => "right hip",
        Segment::RightShank => "right knee",
        Segment::RightFoot => "right ankle",
    }
}

/// A number with its error: whole if the error is above 1.
fn with_bar(amount: f64, bar: f64) -> String {
    let digits = usize::from(bar < 0.95);
    format!("{amount:.digits$} +- {bar:.digits$}")
}

/// A change of a number of [`super::effect::Means`], by its place: "60 +- 9 deg/s less turn"; `turning` is the turn rate of A
/// (rad/s).
fn change(place: usize, by: f64, deviation: f64, turning: f64) -> String {
    let [amount, bar] = [by.abs(), deviation];
    let degrees = |number: f64| number.to_degrees();
    let more = |positive: bool| if positive { "more" } else { "less" };
    match place {
        0 => {
            let bar = format!("{} deg/s", with_bar(degrees(amount), degrees(bar)));
            if turning.abs() > TURNS {
                format!("{bar} {} turn", more(by * turning > 0.0))
            } else {
                let side = if by > 0.0 { "left" } else { "right" };
                format!("{bar} turn to the {side}")
            }
        }
        1 => format!("{amount:.1} +- {bar:.1} m/s {} fall rate", more(by > 0.0)),
        2 => format!("{amount:.1} +- {bar:.1} m/s {} drift", more(by > 0.0)),
        _ => format!(
            "{} degrees {} pitch",
            with_bar(degrees(amount), degrees(bar)),
            more(by > 0.0)
        ),
    }
}

/// "left knee (l_shank.bend) 14 +- 3 degrees less from 2.10 s: 60 +- 9 deg/s less turn".
pub(super) fn difference(told: &Difference, angle: JointAngle, turning: f64) -> String {
    let more = if told.difference_rad > 0.0 {
        "more"
    } else {
        "less"
    };
    let head = format!(
        "{} ({angle}) {:.0} +- {:.0} degrees {more} from {:.2} s",
        joint(angle.segment),
        told.difference_rad.abs().to_degrees(),
        told.deviation_rad.to_degrees(),
        told.time_s[0]
    );
    let (Some(effect), Some(deviation)) = (told.effect, told.effect_deviation) else {
        return head;
    };
    let (place, _) = lead(&effect);
    let [by, bar] = [effect, deviation].map(|means| means.numbers()[place]);
    let effect = change(place, by, bar, turning);
    match told.trust {
        Trust::Uncertain => {
            format!(
                "{head}: no certain effect ({effect}; errors of the suit or the body would explain it)"
            )
        }
        Trust::ModelGap => {
            let gap = told.model_gap.map_or(0.0, |gaps| {
                let sizes = gaps.map(|gap| gap.numbers()[place].abs());
                sizes[0].max(sizes[1])
            });
            let (unit, factor) = [
                ("deg/s", 1_f64.to_degrees()),
                ("m/s", 1.0),
                ("m/s", 1.0),
                ("degrees", 1_f64.to_degrees()),
            ][place];
            format!(
                "{head}: {effect} by the model, which misses the flights by {:.0} {unit} there: not to be trusted",
                factor * gap
            )
        }
        _ => format!("{head}: {effect}"),
    }
}

/// The first difference whose effect stands, or why there is none.
pub(super) fn first(differences: &[Difference], [a, b]: [&str; 2]) -> String {
    if differences.is_empty() {
        return format!(
            "no joint of {b} differs from {a} by more than the assumed errors of the suits explain"
        );
    }
    let sound = |trust: Trust| differences.iter().find(|told| told.trust == trust);
    if let Some(told) = sound(Trust::Sound) {
        return told.words.clone();
    }
    let joints = differences.len();
    let many = if joints == 1 {
        "1 angle differs".to_owned()
    } else {
        format!("{joints} angles differ")
    };
    let why = if sound(Trust::ModelGap).is_some() {
        "but the model misses the flights by more than their effects"
    } else if sound(Trust::Uncertain).is_some() {
        "but assumed errors of the suits or of the body would explain their effects"
    } else {
        "but their effects could not be simulated"
    };
    format!("{many}, {why}")
}
