//! The experiments: which script corresponds to which figures of the paper, and how it differs.

/// How the paper itself obtains its result of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Procedure {
    /// A run with constant damping and no muscle input, as for the basic maneuvers.
    Constant,
    /// Its filter estimates inputs and damping.
    Filter,
    /// A simulation with inputs that it chose; there is no measurement.
    Simulation,
}

impl Procedure {
    /// The procedure in words, after "matched by".
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Constant => "constant damping without muscle input",
            Self::Filter => "the paper's filter",
            Self::Simulation => "a simulation with known inputs",
        }
    }
}

/// An experiment of the paper.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// Name in commands.
    pub name: &'static str,
    /// Title in reports.
    pub title: &'static str,
    /// Labels of the paper's figures; empty if there are none.
    pub figures: &'static str,
    /// The script to fly.
    pub maneuver: &'static str,
    /// Whether it is flown in a wind tunnel.
    pub tunnel: bool,
    /// The paper's filter settings.
    pub preset: &'static str,
    /// Differences from the paper.
    pub differs: &'static str,
    /// Explanation of channels that are not reconstructed, if any.
    pub why: &'static str,
    /// How the paper obtains its result.
    pub procedure: Procedure,
    /// What the paper's figures of this experiment show; empty if there are none.
    pub shows: &'static str,
    /// The script of the matched flight, which has the paper's muscle forces.
    pub matched: &'static str,
    /// Explanation of channels of the matched flight that are not reconstructed, if any.
    pub matched_why: &'static str,
}

/// Why the paper's filter fails in level flight.
const FORCES: &str = "Paper's filter: with inputs bounded below by zero, it finds muscle input where there is none; each input comes with a force, \
and the preset does not measure the vertical velocity.";

/// Why the matched filter misses channels of the track.
const TRACKING_MATCHED: &str = "The exit, up to 9 s, is within it in every channel. In angle flying, yaw input and yaw damping, \
which a symmetric posture hardly shows, wander to their bounds of 6.5 and 24, and the heading with them: with a 64th of Q its gap falls \
from 0.37 to 0.14 rad. Each roll is over in a second, and the prediction takes inputs as constant for a quarter of that. No setting \
brings the horizontal velocity below 0.66 m/s; the paper's 0.45 m/s is for amplitudes of 15 m/s, and this one is 40.";
/// Why the matched filter misses channels of the transitions.
const TRANSITIONS_MATCHED: &str = "Pitch is within the paper's accuracy, and roll just beyond it, at 0.16 and 0.19 rad. Velocities: the preset does not measure them; if it does, their gaps \
are 0.61 and 1.40 m/s. Rates: the paper adds Q dt at each update, so that 60 updates a second let the coefficients wander three times as \
much as 20; with 20, the gap of the angular velocity is 0.48 rad/s, that of roll 0.04 and of pitch 0.07 rad. No setting brings \
it to 0.15.";

const ROTATIONS: Experiment = Experiment {
    name: "rotations",
    title: "Turns left and right in free fall",
    figures: "ff_yr",
    maneuver: "rotations",
    tunnel: false,
    preset: "turning-experienced",
    differs: "The arms follow a script, more smoothly than a person's.",
    why: "",
    procedure: Procedure::Constant,
    shows: "yaw rate",
    matched: "rotations",
    matched_why: "",
};

