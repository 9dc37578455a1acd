//! Postures from real sensors against an optical reference. The recordings are public, but not part of the repository:
//! docs/suit.md says which files they are.
//!
//! None of them has the calibration that docs/suit.md describes, so a pose at the begin takes its place. It is taken as the
//! reference has it, or as the program would assume it. A pose says nothing about headings of sensors: the axis about
//! which a segment bends and swings is that of the reference in either case.

#[path = "reference/files.rs"]
mod files;

use std::path::Path;

use bodyflight_core::suit::mounting::{March, Stances, fit};
use bodyflight_core::suit::placement::of_size;
use bodyflight_core::suit::rest::Rest;
use bodyflight_core::suit::set::{Fitted, Suit, SuitPosture, pairs_of};
use bodyflight_core::suit::strapdown::{Reading, Strapdown};
use bodyflight_core::suit::tray::Gyroscope;
use bodyflight_core::{Posture, Segment, SegmentArray};
use bodyflight_mocap::imu::stream::Stream;
use bodyflight_replay::subject::Subject;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use files::{Recording, Truth, total_capture, walk};

/// Half of the time over which gravity is taken in the pose (s).
const STILL: f64 = 0.1;
/// What the reference itself is taken to be off in the pose, each axis (rad).
const KNOWN: f64 = 0.01;

/// How long the walk is taken for a march (s).
const MARCH: f64 = 6.0;

/// What is taken of the pose at the begin: that of the reference, or what the program assumes.
#[derive(Clone, Copy, PartialEq)]
enum Pose {
    Known,
    Assumed,
}

/// Sums over the frames: of squares of angles between directions (rad2), actual and stated.
#[derive(Default, Clone, Copy)]
struct Sums {
    count: f64,
    actual: f64,
    stated: f64,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.actual += other.actual;
        self.stated += other.stated;
    }

    /// Error of the direction (degrees), and the stated deviation as a multiple of it.
    fn figures(&self) -> [f64; 2] {
        let direction = (self.actual / self.count).sqrt().to_degrees();
        [direction, (self.stated / self.actual).sqrt()]
    }
}

/// The sums of each segment that the reference knows, and whether it has a sensor.
type Found = Vec<(Segment, bool, Sums)>;

/// Attitudes of the sensor by its rates alone (its level axes from its own), with those of its segment.
fn pairs(
    stream: &Stream,
    gyroscope: &Gyroscope<f64>,
    begin: (f64, UnitQuaternion<f64>),
    truth: &[(f64, UnitQuaternion<f64>)],
) -> Vec<[UnitQuaternion<f64>; 2]> {
    let (mut time, attitude) = begin;
    let mut turned = Strapdown::new(attitude);
    let step = 1.0 / stream.rate_hz;
    let mut found = Vec::new();
    for (until, truth) in truth.iter().filter(|(time, _)| *time > begin.0) {
        while time + 0.5 * step < *until {
            time += step;
            if let Some(reading) = stream.at(time) {
                turned.advance(&gyroscope.corrected(&reading.angular_velocity), step);
            }
        }
        found.push([turned.reference_from_sensor, *truth]);
    }
    found
}

/// The turn about the vertical by which the attitudes of a sensor agree best with those of its segment, however it is
/// mounted.
fn heading(pairs: &[[UnitQuaternion<f64>; 2]]) -> UnitQuaternion<f64> {
    let upright = Vector3::z() * Vector3::z().transpose();
    let parts = [
        Matrix3::identity() - upright,
        -Vector3::z().cross_matrix(),
        upright,
    ];
    let sums = parts.map(|part| {
        pairs.iter().fold(Matrix3::zeros(), |sum, pair| {
            let [seen, truth] = pair.map(|turn| turn.to_rotation_matrix().into_inner());
            sum + seen.transpose() * part * truth
        })
    });
    let turn = |half_degrees: u16| (0.5 * f64::from(half_degrees)).to_radians();
    let agreement = |half_degrees: &u16| {
        let [across, about, along] = sums;
        let angle = turn(*half_degrees);
        let sum = across * angle.cos() + about * angle.sin() + along;
        let sizes = sum.singular_values();
        sizes[0] + sizes[1] + sizes[2] * sum.determinant().signum()
    };
    let best = (0..720).max_by(|one, other| agreement(one).total_cmp(&agreement(other)));
    UnitQuaternion::from_scaled_axis(Vector3::z() * turn(best.unwrap_or_default()))
}

