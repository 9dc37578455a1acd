//! Published data behind the segment table.

use super::girth::Girth;
use crate::body::Segment;
use crate::math::Real;

/// Height of the ankle joint above the sole, as a share of the stature (Drillis and Contini 1966).
pub(super) const ANKLE_HEIGHT: f64 = 0.039;

/// Sex, which selects a column of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub enum Sex {
    #[default]
    Male,
    Female,
}

/// Mass and length of a segment as shares of the whole body's.
pub(super) struct Share {
    /// Share of the body's mass, one side.
    pub(super) mass: f64,
    /// Share of the stature.
    pub(super) length: f64,
}

const fn share(mass: f64, length: f64) -> Share {
    Share { mass, length }
}

/// One column of de Leva 1996, Table 4.
pub(super) struct Proportions {
    /// Vertex to cervicale.
    head: Share,
    /// Cervicale to xiphion.
    thorax: Share,
    /// Xiphion to omphalion.
    abdomen: Share,
    /// Omphalion to the midpoint between the hip joints.
    pelvis: Share,
    upper_arm: Share,
    forearm: Share,
    /// Wrist to the tip of the third finger.
    hand: Share,
    thigh: Share,
    shank: Share,
    /// Heel to the tip of the longest toe.
    foot: Share,
}

const MALE: Proportions = Proportions {
    head: share(0.0694, 0.1395),
    thorax: share(0.1596, 0.1391),
    abdomen: share(0.1633, 0.1238),
    pelvis: share(0.1117, 0.0837),
    upper_arm: share(0.0271, 0.1618),
    forearm: share(0.0162, 0.1545),
    hand: share(0.0061, 0.1079),
    thigh: share(0.1416, 0.2425),
    shank: share(0.0433, 0.2529),
    foot: share(0.0137, 0.1482),
};

const FEMALE: Proportions = Proportions {
    head: share(0.0668, 0.1405),
    thorax: share(0.1545, 0.1314),
    abdomen: share(0.1465, 0.1183),
    pelvis: share(0.1247, 0.1046),
    upper_arm: share(0.0255, 0.1586),
    forearm: share(0.0138, 0.1523),
    hand: share(0.0056, 0.0980),
    thigh: share(0.1478, 0.2124),
    shank: share(0.0481, 0.2528),
    foot: share(0.0129, 0.1316),
};

/// Returns the column for a sex.
pub(super) const fn proportions(sex: Sex) -> &'static Proportions {
    match sex {
        Sex::Male => &MALE,
        Sex::Female => &FEMALE,
    }
}

impl Proportions {
    /// Returns the row for a segment.
    pub(super) const fn of(&self, segment: Segment) -> &Share {
        match segment {
            Segment::Pelvis => &self.pelvis,
            Segment::Abdomen => &self.abdomen,
            Segment::Thorax => &self.thorax,
            Segment::Head => &self.head,
            Segment::LeftUpperArm | Segment::RightUpperArm => &self.upper_arm,
            Segment::LeftForearm | Segment::RightForearm => &self.forearm,
            Segment::LeftHand | Segment::RightHand => &self.hand,
            Segment::LeftThigh | Segment::RightThigh => &self.thigh,
            Segment::LeftShank | Segment::RightShank => &self.shank,
            Segment::LeftFoot | Segment::RightFoot => &self.foot,
        }
    }

    /// Sum of the mass fractions, which rounding in the publication leaves 1e-4 off one.
    pub(super) fn total_mass(&self) -> f64 {
        Segment::ALL.into_iter().map(|s| self.of(s).mass).sum()
    }

    /// Factor on the published length. The segments from sole to vertex are scaled by a common factor so that they add
    /// up to the stature (male 0.980, female 1.001); arms and feet are as published.
    pub(super) fn stacking(&self, segment: Segment) -> f64 {
        const STACK: [Segment; 6] = [
            Segment::Head,
            Segment::Thorax,
            Segment::Abdomen,
            Segment::Pelvis,
            Segment::LeftThigh,
            Segment::LeftShank,
        ];
        if STACK.contains(&segment) || STACK.contains(&segment.mirrored()) {
            let published: f64 = STACK.into_iter().map(|s| self.of(s).length).sum();
            (1.0 - ANKLE_HEIGHT) / published
        } else {
            1.0
        }
    }
}

/// Linear regression on stature and mass, fitted by least squares to the public ANSUR II survey
/// (4082 men, 1986 women).
pub(super) struct Regression {
    /// Constant (mm).
    constant: f64,
    /// Slope with stature (mm/m).
    per_height: f64,
    /// Slope with mass (mm/kg).
    per_mass: f64,
}

