//! The exported quantities: one table, with a function for each that extracts it from a frame.

mod entry;
mod estimates;

use bodyflight_core::Segment;
use bodyflight_core::axis::AXIS_NAMES;
use bodyflight_core::body::posture::joint_angles;
use bodyflight_core::dynamics::{Inputs, Motion};
use bodyflight_core::frame::Vector;
use nalgebra::UnitQuaternion;

use bodyflight_export::columns::quantity::{Of, Unit};
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::steps::Step;

pub(super) use self::entry::{Entry, Seen};
use self::estimates::estimates;

const INERTIAL: &[&str] = &["north", "west", "up"];
const BODY: &[&str] = &["left", "dorsal", "cranial"];
const ROTATION: &[&str] = &["w", "x", "y", "z"];
const AXES: &[&str] = &AXIS_NAMES;
const ONE: &[&str] = &[];

/// Everything that is exported, in order; estimates only on request.
pub(super) fn entries(with_estimates: bool) -> Vec<Entry> {
    let time = Entry::new(
        Of::Body,
        "time",
        (ONE, Unit::SECOND),
        "time since frame 0 of the recording",
        |seen, row| row.push(seen.step.time),
    );
    let mut entries = vec![time];
    entries.extend(channels());
    for side in [MEASURED, SIMULATED] {
        entries.extend(motion(side));
    }
    entries.extend(whole_body());
    entries.extend(of_model());
    entries.extend(of_segments());
    if with_estimates {
        entries.extend(estimates());
    }
    entries
}

/// The channels in which flights are compared, named as by `simulate --out`.
fn channels() -> impl Iterator<Item = Entry> {
    Channel::ALL.into_iter().flat_map(|channel| {
        ["measured", "simulated"].map(|side| {
            let (name, unit) = match channel {
                Channel::Roll | Channel::Pitch | Channel::Heading => ("_rad", Unit::RADIAN),
                Channel::YawRate | Channel::AngularVelocity => ("_radps", Unit::RADIAN_PER_SECOND),
                Channel::HorizontalVelocity | Channel::VerticalVelocity => {
                    ("_mps", Unit::METRE_PER_SECOND)
                }
            };
            let key = channel.key();
            let name = format!("{side}_{}", key.strip_suffix(name).unwrap_or(key));
            let take = move |seen: &Seen<'_>, row: &mut Vec<f64>| {
                let pair = &seen.step.pair;
                let observation = if side == "measured" {
                    &pair.measured
                } else {
                    &pair.simulated
                };
                row.push(channel.value(observation));
            };
            let meaning = "a channel of the comparison; the model's as its sensors see it";
            Entry::new(Of::Body, name, (ONE, unit), meaning, take)
        })
    })
}

/// One of the two motions of a frame.
#[derive(Clone, Copy)]
struct Side {
    name: &'static str,
    motion: fn(&Step) -> &Motion<f64>,
}

const MEASURED: Side = Side {
    name: "measured",
    motion: |step| &step.measured,
};
const SIMULATED: Side = Side {
    name: "simulated",
    motion: |step| &step.simulated,
};

/// The motion of the pelvis, and the resulting poses of the segments.
fn motion(Side { name, motion }: Side) -> [Entry; 6] {
    let named = |what: &str| format!("{name}_{what}");
    [
        Entry::new(
            Of::Body,
            named("position"),
            (INERTIAL, Unit::METRE),
            "position of the pelvic joint, world axes",
            move |seen, row| row.extend(motion(seen.step).position.to_array()),
        ),
        Entry::new(
            Of::Body,
            named("velocity"),
            (INERTIAL, Unit::METRE_PER_SECOND),
            "velocity of the pelvic joint over ground, world axes",
            move |seen, row| row.extend(motion(seen.step).velocity_inertial().to_array()),
        ),
        Entry::new(
            Of::Body,
            named("attitude"),
            (ROTATION, Unit::ONE),
            "attitude of the body, quaternion world from body",
            move |seen, row| row.extend(motion(seen.step).inertial_from_body.wxyz()),
        ),
        Entry::new(
            Of::Body,
            named("body_rate"),
            (AXES, Unit::RADIAN_PER_SECOND),
            "angular velocity of the body, body axes left, dorsal, cranial",
            move |seen, row| row.extend(motion(seen.step).angular_velocity.to_array()),
        ),
        Entry::new(
            Of::Segments,
            named("position"),
            (INERTIAL, Unit::METRE),
            "position of the segment's joint, world axes",
            move |seen, row| {
                let motion = motion(seen.step);
                let joint = |segment: Segment| {
                    let joint = Vector::from_components(seen.posed[segment].joint);
                    (motion.position + motion.inertial_from_body * joint).to_array()
                };
                seen.each(joint, row);
            },
        ),
        Entry::new(
            Of::Segments,
            named("attitude"),
            (ROTATION, Unit::ONE),
            "attitude of the segment, quaternion world from segment",
            move |seen, row| {
                let body = *motion(seen.step).inertial_from_body.quaternion();
                let attitude = |segment: Segment| wxyz(&(body * seen.turned[segment]));
                seen.each(attitude, row);
            },
        ),
    ]
}