/// The truth relative to the direction in which the pelvis faces in the pose.
struct Reference {
    frames: Vec<(f64, Truth)>,
    in_pose: Truth,
}

impl Reference {
    /// The attitudes of a segment.
    fn of(&self, segment: Segment) -> Vec<(f64, UnitQuaternion<f64>)> {
        let frames = self.frames.iter();
        let known = frames.filter_map(|(time, truth)| Some((*time, truth[segment]?)));
        known.collect()
    }
}

fn reference(recording: &Recording) -> Reference {
    let end = recording.pose_s;
    let in_pose = recording.truth.iter().find(|(time, _)| *time >= end - 1e-6);
    let (_, in_pose) = in_pose.expect("the reference of the pose");
    let left = in_pose[Segment::Pelvis].expect("the pelvis") * Vector3::x();
    let north = UnitQuaternion::from_scaled_axis(Vector3::z() * -left.y.atan2(left.x));
    let turned = |truth: &Truth| truth.map(|_, turn| turn.map(|turn| north * turn));
    Reference {
        frames: (recording.truth.iter())
            .map(|(time, truth)| (*time, turned(truth)))
            .collect(),
        in_pose: turned(in_pose),
    }
}

/// The pose that the program assumes, or that of the reference.
fn pose_of(reference: &Reference, pose: Pose) -> SegmentArray<UnitQuaternion<f64>> {
    reference.in_pose.map(|_, truth| match pose {
        Pose::Known => truth.unwrap_or_default(),
        Pose::Assumed => UnitQuaternion::identity(),
    })
}

/// What a sensor would have felt in the bend or in the march, if the segment turned about `left` (sensor axes).
fn bend_or_march(segment: Segment, up: &Vector3<f64>, left: &Vector3<f64>) -> Stances<f64> {
    use Segment::{Abdomen, Head, LeftFoot, LeftShank, Pelvis, RightFoot, RightShank, Thorax};
    let mut stances = Stances {
        upright: *up,
        bent: None,
        march: None,
    };
    let swing = match segment {
        Pelvis | Abdomen | Thorax | Head => {
            // Leaning forwards, up moves to the back.
            stances.bent = Some(UnitQuaternion::from_scaled_axis(left * -1.2) * up);
            return stances;
        }
        LeftShank | RightShank | LeftFoot | RightFoot => 3.0,
        _ => -3.0,
    };
    let mut march = March::default();
    for k in 0..600_u16 {
        let phase = f64::from(k) * 0.01 * std::f64::consts::TAU;
        march.take(&(left * (swing * phase.sin())), 0.01);
    }
    stances.march = Some(march);
    stances
}

/// Readings of a sensor between two times, one for each of its intervals.
fn readings(stream: &Stream, [from, to]: [f64; 2]) -> impl Iterator<Item = Reading<f64>> {
    let step = 1.0 / stream.rate_hz;
    let times = std::iter::successors(Some(from), move |time| Some(time + step));
    let times = times.take_while(move |time| *time < to);
    times.filter_map(|time| stream.at(time))
}

/// What a sensor shows in the pose: its gyroscope, and what it would have felt if the segment had then turned about the axis
/// of the reference.
fn shown(
    segment: Segment,
    stream: &Stream,
    recording: &Recording,
    reference: &Reference,
) -> (Gyroscope<f64>, Stances<f64>) {
    let pose = recording.pose_s;
    let rested = |window: [f64; 2]| {
        let mut rest = Rest::default();
        readings(stream, window).for_each(|reading| rest.take(&reading));
        rest
    };
    let mut gyroscope = Gyroscope::of_fusion();
    if !stream.is_fused {
        let [from, to] = recording.rest_s;
        gyroscope.set_bias(&rested([from, to]), to - from);
    }
    let rest = rested([pose - STILL, pose + STILL]);
    let up = rest.up().expect("gravity");
    let level = UnitQuaternion::rotation_between(&up, &Vector3::z()).expect("a tilt");
    let truth = reference.of(segment);
    let north = heading(&pairs(stream, &gyroscope, (pose, level), &truth));
    let left = (north * level).inverse() * Vector3::x();
    (gyroscope, bend_or_march(segment, &up, &left))
}

