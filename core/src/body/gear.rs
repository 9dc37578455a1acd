//! Equipment: its mass, its position on the body, and the area it adds.
//!
//! Every item changes the segment table: mass, centre of gravity and inertia by the parallel axis theorem, areas by
//! its own silhouette. Sizes are those of common equipment; the user supplies what varies (masses, shoe size).

use core::fmt;

use nalgebra::{Matrix3, Vector3};

use super::anthropometry::ANKLE_FROM_HEEL;
use super::solid::Solid;
use super::{Body, Segment, SegmentParameters};
use crate::math::{Real, point_inertia};

/// Shoes, which affect the flight noticeably (paper "Insight into the Aerodynamic Model", shoe size).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Shoes<T> {
    /// No shoes.
    Barefoot,
    /// Shoes of a size that fits the feet.
    #[default]
    Fitted,
    /// Shoes of a given European size, 30 to 52.
    European(T),
}

/// Kinds of jumpsuit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Suit {
    /// Close-fitting, as worn in wind tunnels.
    Tight,
    /// Freefall suit with some loose cloth on the limbs.
    #[default]
    Standard,
    /// Relative-work suit with grippers and booties, which are cloth between toes and knees.
    RelativeWork,
}

/// Properties of a suit.
struct SuitTable {
    /// Mass (kg).
    mass: f64,
    /// Factors on the silhouettes of trunk, arms and legs.
    area_factors: [f64; 3],
    /// Area added to the front of each shank (m2).
    booties: f64,
}

impl Suit {
    /// Suits by their names in files.
    pub const NAMED: [(&'static str, Self); 3] = [
        ("tight", Self::Tight),
        ("standard", Self::Standard),
        ("rw", Self::RelativeWork),
    ];

    const fn table(self) -> SuitTable {
        match self {
            Self::Tight => SuitTable {
                mass: 0.6,
                area_factors: [1.02, 1.03, 1.03],
                booties: 0.0,
            },
            Self::Standard => SuitTable {
                mass: 1.2,
                area_factors: [1.04, 1.2, 1.15],
                booties: 0.0,
            },
            Self::RelativeWork => SuitTable {
                mass: 1.8,
                area_factors: [1.04, 1.15, 1.1],
                booties: 0.04,
            },
        }
    }
}

/// Everything a skydiver wears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear<T> {
    /// Whether a light closed helmet is worn.
    pub helmet: bool,
    /// Shoes worn.
    pub shoes: Shoes<T>,
    /// Mass of the parachute container on the back (kg), at most 40; 0 for none.
    pub rig: T,
    /// Mass of a weight belt around the pelvis (kg), at most 30; 0 for none.
    pub weight_belt: T,
    /// Jumpsuit worn.
    pub suit: Suit,
}

impl<T: Real> Default for Gear<T> {
    /// Helmet, fitted shoes and a standard suit, without rig or belt.
    fn default() -> Self {
        Self {
            helmet: true,
            shoes: Shoes::default(),
            rig: T::zero(),
            weight_belt: T::zero(),
            suit: Suit::default(),
        }
    }
}

/// An equipment value that is out of range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearError {
    /// Which value is out of range, with its unit.
    pub item: &'static str,
    /// Value found, in that unit.
    pub found: f64,
    /// Smallest accepted value.
    pub low: f64,
    /// Largest accepted value.
    pub high: f64,
}

impl fmt::Display for GearError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            item,
            found,
            low,
            high,
        } = self;
        write!(f, "{item}: expected {low} to {high}, found {found}")
    }
}

impl core::error::Error for GearError {}

