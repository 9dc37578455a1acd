//! Air and coefficients that no skydiver meets or has: numbers that are accepted because experiments need them, and doubted
//! because they are mostly units or slips of the pen.

use bodyflight_mvnx::recording::Warning;

use crate::subject::Subject;

/// Wind (m/s) that nobody jumps in, also high up or in an inclined tunnel, and air that goes down or up faster than in any
/// cloud or tunnel.
const ACROSS: f64 = 60.0;
const DOWN: f64 = 20.0;
const UP: f64 = 100.0;
/// Densities (kg/m3) from the tropopause to the coldest ground, and the one below which a flight is meant to have no air.
const DENSITIES: core::ops::RangeInclusive<f64> = 0.3..=1.6;
const NO_AIR: f64 = 0.001;
/// Coefficients that are several times those of any posture: the paper's are 1.2, 1.8, 3.5, an arch 1 to 1.1, and damping up
/// to 6.
const DRAG: core::ops::RangeInclusive<f64> = 0.2..=4.0;
const LIFT: f64 = 8.0;
const MOMENT: f64 = 15.0;
const ARCH: core::ops::RangeInclusive<f64> = 0.3..=3.0;
const DAMPING: f64 = 50.0;

/// Why nobody flies in air of this velocity (m/s, north, west, up) and density (kg/m3, if it is constant), or with the
/// coefficients of a subject.
pub(crate) fn doubted(
    air_velocity: [f64; 3],
    constant_density: Option<f64>,
    subject: &Subject,
) -> Vec<Warning> {
    let all = [
        air(air_velocity),
        constant_density.and_then(density),
        coefficients(subject),
    ];
    let said = all.into_iter().flatten();
    said.map(|message| Warning {
        is_fault: true,
        ..Warning::new(0, message)
    })
    .collect()
}

fn air([north, west, up]: [f64; 3]) -> Option<String> {
    let across = north.hypot(west);
    let (speed, what, expected) = if across > ACROSS {
        (across, "sideways", format!("at most {ACROSS}"))
    } else if !(-DOWN..=UP).contains(&up) {
        (up, "upwards", format!("{} to {UP}", -DOWN))
    } else {
        return None;
    };
    Some(format!(
        "[air] velocity moves the air {what} at {speed:.0} m/s, expected {expected}: is it in m/s, north, west, up?"
    ))
}

fn density(density: f64) -> Option<String> {
    (density > NO_AIR && !DENSITIES.contains(&density)).then(|| {
        format!(
            "[air] density is {density} kg/m3, expected {} to {} as from the tropopause to the ground, or next to none for flights without air",
            DENSITIES.start(),
            DENSITIES.end()
        )
    })
}

/// Why nobody has the coefficients of a subject.
pub fn coefficients(subject: &Subject) -> Option<String> {
    let said = |name: &str, value: f64, least: f64, most: f64| {
        (!(least..=most).contains(&value)).then(|| {
            format!(
                "[coefficients] {name} of the subject is {value}, expected {least} to {most}: nobody has such a coefficient"
            )
        })
    };
    let common = subject.common_coefficients();
    let drag = said("cd", common.cd, *DRAG.start(), *DRAG.end());
    let lift = said("cl", common.cl, 0.0, LIFT);
    let moment = said("cm", common.cm, 0.0, MOMENT);
    let arch = subject
        .fixed_arch()
        .and_then(|arch| said("f_arch", arch, *ARCH.start(), *ARCH.end()));
    let damping = common
        .damp
        .into_iter()
        .find_map(|own| said("damp", own, -DAMPING, DAMPING));
    // A single segment may be left out of an experiment.
    let aerodynamics = subject.aerodynamics();
    let segment = aerodynamics.coefficients.iter().find_map(|(segment, own)| {
        let name = |field: &str| format!("segment.{}.{field}", segment.name());
        said(&name("cd"), own.drag, 0.0, *DRAG.end())
            .or_else(|| said(&name("cl"), own.lift, 0.0, LIFT))
            .or_else(|| said(&name("cm"), own.moment, 0.0, MOMENT))
    });
    drag.or(lift).or(moment).or(arch).or(damping).or(segment)
}
