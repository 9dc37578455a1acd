//! The elements of a frame: names, sizes, and sets of them.

use super::header::Header;

/// How many numbers an element has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Size {
    PerSegment(usize),
    PerSensor(usize),
    PerJoint(usize),
    PerErgonomicAngle(usize),
    PerContact(usize),
    /// Position, or position with velocity and acceleration.
    PointOrMotion,
    /// As many as in the first frame: the header does not specify it.
    AsFirst,
}

macro_rules! fields {
    ($($(#[$doc:meta])* $field:ident $element:literal $size:expr;)*) => {
        /// An element of a frame that holds numbers. Values are in SI units and global axes (X forward, Y left, Z up)
        /// unless stated otherwise.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Field {
            $($(#[$doc])* $field,)*
        }

        impl Field {
            /// All fields in file order.
            pub const ALL: [Self; [$(stringify!($field)),*].len()] = [$(Self::$field),*];

            /// Name of the element.
            pub const fn element(self) -> &'static str {
                match self { $(Self::$field => $element,)* }
            }

            /// The field with this element name.
            pub fn from_element(name: &str) -> Option<Self> {
                match name { $($element => Some(Self::$field),)* _ => None }
            }

            const fn size(self) -> Size {
                match self { $(Self::$field => $size,)* }
            }
        }
    };
}

fields! {
    /// Rotation of each segment, global from segment, quaternion w x y z.
    Orientation "orientation" Size::PerSegment(4);
    /// Origin of each segment (m).
    Position "position" Size::PerSegment(3);
    /// Velocity of each origin (m/s).
    Velocity "velocity" Size::PerSegment(3);
    /// Acceleration of each origin, without gravity (m/s2).
    Acceleration "acceleration" Size::PerSegment(3);
    /// Angular velocity of each segment (rad/s).
    AngularVelocity "angularVelocity" Size::PerSegment(3);
    /// Angular acceleration of each segment (rad/s2).
    AngularAcceleration "angularAcceleration" Size::PerSegment(3);
    /// Ground contact of heels and toes, 0 or 1.
    FootContacts "footContacts" Size::PerContact(1);
    /// Acceleration at each sensor, without gravity (m/s2).
    SensorFreeAcceleration "sensorFreeAcceleration" Size::PerSensor(3);
    /// Reading of each accelerometer, in its own axes, with gravity (m/s2).
    SensorAcceleration "sensorAcceleration" Size::PerSensor(3);
    /// Reading of each gyroscope, in its own axes (rad/s).
    SensorAngularVelocity "sensorAngularVelocity" Size::PerSensor(3);
    /// Reading of each magnetometer, in its own axes (1 = the field at the place of calibration).
    SensorMagneticField "sensorMagneticField" Size::PerSensor(3);
    /// Rotation of each sensor, global from sensor, quaternion w x y z.
    SensorOrientation "sensorOrientation" Size::PerSensor(4);
    /// Joint angles in the sequence ZXY (deg).
    JointAngle "jointAngle" Size::PerJoint(3);
    /// Joint angles in the sequence XZY (deg).
    JointAngleXzy "jointAngleXZY" Size::PerJoint(3);
    /// Ergonomic joint angles (deg).
    JointAngleErgo "jointAngleErgo" Size::PerErgonomicAngle(3);
    /// Ergonomic joint angles in the sequence XZY (deg).
    JointAngleErgoXzy "jointAngleErgoXZY" Size::PerErgonomicAngle(3);
    /// Joint angles of the left fingers (deg).
    JointAngleFingersLeft "jointAngleFingersLeft" Size::AsFirst;
    /// Joint angles of the right fingers (deg).
    JointAngleFingersRight "jointAngleFingersRight" Size::AsFirst;
    /// Joint angles of the left fingers in the sequence XZY (deg).
    JointAngleFingersLeftXzy "jointAngleFingersLeftXZY" Size::AsFirst;
    /// Joint angles of the right fingers in the sequence XZY (deg).
    JointAngleFingersRightXzy "jointAngleFingersRightXZY" Size::AsFirst;
    /// Centre of mass (m), since MVN 2020 with its velocity (m/s) and acceleration (m/s2).
    CenterOfMass "centerOfMass" Size::PointOrMotion;
}

impl Field {
    /// Whether `count` is the right number of values for a file with this header. `first` is the count in the first
    /// frame, which decides if the header does not specify it.
    pub(super) fn accepts(self, count: usize, header: &Header, first: Option<usize>) -> bool {
        match self.declared(header) {
            Some(declared) => count == declared,
            None if self.size() == Size::PointOrMotion => count == 3 || count == 9,
            None => first.is_none_or(|first| count == first),
        }
    }

    /// Largest plausible magnitude of a number, in the unit of the field; `None` if any finite number is accepted.
    pub(super) const fn limit(self) -> Option<f64> {
        match self {
            // A position on Earth in any coordinates.
            Self::Position | Self::CenterOfMass => Some(1e7),
            Self::Velocity => Some(1e3),
            Self::AngularVelocity => Some(1e3),
            Self::Acceleration | Self::AngularAcceleration => Some(1e6),
            _ => None,
        }
    }

    /// The expected count as a phrase for messages.
    pub(super) fn expectation(self, header: &Header, first: Option<usize>) -> String {
        match (self.declared(header), first) {
            (Some(count), _) => format!("expected {count} numbers"),
            (None, _) if self.size() == Size::PointOrMotion => "expected 3 or 9 numbers".into(),
            (None, Some(count)) => format!("expected {count} numbers as in the first frame"),
            (None, None) => "expected numbers".into(),
        }
    }

    /// How many numbers the header declares.
    fn declared(self, header: &Header) -> Option<usize> {
        let (each, count) = match self.size() {
            Size::PerSegment(each) => (each, Some(header.segments.len())),
            Size::PerSensor(each) => (each, header.sensor_count),
            Size::PerJoint(each) => (each, header.joint_count),
            Size::PerErgonomicAngle(each) => {
                (each, some_unless_zero(header.ergonomic_angles.len()))
            }
            Size::PerContact(each) => (each, some_unless_zero(header.foot_contacts.len())),
            Size::PointOrMotion | Size::AsFirst => return None,
        };
        count.map(|count| each.saturating_mul(count))
    }
}

fn some_unless_zero(count: usize) -> Option<usize> {
    (count > 0).then_some(count)
}

/// A set of fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Fields(u32);

impl Fields {
    /// No field.
    pub const NONE: Self = Self(0);
    /// Every field.
    pub const ALL: Self = Self((1 << Field::ALL.len()) - 1);
    /// The fields that a flight needs: attitude, position and rates of the pelvis, the posture, and the centre of mass.
    pub const FLIGHT: Self = Self::NONE
        .with(Field::Orientation)
        .with(Field::Position)
        .with(Field::Velocity)
        .with(Field::AngularVelocity)
        .with(Field::CenterOfMass);

    /// The set with one more field.
    #[must_use]
    pub const fn with(self, field: Field) -> Self {
        Self(self.0 | 1 << field as u32)
    }

    /// Whether the field is in the set.
    pub const fn contains(self, field: Field) -> bool {
        self.0 & (1 << field as u32) != 0
    }

    /// The fields of `self` that are not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The fields in both sets.
    #[must_use]
    pub const fn common(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The fields in file order.
    pub fn iter(self) -> impl Iterator<Item = Field> {
        Field::ALL
            .into_iter()
            .filter(move |field| self.contains(*field))
    }
}

/// What to read, and whether a truncated file is accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadOptions {
    /// Fields to read; others are skipped.
    pub fields: Fields,
    /// Accepts a file that ends too early, up to its last complete frame.
    pub allow_truncated: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            fields: Fields::FLIGHT,
            allow_truncated: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_name_their_fields() {
        for field in Field::ALL {
            assert_eq!(Field::from_element(field.element()), Some(field));
            assert!(Fields::ALL.contains(field));
        }
        assert_eq!(Fields::ALL.iter().count(), Field::ALL.len());
        assert_eq!(Field::from_element("fooContacts"), None);
        assert!(!Fields::FLIGHT.contains(Field::JointAngle));
    }
}
