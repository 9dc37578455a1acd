//! Jumps of a point mass with known times: of several kinds, in wind with gusts, with canopies that turn, spiral or run
//! downwind, recorded at different rates with noise and gaps.

use bodyflight_falls::Sample;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

const GRAVITY: f64 = 9.81;
const STEP: f64 = 0.02;

/// Time from the end of a pull-up to the opening (s).
const STALLS: f64 = 3.0;

/// A kind of jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    FreeFall,
    HopAndPop,
    Wingsuit,
    Base,
    Speed,
    Tandem,
    /// From a cliff in a wingsuit, which pulls up until it stalls, and then opens.
    Flare,
}

/// A track and its truth.
#[derive(Debug, Clone)]
pub(crate) struct Flown {
    pub(crate) samples: Vec<Sample>,
    pub(crate) exit: f64,
    pub(crate) opening: f64,
    /// Wind at the ground and its change per metre of height, without gusts (m/s).
    wind: [Vector3<f64>; 2],
}

impl Flown {
    /// The wind at a height (m/s), without gusts.
    pub(crate) fn wind_at(&self, height: f64) -> Vector3<f64> {
        self.wind[0] + self.wind[1] * height
    }
}

/// The air: wind at the ground, its change per metre of height, and a gust that changes within some seconds.
struct Wind {
    ground: Vector3<f64>,
    shear: Vector3<f64>,
    gust: Vector3<f64>,
    strength: f64,
}

impl Wind {
    fn at(&self, height: f64) -> Vector3<f64> {
        self.ground + self.shear * height + self.gust
    }
}

fn density(height: f64) -> f64 {
    // An atmosphere of its own: isothermal, and a little thinner than the standard one.
    1.19 * (-height / 9300.0).exp()
}

fn horizontal(random: &mut ChaCha8Rng, most: f64) -> Vector3<f64> {
    let (speed, angle) = (
        random.random_range(0.0..most),
        random.random_range(0.0..core::f64::consts::TAU),
    );
    Vector3::new(speed * f64::cos(angle), speed * f64::sin(angle), 0.0)
}

/// What the canopy does.
struct Canopy {
    airspeed: f64,
    sink: f64,
    /// Turn rate (rad/s) for a straight part and for turns, and how long each lasts (s).
    turn: f64,
    every: f64,
    /// Whether it keeps to the wind's direction between turns.
    runs_downwind: bool,
    /// Start of a spiral dive after the opening (s).
    spiral: f64,
}

impl Canopy {
    fn drawn(random: &mut ChaCha8Rng) -> Self {
        Self {
            airspeed: random.random_range(8.0..19.0),
            sink: random.random_range(3.5..8.0),
            turn: random.random_range(-0.5..0.5),
            every: random.random_range(8.0..60.0),
            runs_downwind: random.random_bool(0.5),
            spiral: random.random_range(30.0..200.0),
        }
    }

    /// Velocity through the air that the canopy tends to (m/s), at a time after the opening (s).
    fn tends_to(&self, since: f64, heading: &mut f64, wind: &Vector3<f64>) -> Vector3<f64> {
        let spirals = since > self.spiral && since < self.spiral + 12.0;
        let turns = spirals || (since / self.every).rem_euclid(2.0) < 1.0;
        if turns {
            *heading += STEP * if spirals { 1.5 } else { self.turn };
        } else if self.runs_downwind {
            *heading = wind.y.atan2(wind.x);
        }
        let (faster, steeper) = if spirals { (1.3, 2.6) } else { (1.0, 1.0) };
        Vector3::new(
            faster * self.airspeed * heading.cos(),
            faster * self.airspeed * heading.sin(),
            -steeper * self.sink,
        )
    }
}

/// The body in the fall: drag and lift factors (m2/kg) over time.
struct Body {
    drag: f64,
    lift: f64,
    /// Time of a pull-up, or of a drogue (s).
    event: f64,
    /// Time of the opening (s).
    opening: f64,
}

impl Body {
    fn factors(&self, kind: Kind, since: f64) -> (f64, f64) {
        let settled = ((since - 1.5) / 3.0).clamp(0.0, 1.0);
        match kind {
            Kind::Wingsuit => {
                let pulls_up = (since - self.event).abs() < 2.5;
                let more = if pulls_up { 1.8 } else { 1.0 };
                (
                    0.006 + settled * (self.drag * more - 0.006),
                    settled * self.lift * more,
                )
            }
            // It pulls up for three seconds, and falls without lift until the canopy opens.
            Kind::Flare => {
                let before = self.opening - since;
                if before > STALLS + 3.0 {
                    (0.006 + settled * (self.drag - 0.006), settled * self.lift)
                } else if before > STALLS {
                    (0.018, 0.028)
                } else {
                    (0.011, 0.003)
                }
            }
            Kind::Tandem if since < self.event => (0.6 * self.drag, 0.0),
            _ => (self.drag, 0.0),
        }
    }
}