/// Mass of a helmet (kg) and thickness of its shell (m).
const HELMET: (f64, f64) = (0.45, 0.025);
/// Mass of a shoe (kg) and the European size it is for; the mass scales with the length.
const SHOE_MASS: (f64, f64) = (0.38, 43.0);
/// Height of a shoe (m) and its breadth as a share of its length.
const SHOE_SHAPE: (f64, f64) = (0.085, 0.37);
/// Excess length of a shoe over its foot (m).
const SHOE_ALLOWANCE: f64 = 0.015;
/// Breadth, depth and height of a container (m).
const RIG_SIDES: [f64; 3] = [0.36, 0.14, 0.45];
/// Thickness and height of a weight belt (m).
const BELT: (f64, f64) = (0.025, 0.1);

impl<T: Real> Gear<T> {
    /// Returns `body` wearing the equipment.
    ///
    /// # Errors
    /// Returns an error if a mass or a size is not a number or out of range.
    pub fn fit(&self, body: &Body<T>) -> Result<Body<T>, GearError> {
        within("rig mass (kg)", self.rig, 0.0, 40.0)?;
        within("weight belt mass (kg)", self.weight_belt, 0.0, 30.0)?;
        if let Shoes::European(size) = self.shoes {
            within("shoe size (EU)", size, 30.0, 52.0)?;
        }
        let mut body = *body;
        self.put_on_suit(&mut body);
        if self.helmet {
            put_on_helmet(&mut body.segments[Segment::Head]);
        }
        for segment in [Segment::LeftFoot, Segment::RightFoot] {
            self.put_on_shoe(&mut body.segments[segment]);
        }
        put_on_rig(&mut body.segments[Segment::Thorax], self.rig);
        put_on_belt(&mut body.segments[Segment::Pelvis], self.weight_belt);
        Ok(body)
    }

    fn put_on_suit(&self, body: &mut Body<T>) {
        let SuitTable {
            mass,
            area_factors: [trunk, arms, legs],
            booties,
        } = self.suit.table();
        let heavier = T::one() + T::of(mass) / body.mass();
        for (segment, parameters) in body.segments.iter_mut() {
            let factor = match segment {
                Segment::Pelvis | Segment::Abdomen | Segment::Thorax => trunk,
                Segment::LeftUpperArm
                | Segment::RightUpperArm
                | Segment::LeftForearm
                | Segment::RightForearm => arms,
                Segment::LeftThigh
                | Segment::RightThigh
                | Segment::LeftShank
                | Segment::RightShank => legs,
                _ => 1.0,
            };
            parameters.mass *= heavier;
            parameters.inertia *= heavier;
            parameters.area *= T::of(factor);
            if matches!(segment, Segment::LeftShank | Segment::RightShank) {
                parameters.area.y += T::of(booties);
            }
        }
    }

    fn put_on_shoe(&self, foot: &mut SegmentParameters<T>) {
        let length = match self.shoes {
            Shoes::Barefoot => return,
            Shoes::Fitted => foot.length + T::of(SHOE_ALLOWANCE),
            // A European size is the length of the last, 1.5 cm longer than the foot, in units of 2/3 cm.
            Shoes::European(size) => size * T::of(0.02 / 3.0),
        };
        let (mass, size) = SHOE_MASS;
        let mass = T::of(mass) * length / T::of(size * 0.02 / 3.0);
        let (height, breadth_share) = SHOE_SHAPE;
        let (height, breadth) = (T::of(height), length * T::of(breadth_share));
        let half = T::of(0.5);
        // The elliptical sole lies in the X-Y plane and the shoe rises along Z.
        let shoe = Solid::elliptic_cylinder([breadth * half, length * half], height);
        let place = Vector3::new(T::zero(), length * T::of(ANKLE_FROM_HEEL - 0.5), foot.cg.z);
        add(foot, mass, &place, &shoe.gyration());
        foot.area = shoe.silhouette();
        foot.moment_arm *= length / foot.length;
        foot.length = length;
    }
}

fn within<T: Real>(item: &'static str, value: T, low: f64, high: f64) -> Result<(), GearError> {
    let found = value.to_f64();
    if found >= low && found <= high {
        Ok(())
    } else {
        Err(GearError {
            item,
            found,
            low,
            high,
        })
    }
}

