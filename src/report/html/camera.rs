//! From where a body is looked at, in pictures and in the viewer: a face from the front, anything else from a corner.

use crate::math::tensor::Vector;
use crate::report::playback::Playback;
use crate::scene::GeometrySpec;

/// A direction of view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    /// The axis that stands upright: `y` of a face, else `z`.
    pub up: &'static str,
    /// Turn about it, radians.
    pub yaw: f64,
    /// Tilt from above, radians.
    pub pitch: f64,
    /// The middle of what is seen, mm.
    pub centre: Vector,
    /// Its greatest extent, mm.
    pub size: f64,
}

impl Camera {
    /// For the rest and all shapes of a run.
    pub fn new(run: &Playback) -> Camera {
        let face = matches!(run.scene.mesh.geometry, GeometrySpec::Face(_));
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in run.skin.rest.iter().chain(run.shapes.iter().flat_map(|shape| &shape.skin)) {
            for d in 0..3 {
                low[d] = low[d].min(point[d]);
                high[d] = high[d].max(point[d]);
            }
        }
        let centre = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
        let size = (0..3).map(|d| high[d] - low[d]).fold(1e-9, f64::max);
        let (up, yaw, pitch) = if face { ("y", 0.35, 0.05) } else { ("z", 0.5, 0.35) };
        Camera { up, yaw, pitch, centre, size }
    }

    /// Right, up and towards the eye, in units of the greatest extent; as in viewer.js.
    pub fn project(&self, x: Vector) -> Vector {
        let [a, b, c]: Vector = std::array::from_fn(|d| (x[d] - self.centre[d]) / self.size);
        // across, up, ahead
        let [a, u, d] = if self.up == "z" { [a, c, -b] } else { [a, b, c] };
        let ((sy, cy), (sp, cp)) = (self.yaw.sin_cos(), self.pitch.sin_cos());
        [cy * a - sy * d, -sp * sy * a + cp * u - sp * cy * d, cp * sy * a + sp * u + cp * cy * d]
    }
}
