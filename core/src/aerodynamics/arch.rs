//! The arch of the body and its effect on the drag.
//!
//! An arched body falls faster. The paper measures the arch by an area without saying between which points. model.md
//! defines it as the signed area, in the sagittal plane, between the mid-line head - spine - pelvis - knees and its
//! chord; it is negative for an arch.

use nalgebra::Vector3;

use crate::body::posture::PosedSegment;
use crate::body::{Body, Segment, SegmentArray};
use crate::math::Lanes;

/// Factor on the drag for an arch area (m2), paper eq. (arch_area).
///
/// The cubic was fitted to areas of about -0.3 to 0.22 m2; it is evaluated from -0.45 to 0.35 m2 and held constant
/// beyond.
pub fn arch_factor<T: Lanes>(arch_area: T) -> T {
    let area = crate::math::clamp(arch_area, T::of(-0.45), T::of(0.35));
    T::of(1.055) + area * (T::of(0.5281) + area * (T::of(-0.0039) + area * T::of(2.8828)))
}

/// Arch area of a posed body (m2), model.md "Arch"; paper symbol A_arch.
pub fn arch_area<T: Lanes>(body: &Body<T>, posed: &SegmentArray<PosedSegment<T>>) -> T {
    let end = |segment: Segment, length: T| {
        let placed = &posed[segment];
        placed.joint + placed.body_from_segment.column(2) * length
    };
    let knees = (posed[Segment::LeftShank].joint + posed[Segment::RightShank].joint) * T::of(0.5);
    let hips = (posed[Segment::LeftThigh].joint + posed[Segment::RightThigh].joint) * T::of(0.5);
    let mid_line = [
        end(Segment::Head, body.segments[Segment::Head].length),
        posed[Segment::Head].joint,
        posed[Segment::Thorax].joint,
        posed[Segment::Abdomen].joint,
        hips,
        knees,
    ];
    signed_area(&mid_line)
}

/// Area in the Y-Z plane between a line and its chord (m2); positive where the line lies dorsal of the chord.
fn signed_area<T: Lanes>(points: &[Vector3<T>]) -> T {
    let next = points.iter().skip(1).chain(points.first());
    points
        .iter()
        .zip(next)
        .fold(T::zero(), |sum, (a, b)| sum + (a.y * b.z - b.y * a.z))
        * T::of(-0.5)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::body::pattern;
    use crate::body::posture::pose;
    use crate::test_body::reference_body;

    #[test]
    fn the_posed_body_reproduces_the_arch_line() {
        // Paper eq. (arch_pat): f = 1 - 0.2 / (pi/8) * angle, for angles of +-22.5 deg.
        let body = reference_body();
        let (mut squares, mut worst, steps) = (0.0, 0.0f64, 12);
        for step in -steps..=steps {
            let angle = core::f64::consts::FRAC_PI_8 * f64::from(step) / f64::from(steps);
            let posed = pose(&body, &pattern::arched(&pattern::neutral(), angle));
            let misfit = arch_factor(arch_area(&body, &posed)) - pattern::arch_line(angle);
            squares += misfit * misfit;
            worst = worst.max(misfit.abs());
        }
        let rms = libm::sqrt(squares / f64::from(2 * steps + 1));
        std::println!(
            "arch factor against the arch line over +-22.5 deg: RMS {rms:.3}, worst {worst:.3}"
        );
        assert!(rms < 0.045 && worst < 0.075);
    }

    #[test]
    fn the_factor_is_one_at_the_paper_s_area() {
        assert!((arch_factor(-0.0999f64) - 1.0).abs() < 1e-3);
        assert!(arch_factor(f32::NAN).is_finite() && arch_factor(f32::INFINITY).is_finite());
    }
}
