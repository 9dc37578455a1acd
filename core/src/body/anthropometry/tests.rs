//! Tests with measured men, random persons, and persons that must be rejected.

extern crate std;

use nalgebra::Matrix3;
use proptest::prelude::*;

use super::*;
use crate::body::mass_properties::MassProperties;
use crate::body::posture::{Posture, pose};
use crate::body::solid::is_possible_inertia;

fn body(height: f64, mass: f64) -> Body<f64> {
    Person::new(height, mass, Sex::Male).body().unwrap()
}

/// Depth of the centre of gravity below the vertex as a share of the stature, and the inertia about it.
fn whole(body: &Body<f64>, posture: &Posture<f64>) -> (f64, Matrix3<f64>) {
    let posed = pose(body, posture);
    let sums = MassProperties::of(body, &posed);
    let head = posed[Segment::Head].joint.z + body.segments[Segment::Head].length;
    ((head - sums.cg.z) / body.height, sums.inertia_about_cg())
}

/// Arms and legs held away from the sides by these angles (rad).
fn abducted(arms: f64, legs: f64) -> Posture<f64> {
    Posture::h_pose()
        .with_angles(Segment::LeftUpperArm, 0.0, arms, 0.0)
        .with_angles(Segment::RightUpperArm, 0.0, -arms, 0.0)
        .with_angles(Segment::LeftThigh, 0.0, legs, 0.0)
        .with_angles(Segment::RightThigh, 0.0, -legs, 0.0)
}

/// Three men of Santschi et al. 1963: centre of gravity from the vertex, inertia about the AP, ML and long axes.
#[test]
fn whole_body_inertia_is_that_of_measured_men() {
    let postures = [
        abducted(0.0, 0.0),
        abducted(core::f64::consts::PI, 0.0),
        abducted(2.3, 0.4),
    ];
    let men = [
        (
            1.834,
            78.7,
            [
                (0.446, 14.91, 13.45, 1.48),
                (0.414, 19.66, 17.96, 1.41),
                (0.409, 19.43, 15.25, 4.73),
            ],
        ),
        (
            1.712,
            66.8,
            [
                (0.442, 10.80, 9.25, 1.16),
                (0.408, 14.24, 12.43, 1.15),
                (0.404, 14.12, 10.20, 3.39),
            ],
        ),
        (
            1.862,
            92.1,
            [
                (0.434, 16.27, 14.58, 1.60),
                (0.401, 21.24, 19.43, 1.56),
                (0.4025, 21.13, 16.04, 5.79),
            ],
        ),
    ];
    for (height, mass, measured) in men {
        for (posture, (cg, ap, ml, long)) in postures.iter().zip(measured) {
            let (found_cg, inertia) = whole(&body(height, mass), posture);
            let error = [inertia.m22 / ap, inertia.m11 / ml, inertia.m33 / long].map(|r| r - 1.0);
            std::eprintln!("{height} cg {found_cg:.3} ({cg}), AP ML long {error:.2?}");
            assert!(
                (found_cg - cg).abs() < 0.015,
                "cg {found_cg}, measured {cg}"
            );
            assert!(error[0].abs() < 0.15 && error[1].abs() < 0.15, "{error:?}");
            assert!(error[2].abs() < 0.35, "{error:?}");
        }
    }
}

proptest! {
    #[test]
    fn every_person_is_a_possible_body(
        height in 1.4f64..2.1, mass in 40.0f64..140.0, female in any::<bool>()
    ) {
        let sex = if female { Sex::Female } else { Sex::Male };
        prop_assume!((9.5..74.0).contains(&(mass / (height * height))));
        let body = Person::new(height, mass, sex).body().unwrap();
        prop_assert!((body.mass() - mass).abs() < 1e-11);
        for (segment, p) in body.segments.iter() {
            prop_assert!(is_possible_inertia(&p.inertia), "{segment:?}");
            prop_assert!(p.area.min() > 0.0 && p.moment_arm > 0.0 && p.length > 0.0);
            let other = &body.segments[segment.mirrored()];
            prop_assert!((p.mass - other.mass).abs() < 1e-12);
            prop_assert!((p.joint_offset.x + other.joint_offset.x).abs() < 1e-12);
        }
        let posed = pose(&body, &Posture::h_pose());
        let top = posed[Segment::Head].joint.z + body.segments[Segment::Head].length;
        let sole = posed[Segment::LeftFoot].joint.z - ANKLE_HEIGHT * height;
        prop_assert!((top - sole - height).abs() < 1e-9);
    }

    #[test]
    fn no_bits_make_a_person_panic(
        height in any::<u32>(), mass in any::<u32>(), waist in any::<u32>(), arm in any::<u32>()
    ) {
        let mut person = Person::new(f32::from_bits(height), f32::from_bits(mass), Sex::Female);
        person.moment_arm = MomentArm::FractionOfLength(f32::from_bits(arm));
        let _ = person.body();
        person = Person::new(1.7, 60.0, Sex::Female);
        person.girths.set(Girth::Waist, f32::from_bits(waist));
        if let Ok(body) = person.body() {
            prop_assert!(body.segments.values().all(|s| s.inertia.iter().all(|i| i.is_finite())));
        }
    }
}

#[test]
fn refusals_name_measure_value_and_range() {
    for height in [f64::NAN, -1.7, 0.0, 17.0, f64::INFINITY] {
        let error = Person::new(height, 70.0, Sex::Male).body().unwrap_err();
        assert_eq!(error.measure, Measure::Height);
        assert_eq!((error.low, error.high), HEIGHT_RANGE);
    }
    let mut person = Person::new(1.75, 75.0, Sex::Male);
    person.girths.set(Girth::Calf, 3.8);
    let error = person.body().unwrap_err();
    assert_eq!(error.measure, Measure::Girth(Girth::Calf));
    assert!(
        std::format!("{error}").starts_with("calf is 3.8 m, expected 0.18"),
        "{error}"
    );
}

#[test]
fn girths_change_only_what_they_measure() {
    let plain = Person::new(1.75, 75.0, Sex::Male);
    let mut wide = plain;
    wide.girths.set(Girth::Calf, 0.45);
    let (plain, wide) = (plain.body().unwrap(), wide.body().unwrap());
    for (segment, p) in plain.segments.iter() {
        let shank = matches!(segment, Segment::LeftShank | Segment::RightShank);
        assert_eq!(*p != wide.segments[segment], shank, "{segment:?}");
    }
}