/// Draws a jump of a kind and flies it.
pub(crate) fn flown(kind: Kind, seed: u64) -> Flown {
    let random = &mut ChaCha8Rng::seed_from_u64(seed);
    let between = |random: &mut ChaCha8Rng, low: f64, high: f64| random.random_range(low..high);
    let mut wind = Wind {
        ground: horizontal(random, 10.0),
        shear: horizontal(random, 0.003),
        gust: Vector3::zeros(),
        strength: between(random, 0.0, 1.0),
    };
    let (height, falls, body) = match kind {
        Kind::FreeFall => (
            3900.0,
            between(random, 25.0, 62.0),
            between(random, 0.0036, 0.0085),
        ),
        Kind::HopAndPop => (
            between(random, 1300.0, 4000.0),
            between(random, 3.0, 7.0),
            0.0065,
        ),
        Kind::Wingsuit => (
            4000.0,
            between(random, 60.0, 150.0),
            between(random, 0.0035, 0.0055),
        ),
        Kind::Base => (
            between(random, 900.0, 1500.0),
            between(random, 4.0, 12.0),
            0.0068,
        ),
        Kind::Flare => (
            between(random, 1300.0, 2200.0),
            between(random, 30.0, 60.0),
            between(random, 0.0035, 0.0055),
        ),
        Kind::Speed => (
            4000.0,
            between(random, 20.0, 30.0),
            between(random, 0.0012, 0.002),
        ),
        Kind::Tandem => (
            4000.0,
            between(random, 40.0, 55.0),
            between(random, 0.006, 0.0075),
        ),
    };
    let body = Body {
        drag: body,
        lift: between(random, 0.010, 0.018),
        event: between(random, 5.0, 50.0).min(if kind == Kind::Tandem { 9.0 } else { 50.0 }),
        opening: falls,
    };
    let canopy = Canopy::drawn(random);
    let (opens, grows) = (between(random, 1.8, 4.5), between(random, 1.0, 2.5));
    let exit = between(random, 15.0, 200.0);
    let aircraft = match kind {
        Kind::Base | Kind::Flare => Vector3::zeros(),
        // From a balloon or a helicopter, which drift.
        _ if random.random_bool(0.15) => wind.at(height),
        _ => {
            horizontal(random, 1.0).normalize() * between(random, 28.0, 50.0)
                + Vector3::z() * between(random, -4.0, 3.0)
        }
    };
    let opening = exit + falls;
    let mut position = Vector3::new(0.0, 0.0, height);
    position -= aircraft * exit;
    let (mut velocity, mut heading) = (aircraft, between(random, 0.0, 6.0));
    let (mut path, mut step, mut on_ground) = (Vec::new(), 0_u32, 0.0);
    while on_ground < 15.0 && step < 80_000 {
        let time = f64::from(step) * STEP;
        path.push((time, position, velocity));
        step += 1;
        let kick = Vector3::new(normal(random), normal(random), 0.3 * normal(random));
        wind.gust =
            wind.gust * (1.0 - STEP / 8.0) + kick * (wind.strength * (2.0 * STEP / 8.0).sqrt());
        if time < exit {
            position += velocity * STEP;
            continue;
        }
        if position.z <= 0.0 {
            on_ground += STEP;
            velocity = Vector3::zeros();
            continue;
        }
        let air = wind.at(position.z);
        let stream = velocity - air;
        let (drag, lift) = body.factors(kind, time - exit);
        let inflated = ((time - opening) / opens).max(0.0);
        if inflated < 1.4 {
            let grown = drag + 0.3 * inflated.powf(grows);
            let pressure = 0.5 * density(position.z) * stream.norm();
            let along = stream / stream.norm().max(1e-3);
            let up = Vector3::z() - along * along.z;
            let up = up.try_normalize(1e-2).unwrap_or_else(Vector3::zeros);
            let pushed = up * (pressure * stream.norm() * if inflated > 0.0 { 0.0 } else { lift });
            velocity += (pushed - stream * (pressure * grown) - Vector3::z() * GRAVITY) * STEP;
        } else {
            let wanted = air + canopy.tends_to(time - opening, &mut heading, &air);
            velocity += (wanted - velocity) * (STEP / 1.2);
        }
        position += velocity * STEP;
    }
    Flown {
        samples: recorded(&path, random, &[exit, opening]),
        exit,
        opening,
        wind: [wind.ground, wind.shear],
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// What a logger records of a path: at one of several rates, with white and slowly changing noise, and in one of four
/// jumps a gap away from the `moments`.
fn recorded(
    path: &[(f64, Vector3<f64>, Vector3<f64>)],
    random: &mut ChaCha8Rng,
    moments: &[f64],
) -> Vec<Sample> {
    let rate = [1.0, 2.0, 4.0, 5.0, 5.0, 10.0, 20.0][random.random_range(0..7_usize)];
    let noise = random.random_range(0.03..0.3);
    let last = path.last().map_or(0.0, |(time, ..)| *time);
    let gap = random.random_bool(0.25).then(|| {
        (
            random.random_range(0.0..last),
            random.random_range(2.0..20.0),
        )
    });
    let mut slow = Vector3::zeros();
    let mut next = 0.0;
    let mut samples = Vec::new();
    for (time, position, velocity) in path {
        if *time + 1e-9 < next {
            continue;
        }
        next += 1.0 / rate;
        let mut drawn = || Vector3::new(normal(random), normal(random), normal(random));
        slow = slow * 0.97 + drawn() * 0.1;
        let is_lost = gap.is_some_and(|(from, long)| {
            let hides = |moment: &f64| (from - 6.0..from + long + 6.0).contains(moment);
            (from..from + long).contains(time) && !moments.iter().any(hides)
        });
        let sample = Sample {
            time: *time,
            position: position + slow * 4.0 + drawn() * 0.5,
            velocity: velocity + drawn() * noise + slow * 0.3,
        };
        if !is_lost {
            samples.push(sample);
        }
    }
    samples
}
