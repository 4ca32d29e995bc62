//! Why a path probably ended, as far as the last iterate tells.

/// A probable cause that a failed state shows.
#[derive(Debug, Clone, PartialEq)]
pub enum Likely {
    /// A face slides off the surface that it must stay on.
    OffSurface {
        /// The sliding or contact.
        name: String,
        /// The element of the host.
        element: usize,
        /// Where its face leaves the surface, mm.
        position: [f64; 3],
    },
    /// Active fibres are so long that they have lost force: one part of a muscle stretches the other.
    DescendingLimb {
        /// The muscle.
        muscle: String,
        /// Its quadrature points on the descending limb.
        points: usize,
        /// Of how many.
        of: usize,
        /// Current position of the longest fibre, mm.
        position: [f64; 3],
        /// Its stretch.
        stretch: f64,
    },
}

impl std::fmt::Display for Likely {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Likely::OffSurface { name, element, position: [x, y, z] } => write!(
                out,
                "`{name}` slides off its surface: it has left the edge behind by more than an element at ({x:.2}, {y:.2}, \
                 {z:.2}) mm, in element {element}"
            ),
            Likely::DescendingLimb { muscle, points, of, position: [x, y, z], stretch } => write!(
                out,
                "{points} of {of} fibre points of muscle `{muscle}` are active beyond a stretch of 1.4, on the descending limb \
                 of their force: the longest, at ({x:.2}, {y:.2}, {z:.2}) mm, has a stretch of {stretch:.3}"
            ),
        }
    }
}

/// A line of its own below a message.
pub(super) fn below(likely: &Option<Box<Likely>>) -> String {
    likely.as_ref().map(|likely| format!("\n  probable cause: {likely}")).unwrap_or_default()
}
