//! Positions and velocities of the pelvis, which are redundant: the path by the ones is the path by the others.

use nalgebra::Vector3;

use super::agreement::{Agreement, NONE, Zeros};

/// Fewest frames that are judged.
const LEAST_FRAMES: u64 = 10;
/// Upward speed that no fall reaches (m/s).
const RISES: f64 = 10.0;
/// Speed that no skydiver exceeds (m/s), and one that only speed skydivers exceed.
const IMPOSSIBLE: f64 = 150.0;
const FAST: f64 = 110.0;
/// Shortest path (m), by positions or by velocities, for which the two are compared, and their largest relative
/// difference, noise aside: beyond it, units or the frame rate are wrong.
const MOVES: f64 = 1.0;
const APART: f64 = 0.3;
/// The same for a path so long and so even that the noise of velocities does not matter.
const FAR: f64 = 50.0;
const APART_FAR: f64 = 0.03;
/// Correlation of displacements and velocities of such a path.
const EVEN: f64 = 0.995;
/// Correlation of displacements and velocities below which they do not belong together.
const ASKEW: f64 = 0.5;
/// Distance between displacement and velocity in one frame that is a jump (m), and the least number of frames for each.
const JUMPS: f64 = 0.3;
const SELDOM: u64 = 30;
/// Change of velocity between two frames (m/s), and acceleration (m/s2), that no fall, opening or landing reaches, and
/// how many times the usual change, which noise makes, that is at least.
const VELOCITY_JUMPS: f64 = 5.0;
const ACCELERATION: f64 = 300.0;
const USUAL: f64 = 8.0;
/// Jumps of the velocity that a single wrong frame makes, twice.
const GLITCHES: u64 = 4;
/// Mean distance between displacement and velocity in one frame beyond which positions are mostly noise, in m and as a share
/// of the way, and the longest frame for which it is judged (s).
const SCATTERS: f64 = 0.1;
const SCATTERS_SHARE: f64 = 0.5;
const FRAME: f64 = 0.02;
/// Mean change of velocity in such a frame (m/s) beyond which velocities are mostly noise.
const VELOCITY_SCATTERS: f64 = 5.0;
/// Time over which displacements are compared with velocities (s): long enough to average their noise, and short enough
/// for the path to be straight.
const STRETCH: f64 = 0.1;
/// Time over which the two may part (s), and the difference that noise and slow errors of velocities do not explain: a
/// distance (m) and a share of the path.
const PIECE: f64 = 1.0;
const PARTED: f64 = 2.0;
const PARTED_SHARE: f64 = 0.05;

/// Path (m) over which the scale is judged again, since a clock may be wrong for a part of a recording, and the largest
/// relative difference over it.
const LEG: f64 = 100.0;
const LEG_APART: f64 = 0.02;

/// Displacement since a time (s): by positions, by velocities, and the longer of both paths (m).
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    begin: f64,
    moved: Vector3<f64>,
    by_velocities: Vector3<f64>,
    path: f64,
}

impl Piece {
    fn from(begin: f64) -> Self {
        Self {
            begin,
            ..Self::default()
        }
    }

    fn add(&mut self, moved: &Vector3<f64>, by_velocity: &Vector3<f64>) {
        self.moved += moved;
        self.by_velocities += by_velocity;
        self.path += moved.norm().max(by_velocity.norm());
    }
}

/// A piece in which positions and velocities part: from, to (s), and how far (m).
#[derive(Debug, Clone, Copy)]
struct Parted {
    span: [f64; 2],
    apart: f64,
}

/// A leg of the path: when it began (s), its length by positions (m), and how well the velocities agree.
#[derive(Debug, Clone, Copy)]
struct Leg {
    begin: f64,
    length: f64,
    ways: Agreement,
}

/// Legs in which the velocities have another scale: from, to (s), and the scale that is furthest off.
#[derive(Debug, Clone, Copy)]
struct Scaled {
    span: [f64; 2],
    scale: f64,
}

/// What has been seen of the path.
#[derive(Debug, Clone, Default)]
pub(super) struct Paths {
    ways: Agreement,
    /// Length of the path according to the positions, and to the velocities (m).
    lengths: [f64; 2],
    up: f64,
    /// Upward velocity of the air (m/s).
    air_up: f64,
    frames: u64,
    /// Time (s) and size (m) of the first jump of the pelvis that its velocity does not explain, and their number.
    jump: Option<(f64, f64)>,
    jumps: u64,
    /// Sum of the distances between displacement and velocity in short frames (m), of the ways by velocity, and the number of
    /// frames.
    scatter: f64,
    short_ways: f64,
    short_frames: u64,
    short_changes: f64,
    zeros: Zeros,
    /// Time (s) and size (m/s) of the largest change of velocity in one frame, the sum of all, and how many jump.
    largest_change: (f64, f64),
    changes: f64,
    velocity_jumps: u64,
    stretch: Option<Piece>,
    /// Whether velocities come from another sensor than positions.
    is_coarse: bool,
    piece: Option<Piece>,
    parted: Option<Parted>,
    pieces_parted: u64,
    leg: Option<Leg>,
    scaled: Option<Scaled>,
    last: f64,
    /// Largest speed over such a time, as slow as positions and velocities allow (m/s).
    fastest: f64,
}

