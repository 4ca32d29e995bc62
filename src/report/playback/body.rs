//! What is seen of a body: skin or muscle as quadrilaterals that move with the host.

use super::facets::Facets;
use crate::error::Result;
use crate::math::tensor::{Vector, add_scaled, cross, norm, subtract};
use crate::mesh::face::{Face, boundary_faces};
use crate::mesh::location::Locator;
use crate::mesh::{MaterialPoint, Mesh};
use crate::model::build::muscle_mesh;
use crate::scene::MuscleSpec;

/// A surface that moves with the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// `skin`, or the name of the muscle.
    pub name: String,
    /// Points before anything moves, mm.
    pub rest: Vec<Vector>,
    /// Corners of quadrilaterals, anticlockwise from outside.
    pub quads: Vec<[u32; 4]>,
    /// The place in the host of every point, and how far the point is from it (a rounding, or a muscle's edge outside).
    at: Vec<(MaterialPoint, Vector)>,
}

/// Quadrilaterals of a skin, about: a face of 560 elements is cut 2 x 2.
const QUADS: usize = 2500;

impl Body {
    /// The named face `skin` of the host, or else its whole boundary.
    pub fn skin(host: &Mesh) -> Body {
        let faces: Vec<Face> = host.named_faces.get("skin").cloned().unwrap_or_else(|| boundary_faces(host));
        let cuts = (1..=4).rev().find(|cuts| faces.len() * cuts * cuts <= QUADS).unwrap_or(1);
        let Facets { points, quads } = Facets::new(host, &faces, cuts);
        let rest = points.iter().map(|at| host.position(*at)).collect();
        Body { name: "skin".into(), rest, quads, at: points.into_iter().map(|at| (at, [0.0; 3])).collect() }
    }

    /// The boundary of a muscle's own mesh.
    ///
    /// # Errors
    /// Where the file of its mesh cannot be read any more.
    pub fn muscle(spec: &MuscleSpec, host: &Locator<'_>) -> Result<Body> {
        let (mesh, ..) = muscle_mesh(spec)?;
        let faces = boundary_faces(&mesh);
        let cuts = if faces.len() < 100 { 2 } else { 1 };
        let Facets { points, quads } = Facets::new(&mesh, &faces, cuts);
        let rest: Vec<Vector> = points.iter().map(|at| mesh.position(*at)).collect();
        let place = |x: &Vector| {
            let at = host.locate(*x).unwrap_or_else(|outside| outside.nearest);
            (at, subtract(*x, host.mesh().position(at)))
        };
        Ok(Body { name: spec.name.clone(), at: rest.iter().map(place).collect(), rest, quads })
    }

    /// Where the points are, mm, in a mesh of the same elements that is deformed.
    pub fn points(&self, deformed: &Mesh) -> Vec<Vector> {
        self.at.iter().map(|(at, off)| add_scaled(deformed.position(*at), 1.0, *off)).collect()
    }

    /// The quadrilaterals as triangles.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
    }

    /// Unit normals at points, from the quadrilaterals around them, weighted by area.
    pub fn normals(&self, points: &[Vector]) -> Vec<Vector> {
        let mut normals = vec![[0.0; 3]; points.len()];
        for quad in &self.quads {
            let [a, b, c, d] = quad.map(|point| points[point as usize]);
            let area = cross(subtract(c, a), subtract(d, b));
            for point in quad {
                normals[*point as usize] = add_scaled(normals[*point as usize], 1.0, area);
            }
        }
        // a point without area, in a collapsed face, looks anywhere
        let unit = |n: Vector| if norm(n) > 0.0 { n.map(|c| c / norm(n)) } else { [0.0, 0.0, 1.0] };
        normals.into_iter().map(unit).collect()
    }
}
