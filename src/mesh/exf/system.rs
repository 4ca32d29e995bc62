//! Coordinate systems of EX files, and the way from each to rectangular cartesian coordinates.

use super::jet::Jet;
use super::nodes::FieldLine;

/// A system of coordinates; the axis of the curvilinear ones is z, but x for the prolate spheroid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum System {
    RectangularCartesian,
    /// (r, theta, z).
    CylindricalPolar,
    /// (r, theta, phi): phi is the angle above the plane z = 0.
    SphericalPolar,
    /// (lambda, mu, theta) about a focus at this distance from the origin.
    ProlateSpheroidal(f64),
}

impl System {
    /// Of a field; the words for it where it is none of these.
    pub fn of(line: &FieldLine) -> Result<System, String> {
        match (line.system.as_str(), line.focus) {
            ("rectangular cartesian", _) => Ok(System::RectangularCartesian),
            ("cylindrical polar", _) => Ok(System::CylindricalPolar),
            ("spherical polar", _) => Ok(System::SphericalPolar),
            ("prolate spheroidal", Some(focus)) => Ok(System::ProlateSpheroidal(focus)),
            ("prolate spheroidal", None) => Err("prolate spheroidal coordinates without `focus=`".into()),
            (other, _) => Err(format!("{other} coordinates")),
        }
    }

    /// Rectangular cartesian coordinates.
    ///
    /// Cylindrical: x = r cos theta, y = r sin theta. Spherical: x = r cos theta cos phi, y = r sin theta cos phi,
    /// z = r sin phi. Prolate with the focus a: x = a cosh lambda cos mu, y = a sinh lambda sin mu cos theta,
    /// z = a sinh lambda sin mu sin theta.
    pub fn cartesian(self, [p, q, r]: [Jet; 3]) -> [Jet; 3] {
        match self {
            System::RectangularCartesian => [p, q, r],
            System::CylindricalPolar => {
                let (sine, cosine) = q.sin_cos();
                [p * cosine, p * sine, r]
            }
            System::SphericalPolar => {
                let ((sine, cosine), (up, along)) = (q.sin_cos(), r.sin_cos());
                [p * along * cosine, p * along * sine, p * up]
            }
            System::ProlateSpheroidal(focus) => {
                let ((sinh, cosh), (sin_mu, cos_mu), (sine, cosine)) = (p.sinh_cosh(), q.sin_cos(), r.sin_cos());
                let from_axis = (sinh * sin_mu).scaled(focus);
                [(cosh * cos_mu).scaled(focus), from_axis * cosine, from_axis * sine]
            }
        }
    }
}
