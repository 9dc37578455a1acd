//! Finds the windows of the calibration that the mapping does not give: rests of all sensors, and what differs between
//! them.

use bodyflight_core::Segment;
use bodyflight_core::suit::rest::Rest;
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::Vector3;

use super::mapping::Windows;
use super::stream::Stream;

/// Length of the pieces that are judged (s), shortest rest (s), and shortest rest in a tray (s).
const PIECE: f64 = 0.25;
const SHORTEST: f64 = 2.0;
const TRAY: f64 = 6.0;
/// Time kept from either end of a rest (s).
const MARGIN: f64 = 0.3;
/// Least tilt of the pelvis between upright and bent (degrees).
const BENT: f64 = 40.0;
/// Largest angle between up at the pelvis in two poses that are the same (degrees).
const SAME: f64 = 15.0;
/// Turn between two pieces that ends a rest (degrees): a sensor that was taken up and put down again.
const TURNED: f64 = 5.0;
/// Longest march (s).
const MARCH: f64 = 15.0;

/// A rest of all sensors, and where up is for the pelvis.
struct Still {
    window: [f64; 2],
    up: Vector3<f64>,
}

/// The windows, those of the mapping first.
pub(super) struct Found {
    pub(super) tray: Option<[f64; 2]>,
    pub(super) upright: [f64; 2],
    pub(super) bent: Option<[f64; 2]>,
    pub(super) march: Option<[f64; 2]>,
    /// Which of them were found, as a sentence.
    pub(super) note: Option<String>,
}

/// Completes the windows of a mapping. `until` is the begin of the flight, if that is known (s).
///
/// # Errors
/// Returns an error if no upright pose is given or found.
pub(super) fn completed(
    given: &Windows,
    sensors: &[(Segment, &Stream)],
    until: Option<f64>,
) -> Result<Found> {
    let mut found = Found {
        tray: given.tray_s,
        upright: given.upright_s.unwrap_or_default(),
        bent: given.bent_s,
        march: given.march_s,
        note: None,
    };
    if given.upright_s.is_some() {
        return Ok(found);
    }
    let rests = rests(sensors, until);
    let pairs = rests.windows(2).enumerate();
    let bends = pairs.filter(|(_, pair)| match pair {
        [one, other] => one.up.angle(&other.up).to_degrees() > BENT,
        _ => false,
    });
    // The last bend before the flight after which the person stands as before: otherwise upright and bent could be
    // mistaken for each other.
    let is_upright = |place: usize| {
        let same = rests.get(place).zip(rests.get(place + 2));
        same.is_some_and(|(one, other)| one.up.angle(&other.up).to_degrees() < SAME)
    };
    let place = bends.map(|(place, _)| place).rfind(|p| is_upright(*p));
    let poses = place.and_then(|place| Some((place, rests.get(place)?, rests.get(place + 1)?)));
    let Some((place, upright, bent)) = poses else {
        let message = format!(
            "no calibration was found: expected a rest upright, then one bent forwards by more than {BENT} degrees, each of {SHORTEST} s; then upright again; found rests of all sensors at {}",
            said(&rests)
        );
        return Err(Problem::bad_input(message)
            .at("table calibration")
            .help("give the windows: upright_s = [12.0, 16.0], bent_s and march_s"));
    };
    found.upright = inner(upright.window);
    found.bent = found.bent.or(Some(inner(bent.window)));
    let next = rests.get(place + 2).map(|rest| rest.window[0]);
    let latest = until.unwrap_or(f64::INFINITY);
    let begin = bent.window[1] + 1.5;
    let end = next.unwrap_or(latest).min(latest).min(begin + MARCH);
    found.march = found
        .march
        .or((end - begin > SHORTEST).then_some([begin, end]));
    let before = rests.get(..place).unwrap_or_default().iter();
    let tray = before.rev().find(|r| r.window[1] - r.window[0] > TRAY);
    found.tray = found.tray.or(tray.map(|rest| inner(rest.window)));
    let [from, to] = found.upright;
    found.note = Some(format!(
        "calibration found: upright from {from:.1} to {to:.1} s, bent from {:.1} s{}{}",
        bent.window[0],
        if found.march.is_some() {
            ", then a march"
        } else {
            ", no march"
        },
        if found.tray.is_some() {
            ", a tray before"
        } else {
            ", no tray"
        },
    ));
    Ok(found)
}

/// The times of rests, in words.
fn said(rests: &[Still]) -> String {
    let times = rests.iter().map(|rest| {
        let [from, to] = rest.window;
        format!("{from:.1} to {to:.1} s")
    });
    times.collect::<Vec<_>>().join(", ")
}

fn inner([from, to]: [f64; 2]) -> [f64; 2] {
    [from + MARGIN, to - MARGIN]
}

/// Rests of all sensors, in order of time.
fn rests(sensors: &[(Segment, &Stream)], until: Option<f64>) -> Vec<Still> {
    let spans = || sensors.iter().map(|(_, stream)| stream.span());
    let begin = spans()
        .map(|[begin, _]| begin)
        .fold(f64::NEG_INFINITY, f64::max);
    let end = spans().map(|[_, end]| end).fold(f64::INFINITY, f64::min);
    let end = end.min(until.unwrap_or(end));
    let mut found: Vec<Still> = Vec::new();
    let mut open: Option<[f64; 2]> = None;
    let mut piece = begin;
    let mut before = None;
    while piece + PIECE <= end {
        let window = [piece, piece + PIECE];
        let up = up(sensors, window);
        let turned = before
            .zip(up)
            .map(|(before, up): (Vector3<f64>, _)| before.angle(&up));
        before = up;
        if let Some(done) = open.take_if(|_| turned.is_none_or(|a| a.to_degrees() > TURNED)) {
            close(done, sensors, &mut found);
        }
        let still = sensors.iter().all(|(_, stream)| {
            let mut rest = Rest::default();
            stream
                .within(window)
                .for_each(|(_, reading)| rest.take(reading));
            rest.is_still()
        });
        match (&mut open, still) {
            (None, true) => open = Some(window),
            (Some(open), true) => open[1] = window[1],
            (Some(done), false) => {
                close(*done, sensors, &mut found);
                open = None;
            }
            (None, false) => {}
        }
        piece += PIECE;
    }
    if let Some(done) = open {
        close(done, sensors, &mut found);
    }
    found
}

fn close(window: [f64; 2], sensors: &[(Segment, &Stream)], found: &mut Vec<Still>) {
    if window[1] - window[0] < SHORTEST {
        return;
    }
    if let Some(up) = up(sensors, window) {
        found.push(Still { window, up });
    }
}

/// Direction of up in the axes of the pelvis' sensor.
fn up(sensors: &[(Segment, &Stream)], window: [f64; 2]) -> Option<Vector3<f64>> {
    let mut rest = Rest::default();
    let (_, stream) = sensors.iter().find(|(s, _)| *s == Segment::Pelvis)?;
    stream
        .within(window)
        .for_each(|(_, reading)| rest.take(reading));
    rest.up()
}
