//! Tests of all effects.

extern crate std;

use super::*;
use crate::Posture;
use crate::aerodynamics::Flow;
use crate::body::mass_properties::PostureRate;
use crate::body::pattern;
use crate::dynamics::Motion;
use crate::dynamics::free_run::{Equations, FreeRun};
use crate::dynamics::{Dynamics, Inputs};
use crate::effect::sensors::Moving;
use crate::frame::{Rotation, Vector};
use crate::test_body::reference_body;
use nalgebra::Vector3;

fn plain() -> Model<f64> {
    let mut dynamics = Dynamics::paper(reference_body(), 1.0);
    dynamics.air.velocity = Vector::new(0.0, 0.0, 5.0);
    Model::new(dynamics, 0.0)
}

/// Returns the measurement at the end of a fall that turns about all axes.
fn flown(model: &Model<f64>) -> Motion<f64> {
    let (posture, rate) = (Posture::h_pose(), PostureRate::zero());
    let start = Motion {
        inertial_from_body: Rotation::from_quaternion(nalgebra::UnitQuaternion::from_euler_angles(
            1.3, 0.2, 0.1,
        )),
        position: Vector::new(1.0, -2.0, 0.0),
        velocity: Vector::new(2.0, -45.0, 5.0),
        angular_velocity: Vector::new(0.2, 0.5, -0.1),
    };
    let dynamics = &model.dynamics;
    let mut run = FreeRun::new(dynamics, Equations::Exact, &start, &posture, &rate);
    let inputs = model.inputs(&Inputs::belly_turn());
    let mut before = start;
    for _ in 0..480 {
        before = run.motion(dynamics, &rate);
        run.advance(dynamics, &inputs, &posture, 1.0 / 240.0);
    }
    let motion = run.motion(dynamics, &rate);
    let past = |delay: f64| Moving::of(&motion).towards(&Moving::of(&before), delay * 240.0);
    model.sensors.observe(&motion, past, 2.0)
}

#[test]
fn a_share_of_a_range_leads_to_a_value_and_back() {
    let parameter = parameter("factor", 1.0, -0.1, 4.0);
    assert!((parameter.towards_end(0.5) - 2.5).abs() < 1e-15);
    assert!((parameter.towards_end(-0.5) - 0.45).abs() < 1e-15);
    for share in [-1.0_f64, -0.3, 0.0, 0.02, 1.0] {
        let there = parameter.share_of_range(parameter.towards_end(share));
        assert!((there - share.abs()).abs() < 1e-15);
    }
    let one_sided = super::parameter("mass_kg", 0.0, 0.0, 8.0);
    assert!(one_sided.towards_end(-0.5).abs() < 1e-15);
    assert!(one_sided.share_of_range(0.0).abs() < 1e-15);
}

#[test]
fn descriptions_are_complete_and_name_each_other() {
    for &effect in Effect::ALL {
        let description = effect.description();
        assert_eq!(Effect::from_name(description.name), Some(effect));
        assert!((1..=PARAMETER_COUNT).contains(&description.parameters.len()));
        for parameter in description.parameters {
            assert!(parameter.low <= parameter.neutral && parameter.neutral < parameter.high);
        }
        for name in description.confused_with {
            let rival = Effect::from_name(name);
            assert!(rival.is_some_and(|rival| rival != effect), "{name}");
        }
    }
}

#[test]
fn neutral_values_keep_every_bit() {
    let without = flown(&plain());
    for &effect in Effect::ALL {
        let mut model = plain();
        effect.apply(&effect.neutral(), &mut model).unwrap();
        assert_eq!(flown(&model), without, "{effect:?}");
    }
}

#[test]
fn every_parameter_moves_the_flight() {
    for &effect in Effect::ALL {
        for (index, parameter) in effect.description().parameters.iter().enumerate() {
            // These effects need moving joints, which this flight does not have.
            if [Effect::PostureDelay, Effect::ForceLag].contains(&effect) {
                continue;
            }
            // A model uses the mean of an effect that changes at random.
            if effect.is_random() {
                continue;
            }
            // Only the most exposed face of a segment has an effect, and this flight does not expose every face of
            // each group.
            if [Effect::TrunkShape, Effect::ArmShape, Effect::LegShape].contains(&effect) {
                continue;
            }
            let mut values = effect.neutral();
            values[index] += 0.2 * (parameter.high - parameter.neutral);
            let mut model = plain();
            effect.apply(&values, &mut model).unwrap();
            let (with, without) = (flown(&model), flown(&plain()));
            let gap = (with.velocity - without.velocity).norm()
                + (with.angular_velocity - without.angular_velocity).norm();
            assert!(gap > 1e-4, "{effect:?} {}: {gap}", parameter.name);
        }
    }
}