/// Adds a mass at `place` with squared radii of gyration `gyration` (m2) about its own centre.
fn add<T: Real>(
    segment: &mut SegmentParameters<T>,
    mass: T,
    place: &Vector3<T>,
    gyration: &Vector3<T>,
) {
    let together = segment.mass + mass;
    let cg = (segment.cg * segment.mass + place * mass) / together;
    segment.inertia += point_inertia(segment.mass, &(segment.cg - cg))
        + point_inertia(mass, &(place - cg))
        + Matrix3::from_diagonal(&(gyration * mass));
    segment.mass = together;
    segment.cg = cg;
}

/// Squared radii of gyration of the shell between two concentric solids (m2).
fn shell_gyration<T: Real>(outer: &Solid<T>, inner: &Solid<T>) -> Vector3<T> {
    let (outside, inside) = (outer.volume(), inner.volume());
    (outer.gyration() * outside - inner.gyration() * inside) / (outside - inside)
}

fn put_on_helmet<T: Real>(head: &mut SegmentParameters<T>) {
    let (mass, thickness) = HELMET;
    let half = head.length * T::of(0.5);
    // The head is an ellipsoid, so its silhouettes give its semi-axes.
    let across = T::one() / (T::pi() * half);
    let inside = [head.area.y * across, head.area.x * across, half];
    let inner = Solid::Ellipsoid { semi_axes: inside };
    let outer = Solid::Ellipsoid {
        semi_axes: inside.map(|axis| axis + T::of(thickness)),
    };
    let place = Vector3::new(T::zero(), T::zero(), half);
    add(head, T::of(mass), &place, &shell_gyration(&outer, &inner));
    head.area = outer.silhouette();
}

/// Semi-axes [along X, along Y] of a trunk segment taken as an elliptic cylinder (m).
fn half_axes<T: Real>(trunk: &SegmentParameters<T>) -> [T; 2] {
    let scale = T::of(0.5) / trunk.length;
    [trunk.area.y * scale, trunk.area.x * scale]
}

/// Puts the container on the back. It adds area seen from the side and along the body; from front and back the trunk
/// covers it.
fn put_on_rig<T: Real>(thorax: &mut SegmentParameters<T>, mass: T) {
    if mass <= T::zero() {
        return;
    }
    carry_on_back(thorax, mass);
    let [breadth, depth, height] = RIG_SIDES.map(T::of);
    thorax.area.x += depth * height;
    thorax.area.z += breadth * depth;
}

/// Adds a mass (kg) at the position of the container; a negative mass removes some.
pub(crate) fn carry_on_back<T: Real>(thorax: &mut SegmentParameters<T>, mass: T) {
    let sides = RIG_SIDES.map(T::of);
    let [_, depth, _] = sides;
    let [_, half_depth] = half_axes(thorax);
    let half = T::of(0.5);
    let place = Vector3::new(T::zero(), half_depth + depth * half, thorax.length * half);
    add(thorax, mass, &place, &Solid::Cuboid { sides }.gyration());
}

fn put_on_belt<T: Real>(pelvis: &mut SegmentParameters<T>, mass: T) {
    if mass > T::zero() {
        carry_at_hips(pelvis, mass);
    }
}

