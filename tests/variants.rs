//! Variants of a flight that are flown together have the bits that each of them has alone.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Pair;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::{InputHistory, InputRow};
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::steps::{Divergence, Replay};
use bodyflight_replay::variants::{Variant, fly};
use bodyflight_tests::small_recording;

/// A turning fall of 1.5 s at 240 Hz, or at 60 Hz, where a frame takes four steps.
fn frames(of_240: usize) -> Vec<FlightFrame> {
    small_recording::flight(360).step_by(of_240).collect()
}

/// The numbers of a flight alone, and whether it diverges.
fn alone(variant: &Variant, frames: &[FlightFrame]) -> (Vec<u64>, Option<String>) {
    let frames = frames.iter().copied().map(Ok);
    let dynamics = |_| variant.dynamics;
    let replay = Replay::with_dynamics(&variant.flight, frames, Precision::Double, dynamics);
    let mut replay = replay.expect("a start").on_divergence(Divergence::Held);
    let steps = replay.by_ref();
    let seen = steps.flat_map(|step| bits(&step.expect("a step").pair));
    (seen.collect(), replay.diverged())
}

fn bits(pair: &Pair) -> Vec<u64> {
    let both = [pair.measured, pair.simulated];
    let numbers = both.iter().flat_map(|seen| {
        let [x, y, z] = seen.angular_velocity.to_array();
        let angles = &seen.angles;
        [
            angles.heading,
            angles.pitch,
            angles.roll,
            seen.yaw_rate,
            x,
            y,
            z,
            seen.horizontal_speed,
            seen.vertical_velocity,
        ]
    });
    numbers.chain([pair.time]).map(f64::to_bits).collect()
}

fn assert_together_as_alone(variants: &[Variant], frames: &[FlightFrame]) -> Vec<Option<String>> {
    let mut together = vec![Vec::new(); variants.len()];
    let diverged = fly(frames, variants, &mut |index, pair| {
        together[index].extend(bits(&pair));
    });
    let diverged = diverged.expect("flown");
    for (index, variant) in variants.iter().enumerate() {
        let (seen, doubt) = alone(variant, frames);
        assert!(seen.len() >= 19 * 80, "{index}");
        assert!(
            seen == together[index],
            "variant {index} of {}",
            variants.len()
        );
        assert_eq!(doubt, diverged[index]);
    }
    diverged
}

/// Variants of coefficients, areas, damping and masses.
fn variants(flight: &Flight, change: impl Fn(&mut Dynamics<f64>)) -> Vec<Variant> {
    let one = |number: u32| {
        let share = 0.1 * f64::from(number);
        let mut flight = flight.clone();
        let mut dynamics = flight.dynamics(4000.0);
        change(&mut dynamics);
        let air = &mut dynamics.aerodynamics.coefficients;
        air[Segment::LeftThigh].drag *= 0.6 + share;
        air.values_mut().for_each(|own| own.lift *= 1.5 - share);
        air[Segment::Thorax].moment *= 1.0 + share;
        dynamics.body.segments[Segment::RightFoot].area *= 0.8 + share;
        if number == 3 {
            // Has its own masses, so that it flies alone.
            dynamics.body.segments[Segment::Head].mass *= 1.2;
        }
        flight
            .subject
            .set_damping([3.0 - share, 0.5, 6.0 + share].into());
        Variant { flight, dynamics }
    };
    (0..12).map(one).collect()
}

fn bare() -> Flight {
    Flight::bare(Path::new("flight.mvnx"))
}

/// Inputs of which the limbs and the forces change.
fn inputs() -> InputHistory {
    use bodyflight_core::dynamics::muscle_input::{BACK_TRACKING, BELLY_TRACKING};
    let inputs = bare().constant_inputs();
    let row = |time: f64, muscle: f64| {
        let mut inputs = inputs;
        inputs.muscle = [muscle, -muscle, 0.5].into();
        InputRow::of(time, &inputs)
    };
    InputHistory::new(vec![
        row(0.0, 0.1).with_muscles(&BACK_TRACKING),
        row(0.5, -0.3).with_muscles(&BELLY_TRACKING),
        row(1.4, 0.2),
    ])
}

#[test]
fn variants_have_the_bits_of_each_alone() {
    for of_240 in [1, 4] {
        let frames = frames(of_240);
        assert_together_as_alone(&variants(&bare(), |_| ()), &frames);
        let acting = Flight {
            inputs: Some(inputs()),
            ..bare()
        };
        assert_together_as_alone(&variants(&acting, |_| ()), &frames);
        let free_fly = |dynamics: &mut Dynamics<f64>| {
            dynamics.aerodynamics.model = LoadModel::FreeFly;
        };
        assert_together_as_alone(&variants(&bare(), free_fly), &frames);
    }
}

#[test]
fn variants_with_effects_have_the_bits_of_each_alone() {
    let models = [
        "[[effect]]\nname = \"wind\"\nnorth_mps = 4.0\n[[effect]]\nname = \"gnss-latency\"\nlatency_s = 0.2\n",
        "[[effect]]\nname = \"force-lag\"\nlag_s = 0.1\n",
        "[[effect]]\nmoment_nm = 20.0\nalong = \"dorsal\"\n",
    ];
    for model in models {
        let flight = Flight {
            effects: Effects::parse(model, Path::new("model.toml")).expect(model),
            ..bare()
        };
        assert_together_as_alone(&variants(&flight, |_| ()), &frames(1));
    }
    let published = Flight {
        equations: Equations::AsPublished,
        ..bare()
    };
    assert_together_as_alone(&variants(&published, |_| ()), &frames(4));
}

#[test]
fn a_variant_that_diverges_leaves_the_others_as_they_are() {
    let mut variants = variants(&bare(), |_| ());
    variants[1]
        .flight
        .subject
        .set_damping([-90.0, -90.0, -90.0].into());
    variants[1].dynamics.aerodynamics.scale_area(90.0);
    let diverged = assert_together_as_alone(&variants, &frames(1));
    assert!(diverged[1].is_some() && diverged[0].is_none());
}

#[test]
fn nothing_to_fly_is_no_error() {
    assert!(
        fly(&frames(1), &[], &mut |_, _| ())
            .expect("nothing")
            .is_empty()
    );
    let variants = variants(&bare(), |_| ());
    let problem = fly(&frames(1)[..1], &variants, &mut |_, _| ()).expect_err("one frame");
    assert!(problem.to_string().contains("two frames"), "{problem}");
}
