//! Feature `serde`: vectors, rotations, postures and segments as plain numbers and names.
//!
//! A vector is `[x, y, z]` in its frame, a rotation the quaternion `[w, x, y, z]`, a posture the 16 rotations of its
//! segments relative to their parents in the order of [`Segment::ALL`](crate::Segment::ALL), a segment its name.
//! Rotations are normalized when they are read.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Posture;
use crate::body::{Segment, SegmentArray};
use crate::frame::{Rotation, Vector};
use crate::math::{Lanes, Real};

impl<T: Lanes + Serialize, F> Serialize for Vector<T, F> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        <[T; 3]>::from(self.components).serialize(serializer)
    }
}

impl<'de, T: Lanes + Deserialize<'de>, F> Deserialize<'de> for Vector<T, F> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let components = <[T; 3]>::deserialize(deserializer)?;
        Ok(Self::from_components(Vector3::from(components)))
    }
}

impl<T: Lanes + Serialize, To, From> Serialize for Rotation<T, To, From> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.wxyz().serialize(serializer)
    }
}

impl<'de, T: Real + Deserialize<'de>, To, From> Deserialize<'de> for Rotation<T, To, From> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let wxyz @ [w, x, y, z] = <[T; 4]>::deserialize(deserializer)?;
        let given = Quaternion::new(w, x, y, z);
        // A quaternion that this crate has written is read back bit for bit.
        if (given.norm_squared() - T::one()).abs() <= T::default_epsilon() * T::of(8.0) {
            return Ok(Self::from_quaternion(UnitQuaternion::new_unchecked(given)));
        }
        Self::from_wxyz(wxyz).ok_or_else(|| {
            D::Error::custom("expected a quaternion w, x, y, z of finite size above 0")
        })
    }
}

/// A rotation between frames that have no type of their own.
type Joint<T> = Rotation<T, (), ()>;

impl<T: Lanes + Serialize> Serialize for Posture<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SegmentArray::from_fn(|segment| Joint::from_quaternion(*self.parent_from_segment(segment)))
            .serialize(serializer)
    }
}

impl<'de, T: Real + Deserialize<'de>> Deserialize<'de> for Posture<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let joints = SegmentArray::<Joint<T>>::deserialize(deserializer)?;
        if *joints[Segment::Pelvis].quaternion() != UnitQuaternion::identity() {
            return Err(D::Error::custom(
                "expected the identity for the pelvis, which has no parent",
            ));
        }
        let mut posture = Self::h_pose();
        for (segment, joint) in joints.iter() {
            posture.set(segment, *joint.quaternion());
        }
        Ok(posture)
    }
}

impl Serialize for Segment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Segment {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl Visitor<'_> for Name {
            type Value = Segment;
            fn expecting(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                out.write_str("the name of a segment, as pelvis or left_thigh")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Segment, E> {
                Segment::from_name(name)
                    .ok_or_else(|| E::invalid_value(Unexpected::Str(name), &self))
            }
        }
        deserializer.deserialize_str(Name)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use core::fmt::Debug;

    use serde::de::DeserializeOwned;
    use std::string::{String, ToString};

    use super::*;
    use crate::Body;
    use crate::body::pattern;
    use crate::dynamics::{Dynamics, Inputs, Motion, State};
    use crate::test_body::reference_body;

    fn there_and_back<V: Serialize + DeserializeOwned + PartialEq + Debug>(value: &V) -> String {
        // Compares numbers rather than text, which serde_json reads to the last bit only with an extra feature.
        let numbers = serde_json::to_value(value).unwrap();
        assert_eq!(serde_json::from_value::<V>(numbers).unwrap(), *value);
        serde_json::to_string(value).unwrap()
    }

    #[test]
    fn every_type_survives_the_round_trip_through_text() {
        let body: Body<f64> = reference_body();
        there_and_back(&body);
        let posture = pattern::moved(&pattern::neutral(), pattern::DRAW_IN_LEFT, 0.5);
        there_and_back(&posture);
        let motion = Motion::<f64> {
            inertial_from_body: Rotation::from_wxyz([0.5, -0.5, 0.5, 0.5]).unwrap(),
            position: Vector::new(1.0, 2.0, 3.0),
            velocity: Vector::new(0.0, -50.0, 0.1),
            angular_velocity: Vector::zero(),
        };
        let text = there_and_back(&motion);
        assert!(text.contains("[0.5,-0.5,0.5,0.5]"), "{text}");
        there_and_back(&Inputs::<f64>::belly_turn());
        let dynamics = Dynamics::paper(body, 1.0);
        there_and_back(&State::from_motion(&motion, &dynamics.hold(&posture)));
        for segment in Segment::ALL {
            there_and_back(&segment);
        }
    }

    #[test]
    fn invalid_rotations_and_segments_are_refused() {
        for text in ["[0,0,0,0]", "[1,0,0]", "[1e39,0,0,0]"] {
            assert!(serde_json::from_str::<Joint<f32>>(text).is_err(), "{text}");
        }
        let mut rotations = [[1.0, 0.0, 0.0, 0.0]; 16];
        rotations[0] = [0.0, 1.0, 0.0, 0.0];
        let text = serde_json::to_string(&rotations).unwrap();
        let message = serde_json::from_str::<Posture<f64>>(&text).unwrap_err();
        assert!(message.to_string().contains("pelvis"), "{message}");
        let message = serde_json::from_str::<Segment>("\"tail\"").unwrap_err();
        assert!(message.to_string().contains("left_thigh"), "{message}");
    }
}
