//! The versions of the standard that a unit can have.

/// A version of FMI. The model and its variables are the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Standard {
    /// FMI 2.0, which more programs read.
    Two,
    /// FMI 3.0.
    #[default]
    Three,
}

impl Standard {
    /// All versions.
    pub const ALL: [Self; 2] = [Self::Two, Self::Three];

    /// Its number.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Two => "2.0",
            Self::Three => "3.0",
        }
    }

    /// The version with this number.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|version| version.name() == name)
    }

    /// The folder of a library in a unit, for an architecture and a system as Rust names them.
    pub fn platform(self, architecture: &str, system: &str) -> String {
        let system = match (self, system) {
            (_, "macos") => "darwin",
            (Self::Two, "windows") => "win",
            _ => system,
        };
        match (self, architecture) {
            (Self::Two, "x86_64") => format!("{system}64"),
            (Self::Two, "x86") => format!("{system}32"),
            // FMI 2.0 names no others; its importers use the names of FMI 3.0.
            _ => format!(
                "{architecture}-{}",
                if system == "win" { "windows" } else { system }
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn platforms_are_named_as_the_standards_do() {
        for (architecture, system, two, three) in [
            ("x86_64", "linux", "linux64", "x86_64-linux"),
            ("x86_64", "windows", "win64", "x86_64-windows"),
            ("x86_64", "macos", "darwin64", "x86_64-darwin"),
            ("aarch64", "macos", "aarch64-darwin", "aarch64-darwin"),
            ("aarch64", "windows", "aarch64-windows", "aarch64-windows"),
        ] {
            assert_eq!(Standard::Two.platform(architecture, system), two);
            assert_eq!(Standard::Three.platform(architecture, system), three);
        }
        assert_eq!(Standard::from_name("2.0"), Some(Standard::Two));
        assert_eq!(Standard::from_name("1.0"), None);
    }
}