/// All experiments, in the order of the paper.
pub const EXPERIMENTS: [Experiment; 15] = [
    Experiment {
        name: "rotations-tunnel",
        title: "Turns left and right in a wind tunnel",
        figures: "tunnel_yr, taff_turn_noUKF, taff_turn_UKF, taff_turncoeffs",
        tunnel: true,
        differs: "The airflow is uniform; nobody steers back to the middle of the tunnel, so the flight reaches its walls.",
        procedure: Procedure::Filter,
        shows: "yaw rate and body angles",
        ..ROTATIONS
    },
    ROTATIONS,
    Experiment {
        name: "neutral-fall",
        title: "Neutral fall",
        figures: "trim",
        maneuver: "neutral-fall",
        preset: "tracking",
        differs: "Sway instead of a person's corrections.",
        why: FORCES,
        shows: "the posture",
        ..ROTATIONS
    },
    Experiment {
        name: "side-slides",
        title: "Slides to both sides",
        figures: "",
        maneuver: "side-slides",
        preset: "tracking",
        why: FORCES,
        shows: "",
        ..ROTATIONS
    },
    Experiment {
        name: "longitudinal",
        title: "Forwards and backwards",
        figures: "",
        maneuver: "longitudinal",
        preset: "tracking",
        why: FORCES,
        shows: "",
        ..ROTATIONS
    },
    Experiment {
        name: "vertical",
        title: "Faster and slower falls",
        figures: "",
        maneuver: "vertical",
        preset: "tracking",
        why: FORCES,
        shows: "",
        ..ROTATIONS
    },
    Experiment {
        name: "barrel-roll",
        title: "Barrel rolls: belly, back, belly",
        figures: "tr1",
        maneuver: "barrel-roll",
        preset: "transitions-negative-damping",
        differs: "Two scripted half rolls. The matched flight is that of the fourteen transitions with the wider bounds; three of them are rolls.",
        why: "Paper's filter: the preset measures heading to 1.5 rad and no velocity, so after a fast roll, heading, yaw rate and both speeds drift away.",
        procedure: Procedure::Filter,
        shows: "pictures of it",
        matched: "paper-transitions",
        matched_why: TRANSITIONS_MATCHED,
        ..ROTATIONS
    },
    Experiment {
        name: "layouts",
        title: "A layout, damping 12 or -0.1",
        figures: "layouts, layouts_snap",
        maneuver: "layouts",
        preset: "layouts",
        differs: "The paper only simulates this one; here it is also reconstructed. With moments alone the body passes through the back position; \
        with the paper's muscle forces it stays there.",
        why: "Paper's filter: damping jumps between 12 and -0.1, which it follows too late to tell which way the body rotates, and the preset measures no velocity.",
        procedure: Procedure::Simulation,
        shows: "body angle, inputs and pictures",
        matched: "layouts",
        matched_why: "Roll is undefined where the body passes the vertical, and noise alone makes a gap there, see the motion filter.",
        ..ROTATIONS
    },
    Experiment {
        name: "transitions",
        title: "Fourteen changes between belly and back, damping at least 0.01",
        figures: "tran, trancoeffs",
        maneuver: "fourteen-transitions",
        preset: "transitions",
        differs: "The paper's order: back flips, front loop, front flip, rolls, layouts, the sixth of which fails and becomes a roll, with damping of -0.1 and -0.2 in pitch and yaw.",
        why: "Paper's filter: over its window of 0.25 s it rotates too early and too little, the preset measures heading to 1.5 rad and no velocity, and its forces, which nothing corrects, change the velocity by 43 m/s; roll and pitch are followed.",
        procedure: Procedure::Filter,
        shows: "body angles and inputs",
        matched: "paper-transitions",
        matched_why: TRANSITIONS_MATCHED,
        ..ROTATIONS
    },
    Experiment {
        name: "transitions-negative-damping",
        title: "Fourteen changes between belly and back, damping at least -0.25",
        figures: "tran_im, trancoeffs_im",
        maneuver: "fourteen-transitions",
        preset: "transitions-negative-damping",
        differs: "As before, with the wider bounds.",
        why: "As before. The wider bounds, which helped the paper, do not help here; in the matched flight they help in pitch and in both velocities, and not in roll and rates.",
        procedure: Procedure::Filter,
        shows: "body angles and inputs",
        matched: "paper-transitions",
        matched_why: TRANSITIONS_MATCHED,
        ..ROTATIONS
    },
    Experiment {
        name: "tracking",
        title: "Tracking from the exit: belly, back, belly",
        figures: "track, trackcoeffs, tracktop",
        maneuver: "exit-and-tracking",
        preset: "tracking",
        differs: "The paper's skydiver reaches 33 m/s over ground with a pitch input between 1 and 2, this one 30 m/s with 1.25. With 1.4 it is 35 m/s, but other bodies then dive. Both reach the back position and return by rolls.",
        why: "Both: each roll is over in half a second at up to 18 rad/s, started by damping that falls from 12 to 0.05, which an estimate follows a few hundredths of a second late. In addition, the preset of the paper's filter does not measure the vertical velocity.",
        procedure: Procedure::Filter,
        shows: "roll, pitch, horizontal velocity and inputs",
        matched: "paper-tracking",
        matched_why: TRACKING_MATCHED,
        ..ROTATIONS
    },
    Experiment {
        name: "aggressive-turns",
        title: "Fast turns with muscle input in every axis",
        figures: "turn, turnpr, turncoeffs",
        maneuver: "aggressive-turns",
        preset: "turning",
        differs: "10.6 rad/s, faster than the paper's 7, but the body stays level within 0.1 rad, whereas the paper's tilts.",
        why: "Paper's filter: its forces act on speeds that the preset does not measure; yaw rate, roll and pitch are within the accuracy.",
        procedure: Procedure::Filter,
        shows: "yaw rate, roll, pitch and inputs",
        matched: "aggressive-turns",
        ..ROTATIONS
    },
    Experiment {
        name: "novice-turns",
        title: "The same turns, reconstructed with the limbs of an expert",
        figures: "taff_turn_UKF against turn",
        maneuver: "aggressive-turns",
        preset: "turning-experienced",
        differs: "The preset has the limbs of an experienced skydiver; the flight uses all limbs.",
        why: "Both: the limbs are not those of the flight, and the effect of an input depends on them. The filter must be given the skill as data.",
        procedure: Procedure::Filter,
        shows: "the turns of an expert",
        matched: "aggressive-turns",
        matched_why: "The limbs are not those of the flight.",
        ..ROTATIONS
    },
    Experiment {
        name: "expert-turns",
        title: "Turns in a suit with booties, in a wind tunnel",
        figures: "jen_turn, jen_turncoeffs",
        maneuver: "rw-suit-turns",
        tunnel: true,
        preset: "turning-rw-suit",
        differs: "Moments from thighs and shanks, as the paper finds for its competitor.",
        procedure: Procedure::Filter,
        shows: "yaw rate and inputs",
        matched: "rw-suit-turns",
        ..ROTATIONS
    },
    Experiment {
        name: "roll-oscillation",
        title: "A novice rocks from side to side",
        figures: "",
        maneuver: "roll-oscillation",
        preset: "transitions",
        differs: "One arm and one leg down, as in the paper; damping in roll is 0 from 2.5 to 11 s and 6 after that.",
        why: "Paper's filter: the preset measures heading to 1.5 rad and no velocity, so yaw rate and speeds drift away; roll is followed.",
        procedure: Procedure::Simulation,
        shows: "",
        matched: "roll-oscillation",
        ..ROTATIONS
    },
];
