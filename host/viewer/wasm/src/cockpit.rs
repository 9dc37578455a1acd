//! Flying by keyboard: controls move patterns of joints, and the core simulates the flight.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::{AxisCoefficients, Posture, Segment};

use crate::autopilot::{Answer, Answers, Autopilot, SCISSORS, moved, tilt};
use crate::frame::{Frame, frame};
use crate::setup::Setup;

/// A control, commanded by a key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Name.
    pub name: &'static str,
    /// Pattern that moves.
    pub pattern: &'static JointAngles,
    /// Whether left and right are swapped.
    pub mirrored: bool,
    /// Amplitude of the pattern at full command (rad).
    pub limit: f32,
}

const fn control(name: &'static str, pattern: &'static JointAngles, limit: f32) -> Control {
    Control {
        name,
        pattern,
        mirrored: false,
        limit,
    }
}

/// All controls; commands use their index.
pub const CONTROLS: [Control; 8] = [
    control("turn", pattern::TURN, 0.25),
    control("arch", pattern::ARCH, 0.35),
    control("side-slide", pattern::SIDE_BEND, 0.25),
    control("legs", pattern::STRETCH, 0.7),
    control("press", pattern::PRESS, 0.6),
    control("arms-down", pattern::ARMS_DOWN, 1.2),
    control("left-arm-in", pattern::DRAW_IN_LEFT, 1.2),
    Control {
        mirrored: true,
        ..control("right-arm-in", pattern::DRAW_IN_LEFT, 1.2)
    },
];

/// Initial conditions of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Name.
    pub name: &'static str,
    /// Posture.
    pub posture: &'static JointAngles,
    /// Rotation about the left axis from standing (rad); pi/2 is belly to earth.
    pub pitch: f32,
    /// Fall rate (m/s).
    pub speed: f32,
    /// Factor on the subject's damping in pitch.
    pub pitch_damping: f32,
    /// Control held from the start, and its command.
    pub held: Option<(usize, f32)>,
    /// Autopilot for the pose; stable poses need none.
    pub answers: Option<&'static Answers>,
}

/// Gains found by trial for the default subject and free-fly aerodynamics.
const SIT_ANSWERS: &Answers = &Answers {
    pitch: Answer {
        pattern: pattern::ARMS_DOWN,
        tilt: 3.0,
        rate: 0.1,
        growth: 0.0,
    },
    aside: Answer {
        pattern: pattern::SIDE_BEND,
        tilt: -1.0,
        rate: -0.1,
        growth: 0.0,
    },
    turn: Answer {
        pattern: SCISSORS,
        tilt: 0.0,
        rate: 1.0,
        growth: 0.0,
    },
};

const BELLY: Start = Start {
    name: "neutral",
    posture: pattern::NEUTRAL,
    pitch: core::f32::consts::FRAC_PI_2,
    speed: 50.0,
    pitch_damping: 1.0,
    held: None,
    answers: None,
};

/// All starts. The last is the paper's novice ("Pitch and Roll oscillations"): arms down and little damping.
pub const STARTS: [Start; 6] = [
    BELLY,
    Start {
        name: "sit",
        posture: pattern::SIT,
        pitch: 0.0,
        speed: 60.0,
        answers: Some(SIT_ANSWERS),
        ..BELLY
    },
    Start {
        name: "head-down",
        posture: pattern::HEAD_DOWN,
        pitch: core::f32::consts::PI,
        speed: 65.0,
        ..BELLY
    },
    Start {
        name: "track",
        posture: pattern::TRACK,
        pitch: 1.9,
        ..BELLY
    },
    Start {
        name: "back",
        posture: pattern::BACK,
        pitch: -core::f32::consts::FRAC_PI_2,
        ..BELLY
    },
    Start {
        name: "novice",
        pitch_damping: 0.05,
        held: Some((5, 0.5)),
        ..BELLY
    },
];

/// Rate of a control, as a fraction of its range per second, and of a single joint (rad/s).
const SPEED: f32 = 3.0;

/// Muscle input at full command, as in the scripts of flips, turns and barrel rolls.
pub const MOST_MUSCLE: AxisCoefficients<f32> = AxisCoefficients {
    pitch: 4.5,
    yaw: 3.0,
    roll: 4.0,
};

/// Rate of muscle input and tension, as a fraction of their range per second: muscles tense within a quarter of a
/// second.
const TENSING: f32 = 4.0;