impl Paths {
    /// Takes the displacement (m) between two frames, with the velocities in both (m/s), the time of the second and the
    /// time between them (s).
    pub(super) fn see(
        &mut self,
        time: f64,
        duration: f64,
        moved: &Vector3<f64>,
        [before, velocity]: [&Vector3<f64>; 2],
    ) {
        let by_velocity = 0.5 * (before + velocity) * duration;
        self.frames += 1;
        self.last = time;
        self.zeros.see(time, moved, velocity);
        let apart = (moved - by_velocity).norm();
        let change = (velocity - before).norm();
        if duration < FRAME {
            self.scatter += apart;
            self.short_ways += by_velocity.norm();
            self.short_changes += change;
            self.short_frames += 1;
        }
        if apart > JUMPS {
            self.jumps += 1;
            self.jump.get_or_insert((time, moved.norm()));
        }
        self.changes += change;
        self.velocity_jumps += u64::from(change > VELOCITY_JUMPS.max(ACCELERATION * duration));
        if change > self.largest_change.1.max(ACCELERATION * duration) {
            self.largest_change = (time, change);
        }
        self.up += by_velocity.z;
        let begin = time - duration;
        let stretch = self.stretch.get_or_insert_with(|| Piece::from(begin));
        stretch.add(moved, &by_velocity);
        if time - stretch.begin >= STRETCH {
            self.ways.add(&stretch.moved, &stretch.by_velocities);
            self.lengths[0] += stretch.moved.norm();
            self.lengths[1] += stretch.by_velocities.norm();
            let stretch = *stretch;
            self.stretch = None;
            self.add_to_leg(time, &stretch);
        }
        let piece = self.piece.get_or_insert_with(|| Piece::from(begin));
        piece.add(moved, &by_velocity);
        if time - piece.begin >= PIECE {
            let slower = piece.moved.norm().min(piece.by_velocities.norm());
            self.fastest = self.fastest.max(slower / (time - piece.begin));
            let apart = (piece.moved - piece.by_velocities).norm();
            if apart > PARTED + PARTED_SHARE * piece.path {
                let span = [piece.begin, time];
                self.pieces_parted += 1;
                let parted = self.parted.get_or_insert(Parted { span, apart });
                parted.span[1] = time;
                parted.apart = parted.apart.max(apart);
            }
            self.piece = None;
        }
    }

    /// Adds a stretch that ends at this time (s) to the present leg.
    fn add_to_leg(&mut self, time: f64, stretch: &Piece) {
        let leg = self.leg.get_or_insert(Leg {
            begin: stretch.begin,
            length: 0.0,
            ways: Agreement::default(),
        });
        leg.length += stretch.moved.norm();
        leg.ways.add(&stretch.moved, &stretch.by_velocities);
        if leg.length < LEG {
            return;
        }
        let Leg { begin, ways, .. } = *leg;
        self.leg = None;
        let off = |scale: f64| (scale - 1.0).abs();
        if ways.correlation() < EVEN || off(ways.scale()) < LEG_APART {
            return;
        }
        let scaled = self.scaled.get_or_insert(Scaled {
            span: [begin, time],
            scale: 1.0,
        });
        scaled.span[1] = time;
        if off(ways.scale()) > off(scaled.scale) {
            scaled.scale = ways.scale();
        }
    }

    /// Velocities come from another sensor than positions: slow errors of either are no contradiction.
    pub(super) fn compare_coarsely(&mut self) {
        self.is_coarse = true;
    }

    /// Whether the body travels further than one that stands.
    pub(super) fn is_far(&self) -> bool {
        self.lengths[0] > FAR
    }

    /// Whether velocities come from another sensor than positions.
    pub(super) fn is_coarse(&self) -> bool {
        self.is_coarse
    }

    /// Forgets what is compared across a gap.
    pub(super) fn interrupt(&mut self) {
        self.stretch = None;
        self.piece = None;
        self.leg = None;
    }

    /// The air moves up at this velocity (m/s).
    pub(super) fn in_air(&mut self, up: f64) {
        self.air_up = up;
    }

    /// A body that rises against the air faster than anything in a fall, in a sentence, if the recording lasts so long (s).
    pub(super) fn rises(&self, duration: f64) -> Option<String> {
        let up = self.up / duration.max(f64::MIN_POSITIVE) - self.air_up;
        let against = if self.air_up == 0.0 {
            ""
        } else {
            " against the air"
        };
        (up > RISES).then(|| format!(
            "the body rises by {up:.1} m/s on average{against}; expected a fall, with upward velocities positive"
        ))
    }

    /// Speed beyond that of a fall, and whether it is beyond that of any skydiver.
    pub(super) fn too_fast(&self) -> Option<(String, bool)> {
        let speed = self.fastest;
        (speed > FAST).then(|| {
            let message = format!(
                "the body moves at up to {speed:.0} m/s over a second; a speed skydiver reaches {IMPOSSIBLE} m/s: positions and velocities may be in feet"
            );
            (message, speed > IMPOSSIBLE)
        })
    }

