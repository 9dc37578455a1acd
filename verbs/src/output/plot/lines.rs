//! Line styles by meaning: the same meaning looks the same in all figures.

use plotters::style::{Color, RGBColor, ShapeStyle};

/// The plotting library draws at integer coordinates, so a figure is drawn this many times too large and scaled down by
/// its view box. Coordinates are then accurate to a tenth of a unit.
pub const FINE: u32 = 10;

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Name in the legend.
    pub label: &'static str,
    pub(crate) colour: RGBColor,
    pub(crate) width: u32,
}

impl Line {
    /// As a style of the plotting library.
    pub fn style(&self) -> ShapeStyle {
        self.colour.stroke_width(self.width * FINE)
    }
}

/// Broad and pale, drawn below: visible where lines agree, and in greyscale print.
pub const MEASURED: Line = Line {
    label: "measured",
    colour: RGBColor(0x8f, 0xb8, 0xde),
    width: 3,
};
/// Thin and dark, drawn on top.
pub const SIMULATED: Line = Line {
    label: "simulated",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// A simulation without a change that is asked about, and with it.
pub const UNCHANGED: Line = Line {
    label: "unchanged",
    ..MEASURED
};
/// See [`UNCHANGED`].
pub const CHANGED: Line = Line {
    label: "changed",
    ..SIMULATED
};
/// Reconstruction with estimated inputs.
pub const ESTIMATED: Line = Line {
    label: "with estimated inputs",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// Reconstruction with constant inputs.
pub const CONSTANT: Line = Line {
    label: "with constant inputs",
    colour: RGBColor(0x8a, 0x8a, 0x8a),
    width: 1,
};
/// The plain model, without the effects.
pub const PLAIN: Line = Line {
    label: "the model alone",
    colour: RGBColor(0x8a, 0x8a, 0x8a),
    width: 2,
};
/// The model with the effects found.
pub const EXTENDED: Line = Line {
    label: "with the effects found",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 2,
};
/// The residual error when no effect is missing.
pub const FLOOR: Line = Line {
    label: "if nothing is missing",
    colour: RGBColor(0x8f, 0xb8, 0xde),
    width: 3,
};
/// Lines of the three axes: pitch, yaw, roll.
pub const AXES: [Line; 3] = [
    Line {
        label: "pitch",
        colour: RGBColor(0xc4, 0x6a, 0x00),
        width: 2,
    },
    Line {
        label: "yaw",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 2,
    },
    Line {
        label: "roll",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 2,
    },
];

/// The filter's self-checks: attitude, angular velocity, velocity, residual load, and all channels together.
pub const WATCHED: [Line; 5] = [
    Line {
        label: "attitude",
        colour: RGBColor(0xc4, 0x6a, 0x00),
        width: 1,
    },
    Line {
        label: "angular velocity",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 1,
    },
    Line {
        label: "velocity",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 1,
    },
    Line {
        label: "residual load",
        colour: RGBColor(0x8f, 0xb8, 0xde),
        width: 2,
    },
    Line {
        label: "all channels",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 2,
    },
];
/// Limits above which the filter reports itself doubtful or lost.
pub const LIMITS: [Line; 2] = [
    Line {
        label: "doubtful above",
        colour: RGBColor(0x8a, 0x8a, 0x8a),
        width: 1,
    },
    Line {
        label: "lost above",
        colour: RGBColor(0x9c, 0x2f, 0x00),
        width: 1,
    },
];
/// Lines of several flights in one figure: measured, and with estimated inputs.
pub const FLIGHTS: [[Line; 2]; 5] = [
    [
        Line {
            label: "A measured",
            colour: RGBColor(0x8f, 0xb8, 0xde),
            width: 3,
        },
        Line {
            label: "A",
            colour: RGBColor(0x1f, 0x5a, 0x99),
            width: 1,
        },
    ],
    [
        Line {
            label: "B measured",
            colour: RGBColor(0xf0, 0xc3, 0xa0),
            width: 3,
        },
        Line {
            label: "B",
            colour: RGBColor(0xb0, 0x4a, 0x00),
            width: 1,
        },
    ],
    [
        Line {
            label: "C measured",
            colour: RGBColor(0xa5, 0xd6, 0xbd),
            width: 3,
        },
        Line {
            label: "C",
            colour: RGBColor(0x1b, 0x6e, 0x53),
            width: 1,
        },
    ],
    [
        Line {
            label: "D measured",
            colour: RGBColor(0xc9, 0xbf, 0xe8),
            width: 3,
        },
        Line {
            label: "D",
            colour: RGBColor(0x5b, 0x4b, 0xa8),
            width: 1,
        },
    ],
    [
        Line {
            label: "E measured",
            colour: RGBColor(0xc8, 0xc8, 0xc8),
            width: 3,
        },
        Line {
            label: "E",
            colour: RGBColor(0x40, 0x40, 0x40),
            width: 1,
        },
    ],
];
/// Times in which an estimate is doubtful or lost.
pub const UNTRUSTED: [Line; 2] = [
    Line {
        label: "doubtful",
        colour: RGBColor(0xfa, 0xe9, 0xc8),
        width: 8,
    },
    Line {
        label: "lost",
        colour: RGBColor(0xf5, 0xcf, 0xc7),
        width: 8,
    },
];
/// A fall simulated again with the quantities estimated from it.
pub const FLOWN: Line = Line {
    label: "flown again",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// Estimates that are constant within each piece.
pub const ESTIMATED_PIECES: Line = Line {
    label: "pieces",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 2,
};
/// Border between two phases.
pub const BORDER: Line = Line {
    label: "exit, opening, canopy",
    colour: RGBColor(0x1b, 0x6e, 0x53),
    width: 1,
};
/// Lines of the models that validation compares, in the order of its tables.
pub const MODEL_PARTS: [Line; 4] = [
    Line {
        label: "exact equations",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 3,
    },
    Line {
        label: "as published",
        colour: RGBColor(0x9c, 0x2f, 0x00),
        width: 2,
    },
    Line {
        label: "limbs without momentum",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 1,
    },
    Line {
        label: "posture frozen",
        colour: RGBColor(0x8a, 0x8a, 0x8a),
        width: 1,
    },
];