/// The measured motion of the whole body, which a body in the air keeps.
fn whole_body() -> [Entry; 3] {
    [
        Entry::new(
            Of::Body,
            "measured_cg_position",
            (INERTIAL, Unit::METRE),
            "centre of mass of the recorded posture, world axes",
            |seen, row| row.extend(seen.whole.cg_position.to_array()),
        ),
        Entry::new(
            Of::Body,
            "measured_linear_momentum",
            (INERTIAL, Unit::NEWTON_SECOND),
            "momentum of the recorded motion with that of the limbs, world axes",
            |seen, row| row.extend(seen.whole.linear_momentum.to_array()),
        ),
        Entry::new(
            Of::Body,
            "measured_angular_momentum",
            (INERTIAL, Unit::NEWTON_METRE_SECOND),
            "angular momentum about the centre of mass, with that of the limbs, world axes",
            |seen, row| row.extend(seen.whole.angular_momentum.to_array()),
        ),
    ]
}

/// Inputs and surroundings of the model.
fn of_model() -> [Entry; 6] {
    let inputs = |take: fn(&Inputs<f64>) -> [f64; 3]| {
        move |seen: &Seen<'_>, row: &mut Vec<f64>| row.extend(take(&seen.step.inputs))
    };
    [
        Entry::new(
            Of::Body,
            "muscle",
            (AXES, Unit::ONE),
            "muscle input coefficient that the model flies with",
            inputs(|inputs| inputs.muscle.to_array()),
        ),
        Entry::new(
            Of::Body,
            "damping",
            (AXES, Unit::ONE),
            "damping coefficient that the model flies with",
            inputs(|inputs| inputs.damping.to_array()),
        ),
        Entry::new(
            Of::Body,
            "residual",
            (BODY, Unit::SQUARE_METRE),
            "force that is not in the model, over dynamic pressure, body axes",
            inputs(|inputs| inputs.residual.force.to_array()),
        ),
        Entry::new(
            Of::Body,
            "residual",
            (AXES, Unit::CUBIC_METRE),
            "moment that is not in the model, over dynamic pressure",
            inputs(|inputs| inputs.residual.moment.to_array()),
        ),
        Entry::new(
            Of::Body,
            "cg",
            (BODY, Unit::METRE),
            "centre of gravity from the pelvic joint, body axes",
            |seen, row| row.extend(seen.cg),
        ),
        Entry::new(
            Of::Body,
            "air_velocity",
            (INERTIAL, Unit::METRE_PER_SECOND),
            "velocity of the air at the model's pelvis, world axes",
            |seen, row| row.extend(seen.air_velocity),
        ),
    ]
}

/// Posture and loads of each segment.
fn of_segments() -> [Entry; 6] {
    [
        Entry::new(
            Of::Segments,
            "joint",
            (ROTATION, Unit::ONE),
            "rotation of the joint, quaternion parent from segment; none in the H-pose",
            |seen, row| seen.each(|s| wxyz(seen.step.posture.parent_from_segment(s)), row),
        ),
        Entry::new(
            Of::Segments,
            "joint",
            (&["psi", "theta", "phi"], Unit::RADIAN),
            "angles of the joint about its Z, Y and X axes, as the paper turns them",
            |seen, row| {
                let angles = |s| joint_angles(seen.step.posture.parent_from_segment(s));
                seen.each(angles, row);
            },
        ),
        Entry::new(
            Of::Segments,
            "cg",
            (BODY, Unit::METRE),
            "centre of gravity of the segment from the pelvic joint, body axes",
            |seen, row| seen.each(|s| seen.posed[s].cg.into(), row),
        ),
        Entry::new(
            Of::Segments,
            "force",
            (BODY, Unit::NEWTON),
            "force of the air on the segment, body axes of the model's motion",
            |seen, row| seen.each(|s| seen.loads[s].force.into(), row),
        ),
        Entry::new(
            Of::Segments,
            "moment",
            (AXES, Unit::NEWTON_METRE),
            "moment of the air on the segment about the pelvic joint, body axes",
            |seen, row| seen.each(|s| seen.loads[s].moment.into(), row),
        ),
        Entry::new(
            Of::Segments,
            "exposed_area",
            (ONE, Unit::SQUARE_METRE),
            "area of the segment that is exposed to the stream",
            |seen, row| seen.each(|s| [seen.loads[s].exposed_area], row),
        ),
    ]
}

fn wxyz(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.w, rotation.i, rotation.j, rotation.k]
}