    /// Whether the velocities are those of the same path the other way round.
    pub(super) fn are_opposite(&self) -> bool {
        let moves = self.lengths[0] > MOVES && self.frames >= LEAST_FRAMES;
        moves && self.ways.correlation() < -0.7 && (self.ways.scale() + 1.0).abs() < APART
    }

    /// Ratio of the velocities to those of the positions; `None` if the path is too short or too noisy to tell within a
    /// hundredth or so.
    pub(super) fn scale(&self) -> Option<f64> {
        let is_clear = !self.is_coarse && self.lengths[0] > FAR && self.ways.correlation() > EVEN;
        is_clear.then(|| self.ways.scale())
    }

    /// A velocity that jumps, when (s), and whether it does so often: once is a glitch, if the path agrees otherwise.
    pub(super) fn velocity_jump(&self) -> Option<(String, f64, bool)> {
        let (time, change) = self.largest_change;
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let usual = self.changes / self.frames.max(1) as f64;
        let jumps = change > VELOCITY_JUMPS.max(USUAL * usual) && !self.is_coarse;
        jumps.then(|| {
            let message = format!(
                "the velocity jumps by {change:.1} m/s in one frame at {time:.3} s, {} times in all",
                self.velocity_jumps
            );
            (message, time, self.velocity_jumps > GLITCHES)
        })
    }

    /// Positions or velocities that are mostly noise, in a sentence.
    fn scatters(&self) -> Option<String> {
        if self.short_frames < LEAST_FRAMES {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let count = self.short_frames as f64;
        let (scatter, change) = (self.scatter / count, self.short_changes / count);
        let most = SCATTERS.max(SCATTERS_SHARE * self.short_ways / count);
        if scatter > most {
            Some(format!(
                "positions scatter by {scatter:.2} m from frame to frame against the velocities; expected less than {most:.1} m"
            ))
        } else if change > VELOCITY_SCATTERS {
            Some(format!(
                "velocities scatter by {change:.1} m/s from frame to frame; expected less than {VELOCITY_SCATTERS} m/s"
            ))
        } else {
            None
        }
    }

    /// What contradicts, with the time it concerns (s) if that is not the whole recording.
    pub(super) fn contradiction(&self) -> Option<(String, Option<[f64; 2]>)> {
        let [by_positions, by_velocities] = self.lengths;
        if by_positions.max(by_velocities) < MOVES || self.frames < LEAST_FRAMES {
            return None;
        }
        let whole = |message: String| Some((message, None));
        let correlation = self.ways.correlation();
        if correlation < -ASKEW {
            return whole(
                "positions and velocities point in opposite directions: the axes of one of them are reversed"
                    .to_owned(),
            );
        }
        if by_velocities < NONE * by_positions || by_positions < NONE * by_velocities {
            return whole(format!(
                "the body moves {by_positions:.1} m by positions, {by_velocities:.1} m by velocities: one of them is empty"
            ));
        }
        if let Some((time, jump)) = self.jump.filter(|_| SELDOM * self.jumps < self.frames) {
            return Some((
                format!(
                    "the body jumps by {jump:.2} m in one frame at {time:.3} s, {} times in all, against its velocity",
                    self.jumps
                ),
                Some([time, time]),
            ));
        }
        if correlation < ASKEW {
            return whole(format!(
                "positions and velocities point in different directions (correlation {correlation:.2}): two axes of one of them are exchanged, or they are not of the same time"
            ));
        }
        let [least, most] = self.ways.scale_bounds();
        if least > 1.0 + APART || most < 1.0 - APART {
            return whole(format!(
                "path of {by_positions:.1} m by positions, {by_velocities:.1} m by velocities: units or frame rate are wrong"
            ));
        }
        if self.is_coarse {
            return None;
        }
        if let Some(scale) = (self.scale()).filter(|scale| (scale - 1.0).abs() > APART_FAR) {
            return whole(format!(
                "the velocities are {scale:.3} times those of the positions: the frame rate, or the scale of one of them, is wrong"
            ));
        }
        let Some(Parted { span, apart }) = self.parted else {
            if let Some(message) = self.scatters() {
                return whole(message);
            }
            if let Some(Scaled { span, scale }) = self.scaled {
                let message = format!(
                    "the velocities are {scale:.3} times those of the positions from {:.3} to {:.3} s: the clock, or the scale of one of them, is wrong there",
                    span[0], span[1]
                );
                return Some((message, Some(span)));
            }
            let (empty, moving, first) = self.zeros.found()?;
            return Some((
                format!(
                    "the velocity is exactly zero along an axis in {empty} of {moving} frames that move along it, first at {first:.3} s: it is missing there"
                ),
                Some([first, self.last]),
            ));
        };
        Some((
            format!(
                "positions and velocities part by up to {apart:.1} m within a second, {} times from {:.3} to {:.3} s: axes of one of them are exchanged or turned, or one of them is wrong there",
                self.pieces_parted, span[0], span[1]
            ),
            Some(span),
        ))
    }
}