/// What the first steps of the walk show of a limb as a march: by how much its heading is off, and the stated deviation
/// (degrees).
fn by_steps(
    segment: Segment,
    stream: &Stream,
    recording: &Recording,
    reference: &Reference,
) -> Option<[f64; 2]> {
    let (gyroscope, stances) = shown(segment, stream, recording, reference);
    let begin = recording.pose_s;
    let mut march = March::default();
    for reading in readings(stream, [begin, begin + MARCH]) {
        let rate = gyroscope.corrected(&reading.angular_velocity);
        march.take(&rate, 1.0 / stream.rate_hz);
    }
    let seen = Stances {
        march: Some(march),
        ..stances
    };
    let level = UnitQuaternion::identity();
    let truth = fit(segment, &stances, &level).expect("a mounting");
    let found = fit(segment, &seen, &level).ok()?;
    let off = found
        .segment_from_sensor
        .angle_to(&truth.segment_from_sensor);
    Some([off, found.heading_deviation].map(f64::to_degrees))
}

/// A sensor as calibrated in the pose.
fn fitted(
    segment: Segment,
    stream: &Stream,
    recording: &Recording,
    reference: &Reference,
    pose: Pose,
) -> Fitted<f64> {
    let (gyroscope, stances) = shown(segment, stream, recording, reference);
    let in_pose = pose_of(reference, pose)[segment];
    let mut mounting = fit(segment, &stances, &in_pose).expect("a mounting");
    if pose == Pose::Known {
        mounting.tilt_deviation = KNOWN;
        mounting.heading_deviation = KNOWN;
    }
    if segment == Segment::Pelvis {
        // Postures are relative to axes of the pelvis that are level in the pose.
        mounting.segment_from_sensor = in_pose * mounting.segment_from_sensor;
    }
    Fitted {
        segment,
        place: Subject::default().body().segments[segment].cg,
        gyroscope,
        mounting,
        range: None,
    }
}

/// Direction of the segments by the gyroscopes alone (degrees).
fn alone(recording: &Recording, reference: &Reference, pose: Pose) -> f64 {
    let in_pose = pose_of(reference, pose);
    let begin = recording.pose_s;
    let turned = recording.sensors.iter().map(|(segment, stream)| {
        let (gyroscope, stances) = shown(*segment, stream, recording, reference);
        let mounting = fit(*segment, &stances, &in_pose[*segment]).expect("a mounting");
        let mounted = mounting.segment_from_sensor;
        let first = (begin, in_pose[*segment] * mounted);
        let mut pairs = pairs(stream, &gyroscope, first, &reference.of(*segment));
        for [seen, _] in &mut pairs {
            *seen *= mounted.inverse();
        }
        pairs
    });
    let turned: Vec<_> = turned.collect();
    let (pelvis, limbs) = turned.split_first().expect("the pelvis");
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for limb in limbs {
        for (of_pelvis, of_limb) in pelvis.iter().zip(limb) {
            let [seen, truth] =
                [0, 1].map(|side| of_pelvis[side].inverse() * of_limb[side] * Vector3::z());
            sum += seen.angle(&truth).powi(2);
            count += 1.0;
        }
    }
    (sum / count).sqrt().to_degrees()
}

/// Follows a set of sensors, and sums the errors of each segment.
fn followed(recording: &Recording, set: &[Segment], pose: Pose) -> Found {
    let reference = reference(recording);
    let worn = recording.sensors.iter().filter(|(s, _)| set.contains(s));
    let worn: Vec<_> = worn.map(|(segment, stream)| (*segment, stream)).collect();
    let fitted: Vec<_> = (worn.iter())
        .map(|(segment, stream)| fitted(*segment, stream, recording, &reference, pose))
        .collect();
    let mut in_pose = pose_of(&reference, pose);
    let tilt = in_pose[Segment::Pelvis];
    in_pose[Segment::Pelvis] = UnitQuaternion::identity();
    let body = Subject::default().body();
    let start = Posture::from_body_rotations(&in_pose);
    let mut suit = Suit::<f64, 16, { pairs_of(16) }>::new(&fitted, &body, &start).expect("a set");
    suit.set_on_ground(false);
    let rate = worn
        .first()
        .map_or(0.0, |(_, stream)| stream.rate_hz.round());
    let mut time = recording.pose_s;
    let mut found = Found::new();
    for (until, truth) in &reference.frames {
        while time + 0.5 / rate < *until {
            time += 1.0 / rate;
            let readings: Vec<_> = worn.iter().map(|(_, stream)| stream.at(time)).collect();
            suit.push(&readings, 1.0 / rate);
        }
        if *until >= recording.begin_s {
            sum(&suit.posture(), &tilt, truth, &mut found);
        }
    }
    found
}

