//! Measurements entered in the wrong unit.

use bodyflight_core::body::anthropometry::{Measure, PersonError};

/// Units in which lengths are entered by mistake, with their sizes (m).
const LENGTHS: [(&str, f64); 3] = [("centimetres", 0.01), ("feet", 0.3048), ("inches", 0.0254)];

/// A pound (kg).
const POUND: f64 = 0.453_592_37;

/// What to write if the value would be possible in another unit; empty if it would not.
pub(super) fn unit_meant(error: &PersonError) -> String {
    let is_possible = |factor: f64| (error.low..=error.high).contains(&(error.found * factor));
    match error.measure {
        Measure::Height | Measure::Girth(_) => LENGTHS
            .iter()
            .find(|(_, size)| is_possible(*size))
            .map(|(unit, size)| {
                let metres = error.found * size;
                format!("; if that is in {unit}, write {metres:.2}")
            }),
        Measure::Mass | Measure::BodyMassIndex => {
            is_possible(POUND).then(|| "; if the mass is in pounds, divide it by 2.205".to_owned())
        }
        Measure::MomentArm => None,
    }
    .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meant(measure: Measure, found: f64) -> String {
        let (low, high) = match measure {
            Measure::Height => (1.2, 2.3),
            _ => (15.0, 45.0),
        };
        unit_meant(&PersonError {
            measure,
            found,
            low,
            high,
        })
    }

    #[test]
    fn other_units_are_recognised() {
        assert_eq!(
            meant(Measure::Height, 175.0),
            "; if that is in centimetres, write 1.75"
        );
        assert_eq!(
            meant(Measure::Height, 5.75),
            "; if that is in feet, write 1.75"
        );
        assert_eq!(
            meant(Measure::Height, 69.0),
            "; if that is in inches, write 1.75"
        );
        assert!(meant(Measure::BodyMassIndex, 54.0).contains("pounds"));
    }

    #[test]
    fn values_that_no_unit_explains_get_no_advice() {
        assert_eq!(meant(Measure::Height, 0.5), "");
        assert_eq!(meant(Measure::BodyMassIndex, 5.0), "");
    }
}