/// Damping of limbs that give way to the air, which lets the body roll and flip, as in the scripts of barrel rolls.
const LOOSE: AxisCoefficients<f32> = AxisCoefficients {
    pitch: 0.0,
    yaw: 3.0,
    roll: 0.05,
};

/// Damping of limbs that are braced to stop a rotation, as in the same scripts.
const BRACED: AxisCoefficients<f32> = AxisCoefficients {
    pitch: 12.0,
    yaw: 3.0,
    roll: 12.0,
};

/// Initial height above the ground (m).
const START_HEIGHT: f32 = 4000.0;

/// Height above the ground below which the page warns (m): most skydivers have begun to open the parachute there.
pub const WARNING_HEIGHT: f32 = 1000.0;

/// A flight in progress.
#[derive(Debug, Clone)]
pub struct Cockpit {
    setup: Setup,
    start: Start,
    autopilot: Option<Autopilot>,
    run: FreeRun<f32>,
    base: Posture<f32>,
    inputs: Inputs<f32>,
    /// Damping of relaxed limbs.
    relaxed: AxisCoefficients<f32>,
    /// Muscle input and tension as fractions of their ranges, and the commands that they follow.
    strain: [f32; 4],
    wanted_strain: [f32; 4],
    wanted: [f32; CONTROLS.len()],
    amounts: [f32; CONTROLS.len()],
    joints: [[f32; 3]; Segment::ALL.len()],
    wanted_joints: [[f32; 3]; Segment::ALL.len()],
    before: Posture<f32>,
    posture: Posture<f32>,
    steps: u32,
}