/// Adds the errors of a posture.
fn sum(posture: &SuitPosture<f64>, tilt: &UnitQuaternion<f64>, truth: &Truth, found: &mut Found) {
    let Some(pelvis) = truth[Segment::Pelvis] else {
        return;
    };
    for segment in Segment::ALL.into_iter().skip(1) {
        let Some(truth) = truth[segment] else {
            continue;
        };
        let seen = &posture.orientations[segment];
        let way = seen.body_from_segment * Vector3::z();
        let along = tilt * pelvis.inverse() * truth * Vector3::z();
        let sums = Sums {
            count: 1.0,
            actual: way.angle(&along).powi(2),
            stated: seen.covariance.trace() - way.dot(&(seen.covariance * way)),
        };
        match found.iter_mut().find(|(of, ..)| *of == segment) {
            Some((_, _, all)) => all.add(&sums),
            None => found.push((segment, seen.is_measured, sums)),
        }
    }
}

/// Direction of all segments and of those with a sensor (degrees), and the stated deviation of the latter as a share.
fn cell(found: &Found) -> String {
    let total = |all: bool| {
        let of = found
            .iter()
            .filter(|(_, is_measured, _)| all || *is_measured);
        of.fold(Sums::default(), |mut total, (_, _, sums)| {
            total.add(sums);
            total
        })
    };
    let ([all, _], [seen, ratio]) = (total(true).figures(), total(false).figures());
    format!(" {all:.1}, {seen:.1}, {ratio:.1} |")
}

/// Recomputes the tables of docs/suit.md.
#[test]
#[ignore = "needs the recordings in the folder named by BODYFLIGHT_REFERENCE"]
fn real_recordings_are_as_close_as_documented() {
    let folder = std::env::var_os("BODYFLIGHT_REFERENCE").expect("BODYFLIGHT_REFERENCE");
    let folder = Path::new(&folder);
    let (whole, legs) = (total_capture(folder), walk(folder));
    let both = |recording: &Recording, set: &[Segment]| {
        [Pose::Known, Pose::Assumed].map(|pose| followed(recording, set, pose))
    };
    let mut sets = String::new();
    for count in [13, 10, 8, 5] {
        let [known, assumed] = both(&whole, of_size(count).expect("a set"));
        sets += &format!("| acting3, {count} |{}{}\n", cell(&known), cell(&assumed));
    }
    let worn: Vec<_> = legs.sensors.iter().map(|(segment, _)| *segment).collect();
    let walked = both(&legs, &worn);
    let [known, assumed] = walked.each_ref().map(cell);
    sets += &format!("| walk, pelvis and legs |{known}{assumed}\n");
    let reference = reference(&legs);
    let [known, assumed] = [Pose::Known, Pose::Assumed].map(|pose| alone(&legs, &reference, pose));
    sets += &format!("| walk, gyroscopes alone | {known:.1} | {assumed:.1} |\n");
    let acted = both(&whole, of_size(13).expect("a set"));
    let mut each = String::new();
    for segment in Segment::ALL.into_iter().skip(1) {
        each += &format!("| {} |", segment.name());
        for found in acted.iter().chain(&walked) {
            let of = found.iter().find(|(of, ..)| *of == segment);
            each += &of.map_or(" |".to_owned(), |(_, _, sums)| {
                let [direction, ratio] = sums.figures();
                format!(" {direction:.1}, {ratio:.1} |")
            });
        }
        each += "\n";
    }
    let mut steps = String::new();
    for (segment, stream) in legs.sensors.iter().skip(1) {
        let found = by_steps(*segment, stream, &legs, &reference);
        let said = found.map_or("refused".to_owned(), |[off, stated]| {
            format!("{off:.0}, {stated:.0}")
        });
        steps += &format!("| {} | {said} |\n", segment.name());
    }
    let docs = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/suit.md"));
    let docs = docs.expect("the page");
    assert!(
        [&sets, &each, &steps]
            .into_iter()
            .all(|table| docs.contains(table)),
        "measured:\n{sets}\n{each}\n{steps}"
    );
}