impl Regression {
    /// Predicts the value (m) for a stature (m) and a mass (kg).
    pub(super) fn value<T: Real>(&self, height: T, mass: T) -> T {
        let millimetres =
            T::of(self.constant) + T::of(self.per_height) * height + T::of(self.per_mass) * mass;
        millimetres * T::of(1e-3)
    }
}

const fn fit(constant: f64, per_height: f64, per_mass: f64) -> Regression {
    Regression {
        constant,
        per_height,
        per_mass,
    }
}

const fn pick(sex: Sex, male: Regression, female: Regression) -> Regression {
    match sex {
        Sex::Male => male,
        Sex::Female => female,
    }
}

/// Returns the regression of a girth.
#[rustfmt::skip] // a table: one line is one row
pub(super) const fn girth(girth: Girth, sex: Sex) -> Regression {
    match girth {
        Girth::Head => pick(sex, fit(475.9, 31.9, 0.50), fit(446.9, 49.4, 0.50)),
        Girth::Chest => pick(sex, fit(1036.4, -290.9, 6.23), fit(990.3, -329.2, 7.27)),
        Girth::Waist => pick(sex, fit(1024.9, -435.8, 7.96), fit(1014.1, -471.7, 9.08)),
        Girth::Hips => pick(sex, fit(808.4, -140.1, 5.35), fit(846.9, -178.4, 6.86)),
        Girth::Biceps => pick(sex, fit(380.3, -122.3, 2.25), fit(341.4, -139.9, 2.83)),
        Girth::Forearm => pick(sex, fit(252.7, -31.5, 1.32), fit(215.9, -31.8, 1.48)),
        Girth::Wrist => pick(sex, fit(97.5, 25.2, 0.40), fit(80.9, 27.9, 0.42)),
        Girth::Thigh => pick(sex, fit(594.7, -183.6, 4.13), fit(584.0, -194.2, 5.14)),
        Girth::Knee => pick(sex, fit(344.2, -65.8, 2.11), fit(350.2, -91.1, 2.94)),
        Girth::Calf => pick(sex, fit(351.0, -68.4, 1.89), fit(305.9, -51.4, 2.23)),
        Girth::Ankle => pick(sex, fit(153.1, 7.9, 0.73), fit(139.9, 14.1, 0.78)),
    }
}

/// A breadth or depth measured with a calliper.
#[derive(Debug, Clone, Copy)]
pub(super) enum Breadth {
    Head,
    /// Forehead to back of the head.
    HeadLength,
    /// Acromion to acromion.
    Biacromial,
    Chest,
    ChestDepth,
    Waist,
    WaistDepth,
    Hips,
    ButtockDepth,
    Hand,
    Foot,
}

/// Returns the regression of a breadth.
#[rustfmt::skip] // a table: one line is one row
pub(super) const fn breadth(breadth: Breadth, sex: Sex) -> Regression {
    match breadth {
        Breadth::Head => pick(sex, fit(156.6, -8.6, 0.15), fit(135.1, 3.7, 0.10)),
        Breadth::HeadLength => pick(sex, fit(144.7, 24.5, 0.20), fit(134.3, 27.9, 0.15)),
        Breadth::Biacromial => pick(sex, fit(204.6, 91.7, 0.59), fit(132.0, 128.3, 0.36)),
        Breadth::Chest => pick(sex, fit(206.2, 3.6, 0.90), fit(206.4, -12.9, 1.24)),
        Breadth::ChestDepth => pick(sex, fit(258.1, -89.4, 1.79), fit(277.8, -116.3, 2.35)),
        Breadth::Waist => pick(sex, fit(306.0, -103.3, 2.36), fit(295.9, -113.8, 2.79)),
        Breadth::WaistDepth => pick(sex, fit(302.4, -153.3, 2.39), fit(317.1, -181.0, 2.82)),
        Breadth::Hips => pick(sex, fit(232.6, -6.5, 1.46), fit(262.4, -31.6, 2.11)),
        Breadth::ButtockDepth => pick(sex, fit(259.0, -98.1, 1.86), fit(263.6, -111.3, 2.22)),
        Breadth::Hand => pick(sex, fit(46.6, 17.6, 0.13), fit(41.6, 17.6, 0.12)),
        Breadth::Foot => pick(sex, fit(55.8, 18.0, 0.17), fit(57.7, 13.8, 0.18)),
    }
}