impl Cockpit {
    /// Starts a flight from one of [`STARTS`], or from the first if `start` is out of range.
    pub fn new(setup: &Setup, start: usize) -> Self {
        let start = STARTS.get(start).unwrap_or(&BELLY);
        let base = pattern::posture(start.posture);
        let inertial_from_body = facing_north(start.pitch);
        let motion = Motion {
            inertial_from_body,
            position: Vector::new(0.0, 0.0, START_HEIGHT),
            velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -start.speed),
            angular_velocity: Vector::zero(),
        };
        let mut inputs = setup.inputs;
        inputs.damping.pitch *= start.pitch_damping;
        let mut wanted = [0.0; CONTROLS.len()];
        if let Some((control, amount)) = start.held
            && let Some(place) = wanted.get_mut(control)
        {
            *place = amount;
        }
        let rate = PostureRate::zero();
        Self {
            setup: *setup,
            start: *start,
            autopilot: None,
            run: FreeRun::new(&setup.dynamics, Equations::Exact, &motion, &base, &rate),
            base,
            inputs,
            relaxed: inputs.damping,
            strain: [0.0; 4],
            wanted_strain: [0.0; 4],
            wanted,
            amounts: [0.0; CONTROLS.len()],
            joints: [[0.0; 3]; Segment::ALL.len()],
            wanted_joints: [[0.0; 3]; Segment::ALL.len()],
            before: base,
            posture: base,
            steps: 0,
        }
    }

    /// The model.
    pub const fn dynamics(&self) -> &Dynamics<f32> {
        &self.setup.dynamics
    }

    /// Returns whether there is an autopilot for the initial pose.
    pub const fn can_hold(&self) -> bool {
        self.start.answers.is_some()
    }

    /// Switches the autopilot, if there is one, on or off.
    pub fn hold(&mut self, on: bool) {
        let attitude = facing_north(self.start.pitch);
        let answers = self.start.answers.filter(|_| on);
        self.autopilot = answers.map(|answers| Autopilot::new(answers, &attitude));
    }

    /// Returns the tilt from the initial attitude (rad), independent of the heading.
    pub fn tilt(&self) -> f32 {
        tilt(&facing_north(self.start.pitch), &self.motion())
    }

    /// Commands a control to a fraction of its range, -1 to 1. Other values are ignored.
    pub fn command(&mut self, control: usize, share: f32) {
        if let Some(wanted) = self.wanted.get_mut(control)
            && (-1.0..=1.0).contains(&share)
        {
            *wanted = share;
        }
    }

    /// Commands how much further than in its pose a single joint is turned (rad, within pi); axis 0 is the paper's psi,
    /// 1 theta, 2 phi. Other values are ignored.
    pub fn joint(&mut self, segment: usize, axis: usize, angle: f32) {
        let joint = self.wanted_joints.get_mut(segment);
        if let Some(place) = joint.and_then(|joint| joint.get_mut(axis))
            && angle.abs() <= core::f32::consts::PI
        {
            *place = angle;
        }
    }

    /// Commands muscle input, each coefficient as a fraction of [`MOST_MUSCLE`], -1 to 1. Other values are ignored.
    pub fn muscle(&mut self, share: AxisCoefficients<f32>) {
        if share.to_array().iter().all(|value| value.abs() <= 1.0) {
            let [pitch, yaw, roll, _] = &mut self.wanted_strain;
            [*pitch, *yaw, *roll] = share.to_array();
        }
    }

    /// Commands the tension of the limbs, which determines damping: 0 relaxed, -1 loose, 1 braced. Other values are
    /// ignored.
    pub fn tension(&mut self, share: f32) {
        if share.abs() <= 1.0 {
            self.wanted_strain[3] = share;
        }
    }

    /// Sets the damping coefficients of relaxed limbs, each from -1 to 30. Other values are ignored.
    pub fn damping(&mut self, damping: AxisCoefficients<f32>) {
        let allowed = |value: &f32| (-1.0..=30.0).contains(value);
        if damping.to_array().iter().all(allowed) {
            self.relaxed = damping;
        }
    }

    /// Lets the inputs follow their commands for `duration` (s).
    fn strain(&mut self, duration: f32) {
        let reach = TENSING * duration;
        for (strain, wanted) in self.strain.iter_mut().zip(self.wanted_strain) {
            *strain += (wanted - *strain).clamp(-reach, reach);
        }
        let [pitch, yaw, roll, tension] = self.strain;
        self.inputs.muscle = AxisCoefficients::new(
            pitch * MOST_MUSCLE.pitch,
            yaw * MOST_MUSCLE.yaw,
            roll * MOST_MUSCLE.roll,
        );
        let far = if tension < 0.0 { LOOSE } else { BRACED };
        let share = tension.abs();
        let mixed = |near: f32, far: f32| near + (far - near) * share;
        self.inputs.damping = AxisCoefficients::new(
            mixed(self.relaxed.pitch, far.pitch),
            mixed(self.relaxed.yaw, far.yaw),
            mixed(self.relaxed.roll, far.roll),
        );
    }

    /// Returns whether the flight has ended at the ground, the plane of height zero.
    pub fn is_on_ground(&self) -> bool {
        self.motion().position.up() <= 0.0
    }

    /// Advances the flight by one step of 1/240 s, unless it has ended at the ground.
    pub fn step(&mut self) {
        if self.is_on_ground() {
            return;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        let duration = TIME_STEP as f32;
        self.strain(duration);
        let reach = SPEED * duration;
        let mut posture = self.base;
        for ((control, wanted), amount) in CONTROLS.iter().zip(self.wanted).zip(&mut self.amounts) {
            *amount += (wanted - *amount).clamp(-reach, reach);
            let angle = *amount * control.limit;
            posture = if control.mirrored {
                moved(&posture.mirrored(), control.pattern, angle).mirrored()
            } else {
                moved(&posture, control.pattern, angle)
            };
        }
        if self.autopilot.is_some() {
            let motion = self.motion();
            if let Some(autopilot) = &mut self.autopilot {
                autopilot.feel(&motion, duration);
                posture = autopilot.moved(&posture);
            }
        }
        let joints = self.joints.iter_mut().flatten();
        for (angle, wanted) in joints.zip(self.wanted_joints.iter().flatten()) {
            *angle += (wanted - *angle).clamp(-reach, reach);
        }
        for (segment, [psi, theta, phi]) in Segment::ALL.iter().zip(self.joints) {
            let turned = joint_rotation(psi, theta, phi) * posture.parent_from_segment(*segment);
            posture.set(*segment, turned);
        }
        self.before = self.posture;
        self.posture = posture;
        self.run
            .advance(&self.setup.dynamics, &self.inputs, &posture, duration);
        self.steps += 1;
    }

    /// Returns the time since the start (s).
    #[expect(clippy::cast_possible_truncation, reason = "flights last minutes")]
    pub fn time(&self) -> f32 {
        (f64::from(self.steps) * TIME_STEP) as f32
    }

    /// Returns the motion, unless the simulation has diverged.
    // Not inlined, to keep the page small.
    #[inline(never)]
    pub fn motion(&self) -> Motion<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        let rate = PostureRate::between(&self.before, &self.posture, TIME_STEP as f32);
        self.run.motion(&self.setup.dynamics, &rate)
    }

    /// Returns the current frame.
    pub fn frame(&self) -> Frame {
        frame(
            &self.setup.dynamics,
            &self.inputs,
            &self.posture,
            &self.motion(),
            self.time(),
        )
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use bodyflight_core::aerodynamics::load_model::LoadModel;
    use bodyflight_core::body::anthropometry::{Person, Sex};
    use bodyflight_core::body::gear::Gear;
    use bodyflight_core::dynamics::muscle_input::{BACK_TRACKING, MuscleForces};
    use bodyflight_core::observation::Observation;
    use nalgebra::Vector3;

    pub(crate) fn setup() -> Setup {
        let person = Person::new(1.75, 75.0, Sex::Male);
        let body = person.body().unwrap();
        let mut dynamics = Dynamics::paper(body, 1.0);
        dynamics.muscles = BACK_TRACKING.with_forces(MuscleForces::Moment);
        Setup {
            dynamics,
            inputs: Inputs::belly_turn(),
        }
    }

    pub(crate) fn cockpit() -> Cockpit {
        Cockpit::new(&setup(), 0)
    }

    fn flown(start: usize, control: usize, share: f32, seconds: u32) -> Observation<f32> {
        let mut cockpit = Cockpit::new(&setup(), start);
        for step in 0..240 * seconds {
            if step == 240 {
                cockpit.command(control, share);
            }
            cockpit.step();
        }
        Observation::of(&cockpit.motion())
    }

    #[test]
    fn a_turn_key_turns_and_the_opposite_one_turns_back() {
        let (left, right) = (flown(0, 0, 1.0, 4).yaw_rate, flown(0, 0, -1.0, 4).yaw_rate);
        assert!(left.abs() > 0.3, "{left}");
        assert!((left + right).abs() < 0.05 * left.abs(), "{left} {right}");
        assert!(flown(0, 0, 0.0, 4).yaw_rate.abs() < 1e-3);
    }

    /// The head points north at the start, so forward is north and left is west.
    #[test]
    fn slides_and_leg_movements_go_in_the_documented_directions() {
        let velocity = |control: usize, share: f32| {
            let mut cockpit = cockpit();
            cockpit.command(control, share);
            (0..240 * 4).for_each(|_| cockpit.step());
            cockpit.motion().velocity_inertial()
        };
        let (forward, backward) = (velocity(3, 1.0).north(), velocity(3, -1.0).north());
        let (left, right) = (velocity(2, 1.0).west(), velocity(2, -1.0).west());
        assert!(forward > 1.0 && backward < -0.3, "{forward} {backward}");
        assert!(left > 1.0 && right < -1.0, "{left} {right}");
    }

    #[test]
    fn de_arching_slows_the_fall() {
        let [fast, slow] = [1.0, -1.0].map(|share| -flown(0, 1, share, 8).vertical_velocity);
        assert!(fast > slow + 2.0, "{fast} {slow}");
    }

    #[test]
    fn invalid_commands_change_nothing() {
        let mut cockpit = cockpit();
        let mut other = cockpit.clone();
        cockpit.command(99, 1.0);
        cockpit.command(0, f32::NAN);
        cockpit.joint(99, 0, 0.1);
        cockpit.joint(0, 9, 0.1);
        cockpit.muscle(AxisCoefficients::new(f32::INFINITY, 0.0, 0.0));
        cockpit.tension(-1.1);
        cockpit.tension(f32::NAN);
        cockpit.damping(AxisCoefficients::repeat(f32::NAN));
        for _ in 0..240 {
            cockpit.step();
            other.step();
        }
        let bits = |cockpit: &Cockpit| cockpit.frame().map(f32::to_bits);
        assert_eq!(bits(&cockpit), bits(&other));
    }

    /// A subject of this height (m) with equipment and free-fly aerodynamics.
    fn free_fly(height: f64) -> Setup {
        let mut setup = setup();
        let person = Person::new(height, 25.0 * height * height, Sex::Male);
        let body = Gear::default().fit(&person.body().unwrap()).unwrap();
        setup.dynamics.body = body.cast();
        setup.dynamics.aerodynamics.model = LoadModel::FreeFly;
        setup
    }

    /// Largest angular velocity (rad/s) of the pelvis, less its mean over a quarter of a second. Before its sensor was
    /// filtered, the autopilot shook the pelvis by 1.6 rad/s about one axis and 1.9 rad/s about another.
    #[test]
    fn the_autopilot_holds_a_sit_of_twenty_seconds_without_shaking_it() {
        const MEAN_OVER: usize = 60;
        for height in [1.6, 1.75, 1.9] {
            let mut cockpit = Cockpit::new(&free_fly(height), 1);
            cockpit.hold(true);
            let spins: Vec<_> = (0..240 * 20)
                .map(|step| {
                    // A pilot who turns now and then.
                    if step % 960 == 480 {
                        cockpit.command(0, if step % 1920 == 480 { 1.0 } else { -1.0 });
                    } else if step % 960 == 600 {
                        cockpit.command(0, 0.0);
                    }
                    cockpit.step();
                    let turning = (360..480).contains(&(step % 960)) && step > 480;
                    (turning, cockpit.motion().angular_velocity.components)
                })
                .collect();
            let shaken = spins
                .windows(MEAN_OVER)
                .filter(|window| window.iter().all(|(settled, _)| *settled))
                .map(|window| {
                    let sum = window
                        .iter()
                        .fold(Vector3::zeros(), |sum, (_, spin)| sum + spin);
                    (window[MEAN_OVER / 2].1 - sum / MEAN_OVER as f32).norm()
                })
                .fold(0.0, f32::max);
            println!("{height} m: shaken by {shaken:.1e} rad/s");
            assert!(shaken < 0.01, "{height} m: {shaken}");
        }
    }

    /// For subjects of several sizes, with the initial disturbance of each start.
    #[test]
    fn the_autopilot_holds_a_sit_and_the_air_holds_head_down() {
        let worst = |start: usize, height: f64, hold: bool| {
            let mut cockpit = Cockpit::new(&free_fly(height), start);
            cockpit.hold(hold);
            (0..240 * 40).fold(0.0f32, |worst, _| {
                cockpit.step();
                worst.max(cockpit.tilt())
            })
        };
        let (sit, head_down) = (1, 2);
        assert!(worst(sit, 1.75, false) > 1.0);
        for height in [1.6, 1.75, 1.9] {
            // Head-down is stable without an autopilot.
            for (start, hold) in [(sit, true), (head_down, false)] {
                let tilt = worst(start, height, hold);
                println!("{}, {height} m: {tilt:.3} rad", STARTS[start].name);
                assert!(tilt < 0.2, "{} {height}: {tilt}", STARTS[start].name);
            }
        }
        assert!(!cockpit().can_hold());
    }

    #[test]
    fn a_flight_ends_at_the_ground() {
        let mut cockpit = cockpit();
        let mut steps = 0;
        while !cockpit.is_on_ground() {
            cockpit.step();
            steps += 1;
            assert!(steps < 240 * 200, "still flying after 200 s");
        }
        let (time, height) = (cockpit.time(), cockpit.motion().position.up());
        println!("on the ground after {time:.1} s");
        assert!(
            (60.0..110.0).contains(&time) && height > -1.0,
            "{time} {height}"
        );
        cockpit.step();
        assert_eq!(cockpit.time().to_bits(), time.to_bits());
    }

    /// Paper, "Pitch and Roll oscillations experienced by novices".
    #[test]
    fn the_novice_oscillates_in_pitch_and_the_relaxed_skydiver_does_not() {
        let swing = |start: usize, held: f32| {
            let mut cockpit = Cockpit::new(&setup(), start);
            cockpit.command(5, held);
            let (mut low, mut high) = (f32::MAX, f32::MIN);
            for step in 0..240 * 20 {
                cockpit.step();
                if step >= 240 * 12 {
                    let pitch = Observation::of(&cockpit.motion()).angles.pitch;
                    (low, high) = (low.min(pitch), high.max(pitch));
                }
            }
            high - low
        };
        let (novice, relaxed) = (swing(5, 0.5), swing(0, 0.5));
        assert!(novice > 0.3, "{novice}");
        assert!(relaxed < 0.1, "{relaxed}");
    }
}
