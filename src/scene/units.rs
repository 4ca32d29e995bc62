//! Units of length.

use serde::{Deserialize, Serialize};

/// The length unit of the positions in a recording: `[fit] units`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Units {
    /// Millimetres.
    #[default]
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
}

impl Units {
    /// All of them, the smallest first.
    pub const ALL: [Units; 3] = [Units::Mm, Units::Cm, Units::M];

    /// How many millimetres one of it is.
    pub fn mm(self) -> f64 {
        match self {
            Units::Mm => 1.0,
            Units::Cm => 10.0,
            Units::M => 1000.0,
        }
    }

    /// The unit that a file means by a word such as `mm`, `millimetre` or `Millimeters`.
    pub fn from_name(name: &str) -> Option<Units> {
        let name = name.trim().to_lowercase().replace("metre", "meter");
        match name.strip_suffix('s').unwrap_or(&name) {
            "mm" | "millimeter" => Some(Units::Mm),
            "cm" | "centimeter" => Some(Units::Cm),
            "m" | "meter" => Some(Units::M),
            _ => None,
        }
    }

    /// `mm`, `cm` or `m`.
    pub fn name(self) -> &'static str {
        match self {
            Units::Mm => "mm",
            Units::Cm => "cm",
            Units::M => "m",
        }
    }
}

impl std::fmt::Display for Units {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