/// Adds a mass (kg) at the position of a belt; a negative mass removes some.
pub(crate) fn carry_at_hips<T: Real>(pelvis: &mut SegmentParameters<T>, mass: T) {
    let (thickness, height) = BELT;
    let inside = half_axes(pelvis);
    let inner = Solid::elliptic_cylinder(inside, T::of(height));
    let outer = Solid::elliptic_cylinder(inside.map(|axis| axis + T::of(thickness)), T::of(height));
    let place = Vector3::new(T::zero(), T::zero(), pelvis.length * T::of(0.5));
    add(pelvis, mass, &place, &shell_gyration(&outer, &inner));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::anthropometry::{Person, Sex};
    use crate::body::solid::is_possible_inertia;
    use proptest::prelude::*;

    fn person() -> Body<f64> {
        Person::new(1.75, 75.0, Sex::Male).body().unwrap()
    }

    fn gear() -> impl Strategy<Value = Gear<f64>> {
        let shoes = prop_oneof![
            Just(Shoes::Barefoot),
            Just(Shoes::Fitted),
            (30.0f64..52.0).prop_map(Shoes::European)
        ];
        let suit = prop::sample::select(Suit::NAMED.map(|(_, suit)| suit).to_vec());
        (any::<bool>(), shoes, 0.0f64..40.0, 0.0f64..30.0, suit).prop_map(
            |(helmet, shoes, rig, weight_belt, suit)| Gear {
                helmet,
                shoes,
                rig,
                weight_belt,
                suit,
            },
        )
    }

    proptest! {
        #[test]
        fn equipment_adds_its_mass_and_keeps_segments_possible(gear in gear()) {
            let (bare, dressed) = (person(), gear.fit(&person()).unwrap());
            let shoe = |size: f64| 2.0 * 0.38 * size / 43.0;
            let shoes = match gear.shoes {
                Shoes::Barefoot => 0.0,
                Shoes::Fitted => {
                    shoe((bare.segments[Segment::LeftFoot].length + SHOE_ALLOWANCE) / (0.02 / 3.0))
                }
                Shoes::European(size) => shoe(size),
            };
            let helmet = if gear.helmet { HELMET.0 } else { 0.0 };
            let expected = 75.0 + helmet + shoes + gear.rig + gear.weight_belt + gear.suit.table().mass;
            prop_assert!((dressed.mass() - expected).abs() < 1e-9, "{} {expected}", dressed.mass());
            for (segment, parameters) in dressed.segments.iter() {
                prop_assert!(is_possible_inertia(&parameters.inertia), "{segment:?}");
                prop_assert!(parameters.area.min() > 0.0);
            }
        }
    }

    #[test]
    fn a_rig_moves_the_thorax_backwards() {
        let dressed = Gear {
            rig: 10.0,
            ..Gear::default()
        }
        .fit(&person())
        .unwrap();
        let thorax = &dressed.segments[Segment::Thorax];
        assert!(thorax.cg.y > 0.05, "{:?}", thorax.cg);
        assert!(thorax.area.x > person().segments[Segment::Thorax].area.x + 0.05);
    }

    #[test]
    fn larger_shoes_have_a_larger_area() {
        let sole = |size| {
            let gear = Gear {
                shoes: Shoes::European(size),
                ..Gear::default()
            };
            gear.fit(&person()).unwrap().segments[Segment::LeftFoot]
                .area
                .z
        };
        assert!(sole(48.0) > 1.2 * sole(42.0));
    }

    #[test]
    fn booties_are_an_area_on_the_shanks() {
        let shank = |suit| {
            Gear {
                suit,
                ..Gear::default()
            }
            .fit(&person())
            .unwrap()
            .segments[Segment::RightShank]
                .area
                .y
        };
        assert!(shank(Suit::RelativeWork) > 1.5 * shank(Suit::Standard));
        assert!(shank(Suit::Standard) > shank(Suit::Tight));
    }

    #[test]
    fn impossible_equipment_is_refused() {
        for (gear, item) in [
            (
                Gear {
                    rig: -1.0,
                    ..Gear::default()
                },
                "rig mass (kg)",
            ),
            (
                Gear {
                    weight_belt: f64::NAN,
                    ..Gear::default()
                },
                "weight belt mass (kg)",
            ),
            (
                Gear {
                    shoes: Shoes::European(f64::INFINITY),
                    ..Gear::default()
                },
                "shoe size (EU)",
            ),
        ] {
            assert_eq!(gear.fit(&person()).unwrap_err().item, item);
        }
    }
}
