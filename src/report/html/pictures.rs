//! The skin as a picture: what is seen on paper and where there is no WebGL.

use super::camera::Camera;
use super::frame::escape;
use crate::math::tensor::{Vector, cross, dot, norm, normalised, subtract};
use crate::report::playback::Playback;

/// Side of a picture, pixels.
const SIDE: f64 = 330.0;

/// The skin at `points`, coloured by displacement up to `most` mm.
pub(super) fn picture(run: &Playback, points: &[Vector], camera: &Camera, most: f64, caption: &str) -> String {
    let seen: Vec<Vector> = points.iter().map(|x| camera.project(*x)).collect();
    let moved: Vec<f64> = points.iter().zip(&run.skin.rest).map(|(x, r)| norm(subtract(*x, *r))).collect();
    let mut quads: Vec<(f64, String)> = Vec::new();
    for quad in &run.skin.quads {
        let [a, b, c, d] = quad.map(|point| seen[point as usize]);
        let area = cross(subtract(c, a), subtract(d, b));
        // from behind, or without area
        if area[2] <= 0.0 {
            continue;
        }
        let light = 0.4 + 0.6 * dot(normalised(area), normalised([-0.25, 0.35, 1.0])).max(0.0);
        let part = quad.iter().map(|point| moved[*point as usize]).sum::<f64>() / 4.0 / most.max(1e-12);
        let fill = ramp(part).map(|c| (255.0 * c * light) as u8);
        let at = |p: Vector| format!("{:.1} {:.1}", SIDE * (0.5 + 0.9 * p[0]), SIDE * (0.5 - 0.9 * p[1]));
        let path = format!(
            "<path d=\"M{}L{}L{}L{}Z\" fill=\"#{:02x}{:02x}{:02x}\"/>",
            at(a),
            at(b),
            at(c),
            at(d),
            fill[0],
            fill[1],
            fill[2]
        );
        quads.push((a[2] + b[2] + c[2] + d[2], path));
    }
    // what is nearer is drawn later
    quads.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut svg = format!(
        "<svg width=\"{SIDE}\" height=\"{SIDE}\" viewBox=\"0 0 {SIDE} {SIDE}\" role=\"img\" shape-rendering=\"crispEdges\">"
    );
    svg.extend(quads.into_iter().map(|(_, path)| path));
    format!("<figure>{svg}</svg><figcaption>{}</figcaption></figure>\n", escape(caption))
}

/// Skin over yellow to red, as in viewer.js.
fn ramp(part: f64) -> Vector {
    let smooth = |low: f64, high: f64| {
        let t = ((part - low) / (high - low)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let mix = |a: Vector, b: Vector, t: f64| -> Vector { std::array::from_fn(|k| a[k] + t * (b[k] - a[k])) };
    mix(mix([0.87, 0.70, 0.60], [0.99, 0.80, 0.25], smooth(0.0, 0.5)), [0.80, 0.15, 0.20], smooth(0.4, 1.0))
}