#[test]
fn random_effects_keep_their_strength_and_leave_the_mean_unchanged() {
    for &effect in Effect::ALL.iter().filter(|effect| effect.is_random()) {
        let mut values = effect.neutral();
        values[0] = 0.5;
        let mut model = plain();
        effect.apply(&values, &mut model).unwrap();
        assert_ne!(model.random, random::Random::none(), "{effect:?}");
        assert_eq!(flown(&model), flown(&plain()), "{effect:?}");
    }
    let mut model = plain();
    for share in [0.3, 0.4] {
        let effect = Effect::MuscleOverTime;
        effect.apply(&[share, 0.0, 0.0], &mut model).unwrap();
    }
    assert!((model.random.muscle.pitch - 0.5).abs() < 1e-12);
}

#[test]
fn every_axis_of_a_shape_changes_its_areas() {
    for effect in [Effect::TrunkShape, Effect::ArmShape, Effect::LegShape] {
        for index in 0..3 {
            let mut values = effect.neutral();
            values[index] = 2.0;
            let mut model = plain();
            effect.apply(&values, &mut model).unwrap();
            let areas = |model: &Model<f64>| -> f64 {
                let segments = model.dynamics.body.segments.values();
                segments.map(|segment| segment.area[index]).sum()
            };
            assert!(areas(&model) > areas(&plain()) + 0.01, "{effect:?} {index}");
        }
    }
}

#[test]
fn implausible_values_are_refused_and_change_nothing() {
    for &effect in Effect::ALL {
        let last = effect.description().parameters.len() - 1;
        for bad in [f64::NAN, f64::INFINITY, -1e3] {
            let mut values = effect.neutral();
            values[last] = bad;
            let mut model = plain();
            let error = effect.apply(&values, &mut model).unwrap_err();
            assert_eq!(error.parameter, &effect.description().parameters[last]);
            assert_eq!(model, plain());
        }
    }
}

fn flies<T: Real>(effect: Effect, values: &[f64; PARAMETER_COUNT]) -> bool {
    let mut dynamics = Dynamics::paper(reference_body().cast::<T>(), T::one());
    dynamics.air.velocity = Vector::new(T::zero(), T::zero(), T::of(5.0));
    let mut model = Model::new(dynamics, T::zero());
    effect.apply(values, &mut model).unwrap();
    let (posture, rate) = (Posture::h_pose(), PostureRate::zero());
    let belly = nalgebra::UnitQuaternion::from_euler_angles(T::of(1.3), T::of(0.2), T::of(0.1));
    let start = Motion {
        inertial_from_body: Rotation::from_quaternion(belly),
        position: Vector::new(T::one(), T::of(-2.0), T::zero()),
        velocity: Vector::new(T::of(2.0), T::of(-45.0), T::of(5.0)),
        angular_velocity: Vector::new(T::of(0.1), T::of(0.3), T::of(-0.1)),
    };
    let mut run = FreeRun::new(&model.dynamics, Equations::Exact, &start, &posture, &rate);
    let inputs = model.inputs(&Inputs::belly_turn());
    for _ in 0..960 {
        run.advance(&model.dynamics, &inputs, &posture, T::of(1.0 / 240.0));
    }
    let motion = run.motion(&model.dynamics, &rate);
    let seen = model
        .sensors
        .observe(&motion, |_| Moving::of(&motion), T::of(4.0));
    let numbers = seen.velocity.components.iter();
    numbers
        .chain(&seen.angular_velocity.components)
        .all(|value| *value < T::of(1e3) && *value > T::of(-1e3))
}

#[test]
fn a_force_lag_is_felt_while_joints_move_and_by_the_air_alone() {
    let dynamics = plain().dynamics;
    let mut model = plain();
    Effect::ForceLag
        .apply(&[0.1, 0.0, 0.0], &mut model)
        .unwrap();
    let (from, to) = (
        pattern::neutral(),
        pattern::arched(&pattern::neutral(), 0.05),
    );
    let held = |dynamics: &Dynamics<f64>| dynamics.between(&from, &from, 0.1);
    assert_eq!(held(&model.dynamics), held(&dynamics));
    let (late, plain) = (
        model.dynamics.between(&from, &to, 0.1),
        dynamics.between(&from, &to, 0.1),
    );
    assert_eq!((late.mass, late.inertia), (plain.mass, plain.inertia));
    // A tenth of a second before the middle of the interval is half an interval before its start.
    let before = pattern::arched(&pattern::neutral(), -0.025);
    let expected = dynamics.hold(&before).aerodynamics;
    let flow = Flow::new(&Vector3::new(1.0, -50.0, 3.0), 1.0);
    let [seen, expected, other] =
        [late.aerodynamics, expected, plain.aerodynamics].map(|a| a.total_load(&flow).force);
    assert!((seen - expected).norm() < 0.01 * (other - expected).norm());
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(400))]
    /// Within its plausible range, an effect leaves a flight of finite numbers, in both precisions.
    #[test]
    fn plausible_effects_leave_a_flight_of_finite_numbers(
        index in 0..Effect::ALL.len(),
        shares in proptest::array::uniform3(proptest::prop_oneof![
            proptest::strategy::Just(0.0), proptest::strategy::Just(1.0), 0.0..=1.0,
        ]),
    ) {
        let effect = Effect::ALL[index];
        let mut values = effect.neutral();
        let parameters = effect.description().parameters;
        for ((value, parameter), share) in values.iter_mut().zip(parameters).zip(shares) {
            *value = (1.0 - share) * parameter.low + share * parameter.high;
            *value = value.clamp(parameter.low, parameter.high);
        }
        proptest::prop_assert!(flies::<f64>(effect, &values), "{effect:?} {values:?} in f64");
        proptest::prop_assert!(flies::<f32>(effect, &values), "{effect:?} {values:?} in f32");
    }
}

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/effects.md");

