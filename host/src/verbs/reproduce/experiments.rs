//! The experiments: which script flies which figure of the paper, and what differs.

/// An experiment of the paper.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// Name in commands.
    pub name: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Figures of the paper, by their labels.
    pub figures: &'static str,
    /// The script that flies it.
    pub maneuver: &'static str,
    /// Whether it is flown in a wind tunnel.
    pub tunnel: bool,
    /// The paper's settings of the filter.
    pub preset: &'static str,
    /// What differs from the paper.
    pub differs: &'static str,
    /// Why channels are missed, where they are.
    pub why: &'static str,
}

/// Why the paper's filter misses level flight.
const FORCES: &str = "Paper's filter: bounded at zero from below, it finds muscle input where there is none; with the input comes a force, \
                      and the preset does not see the vertical.";

const ROTATIONS: Experiment = Experiment {
    name: "rotations",
    title: "Turns left and right in free fall",
    figures: "ff_yr",
    maneuver: "rotations",
    tunnel: false,
    preset: "turning-experienced",
    differs: "Arms turn by a script, smoother than a person's.",
    why: "",
};

/// All of them, in the order of the paper.
pub const EXPERIMENTS: [Experiment; 15] = [
    Experiment {
        name: "rotations-tunnel",
        title: "Turns left and right in a wind tunnel",
        figures: "tunnel_yr, taff_turn_noUKF, taff_turn_UKF, taff_turncoeffs",
        tunnel: true,
        differs: "The stream is uniform; nobody steers back to the middle of the tunnel, so a flight meets its walls.",
        ..ROTATIONS
    },
    ROTATIONS,
    Experiment {
        name: "neutral-fall",
        title: "Neutral fall",
        figures: "trim",
        maneuver: "neutral-fall",
        preset: "tracking",
        differs: "Sway in place of a person's corrections.",
        why: FORCES,
        ..ROTATIONS
    },
    Experiment {
        name: "side-slides",
        title: "Slides to both sides",
        figures: "text only",
        maneuver: "side-slides",
        preset: "tracking",
        why: FORCES,
        ..ROTATIONS
    },
    Experiment {
        name: "longitudinal",
        title: "Forwards and backwards",
        figures: "text only",
        maneuver: "longitudinal",
        preset: "tracking",
        why: FORCES,
        ..ROTATIONS
    },
    Experiment {
        name: "vertical",
        title: "Faster and slower falls",
        figures: "text only",
        maneuver: "vertical",
        preset: "tracking",
        why: FORCES,
        ..ROTATIONS
    },
    Experiment {
        name: "barrel-roll",
        title: "Barrel rolls: belly, back, belly",
        figures: "tr1",
        maneuver: "barrel-roll",
        preset: "transitions-negative-damping",
        differs: "Two half rolls by a script; with the paper's muscle forces they would be whole ones.",
        why: "Paper's filter: the preset measures heading to 1.5 rad and no velocity, so after a fast roll heading, yaw rate and both speeds go their own way.",
        ..ROTATIONS
    },
    Experiment {
        name: "layouts",
        title: "A layout, damping 12 or -0.1",
        figures: "layouts, layouts_snap",
        maneuver: "layouts",
        preset: "layouts",
        differs: "The paper shows this one flown only, as here; it is reconstructed besides. With moments alone the body passes its back and does not \
                  stay there, with the paper's muscle forces it does.",
        why: "Paper's filter: damping jumps between 12 and -0.1, which it follows too late to know to which side the body turns, and the preset measures no velocity.",
        ..ROTATIONS
    },
    Experiment {
        name: "transitions",
        title: "Fourteen changes between belly and back, damping at least 0.01",
        figures: "tran, trancoeffs",
        maneuver: "fourteen-transitions",
        preset: "transitions",
        differs: "The paper's order: back flips, front loop, front flip, rolls, layouts, the sixth of which fails and becomes a roll, its damping -0.1 and -0.2 in pitch and yaw.",
        why: "Paper's filter: over its window of 0.25 s it turns too early and too little, the preset measures heading to 1.5 rad and no velocity, and its forces push the body 43 m/s off where nothing corrects them; roll and pitch are followed.",
        ..ROTATIONS
    },
    Experiment {
        name: "transitions-negative-damping",
        title: "Fourteen changes between belly and back, damping at least -0.25",
        figures: "tran_im, trancoeffs_im",
        maneuver: "fourteen-transitions",
        preset: "transitions-negative-damping",
        differs: "As before with the wider bounds.",
        why: "As before. The wider bounds, which helped the paper, do not help here.",
        ..ROTATIONS
    },
    Experiment {
        name: "tracking",
        title: "Tracking from the exit: belly, back, belly",
        figures: "track, trackcoeffs, tracktop",
        maneuver: "exit-and-tracking",
        preset: "tracking",
        differs: "The paper's skydiver reaches 33 m/s over ground with a pitch input between 1 and 2, this one 30 m/s with 1.25. With 1.4 it is 35 m/s, but other bodies then dive. Both go over to the back and return by rolls.",
        why: "Both: each roll is over in half a second at up to 18 rad/s, begun by damping that falls from 12 to 0.05, which an estimate follows some hundredths of a second late. Paper's filter besides: the preset does not see the vertical.",
        ..ROTATIONS
    },
    Experiment {
        name: "aggressive-turns",
        title: "Fast turns with muscle input in every axis",
        figures: "turn, turnpr, turncoeffs",
        maneuver: "aggressive-turns",
        preset: "turning",
        differs: "10.6 rad/s, faster than the paper's 7, but the body stays level within 0.1 rad where the paper's tilts.",
        why: "Paper's filter: its forces act where the preset does not see the speed; yaw rate, roll and pitch are within it.",
        ..ROTATIONS
    },
    Experiment {
        name: "novice-turns",
        title: "The same turns, reconstructed with the limbs of an expert",
        figures: "taff_turn_UKF against turn",
        maneuver: "aggressive-turns",
        preset: "turning-experienced",
        differs: "The limbs of the preset are those of an experienced skydiver, the flight's are all.",
        why: "Both: the limbs are not those that flew, and what an input does depends on them: skill is data that the filter must be told.",
        ..ROTATIONS
    },
    Experiment {
        name: "expert-turns",
        title: "Turns in a suit with booties, in a wind tunnel",
        figures: "jen_turn, jen_turncoeffs",
        maneuver: "rw-suit-turns",
        tunnel: true,
        preset: "turning-rw-suit",
        differs: "Moments by thighs and shanks, as the paper finds of its competitor.",
        ..ROTATIONS
    },
    Experiment {
        name: "roll-oscillation",
        title: "A novice rocks from side to side",
        figures: "text only",
        maneuver: "roll-oscillation",
        preset: "transitions",
        differs: "One arm and one leg down, as in the paper; damping in roll is 0 from 2.5 to 11 s and 6 after that.",
        why: "Paper's filter: the preset measures heading to 1.5 rad and no velocity, so yaw rate and speeds go their own way; roll is followed.",
        ..ROTATIONS
    },
];
