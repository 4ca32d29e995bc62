//! The precision of a factor.

/// In which numbers a matrix is factored. Solutions are refined in double precision against the matrix itself, so the
/// precision decides how much a factorisation costs and how many sweeps a solution takes, not how good it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// 53 bits.
    #[default]
    Double,
    /// 24 bits: half the memory, twice as many numbers in a vector register.
    Single,
}

impl Precision {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Precision::Double => "double",
            Precision::Single => "single",
        }
    }
}

/// A number of a factor.
pub(super) trait Scalar: faer::traits::RealField + Copy + Default {
    /// The nearest number to one in double precision.
    fn round(value: f64) -> Self;
    /// The same number in double precision.
    fn widen(self) -> f64;
}

impl Scalar for f64 {
    fn round(value: f64) -> f64 {
        value
    }

    fn widen(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    fn round(value: f64) -> f32 {
        value as f32
    }

    fn widen(self) -> f64 {
        self.into()
    }
}