fn page() -> std::string::String {
    use std::fmt::Write;
    let mut page = std::string::String::from(
        "# Effects\n\n\
         Effects that the model may lack, one file each in `core/src/effect/`. `bodyflight discover` searches for them, \
         `bodyflight hide` hides them in flights, and a `model.toml` adds them:\n\n\
         ```toml\n[[effect]]\nname = \"wind\"\nnorth_mps = 3.5\n```\n\n\
         Omitted parameters keep their neutral values, at which they have no effect. Anything else can be written as \
         a load by description (below). This page is generated from the code:\n\n\
         ```sh\nBODYFLIGHT_WRITE_DOCS=1 cargo test -p bodyflight-core effect\n```\n",
    );
    for (kind, title) in [
        (Kind::Physics, "Effects on the motion"),
        (Kind::Measurement, "Effects on the measurement"),
        (Kind::Random, "Effects that change at random"),
    ] {
        writeln!(page, "\n## {title}").unwrap();
        if kind == Kind::Random {
            page += RANDOM;
        }
        for effect in Effect::ALL.iter().filter(|e| e.description().kind == kind) {
            let Description {
                name,
                form,
                parameters,
                source,
                signature,
                confused_with,
                separated_by,
                ..
            } = effect.description();
            writeln!(page, "\n### {name}\n\n{form}. Source: {source}.\n").unwrap();
            writeln!(
                page,
                "| parameter | neutral value | plausible range |\n|---|---|---|"
            )
            .unwrap();
            for Parameter {
                name,
                neutral,
                low,
                high,
            } in *parameters
            {
                writeln!(page, "| `{name}` | {neutral} | {low} to {high} |").unwrap();
            }
            writeln!(page, "\nSignature: {signature}.").unwrap();
            let rivals = confused_with.join(", ");
            writeln!(
                page,
                "Confused with: {rivals}. Distinguished by: {separated_by}."
            )
            .unwrap();
        }
    }
    page + LOADS
}

const RANDOM: &str = "\n\
    Only the strength of these effects is known, a standard deviation, and not their course over time. `hide` draws a \
    different path for each flight, by the seed. `discover` estimates the strength; `simulate --model` uses the mean, which \
    is the model without the effect, and warns.\n";

const LOADS: &str = r#"
## Loads by description

An `[[effect]]` without a name is a force or a moment along an axis, times at most three factors; a file has at most
twelve. `simulate`, `estimate`, `view` and `hide --model` apply them; `discover` writes its descriptions in this form.

```toml
[[effect]]
moment_nm = 25.0
along = "dorsal"
times = [{ factor = "sine", frequency_hz = 3.1, phase_rad = 0.4 }]

[[effect]]
force_n = 40.0
at = "l_foot"
along = "stream"
times = [
  { factor = "speed-squared", reference_mps = 50.0 },
  { factor = "joint", segment = "l_shank", axis = "x", reference_rad = 1.0 },
]
```

| key | meaning |
|---|---|
| `force_n` or `moment_nm` | size when every factor is one (N, N m) |
| `along` | `left`, `dorsal`, `cranial` (body); `north`, `west`, `up` (inertial); `stream` (the direction of drag); a segment and its axis, `"l_shank x"` |
| `at` | segment at whose centre of gravity a force acts; the body's if omitted. A moment has none |

| factor | value | keys |
|---|---|---|
| `speed` | speed through the air over a reference | `reference_mps` |
| `speed-squared` | its square | `reference_mps` |
| `joint` | component of the rotation vector of a joint, less `from_rad`, over a reference | `segment`, `axis`, `from_rad` (0), `reference_rad` |
| `turn` | angular velocity about a body axis over a reference | `axis`, `reference_radps` |
| `height` | height, inertial, less `from_m`, over a reference | `from_m`, `reference_m` |
| `sine` | sine of the time since the first frame | `frequency_hz`, `phase_rad` (0) |
| `pulse` | one for a time, zero otherwise; repeated if there is a period | `start_s`, `duration_s`, `period_s` (0: once) |

A factor has no unit: it is a quantity divided by a reference in the same unit, which the key names. The size is
therefore always in N or N m, and a key in another unit is refused.
"#;

#[test]
fn the_page_of_effects_says_what_the_code_says() {
    let page = page();
    if std::env::var_os("BODYFLIGHT_WRITE_DOCS").is_some() {
        std::fs::write(PAGE, &page).unwrap();
    }
    let found = std::fs::read_to_string(PAGE).unwrap_or_default();
    assert!(
        found == page,
        "docs/effects.md differs from the code: BODYFLIGHT_WRITE_DOCS=1 cargo test -p bodyflight-core effect"
    );
}
