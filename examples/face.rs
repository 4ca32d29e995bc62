//! Writes the built-in face, or that of a problem file, for a look: its skin, its deep surface and its muscles as OBJ.
//!
//!     cargo run --example face -- OUT [problem.toml]
//!
//! `OUT/skin.obj` and `OUT/deep.obj` have every element face cut in 6 x 6, `OUT/<muscle>.obj` the surface of each muscle mesh,
//! `OUT/fibres.csv` a fibre direction in the middle of the outer side of each muscle element. `examples/python/face.py` makes pictures of them.

use risorius::mesh::face::{Face, boundary_faces};
use risorius::mesh::facial::{BodySide, Options, host};
use risorius::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use risorius::scene::{GeometrySpec, Scene, built_in_face};
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Parts of an edge of an element.
const PARTS: usize = 6;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("usage: face OUT [problem.toml]")?;
    let out = Path::new(&out);
    fs::create_dir_all(out)?;
    let (face, options) = match arguments.next() {
        None => (built_in_face(), Options { layers: 1, halved: false, half: false }),
        Some(problem) => match Scene::read(Path::new(&problem), &[])?.mesh.geometry {
            GeometrySpec::Face(f) => (f.face, Options { layers: f.layers, halved: f.halved, half: f.half }),
            _ => return Err("its mesh is no face".into()),
        },
    };
    let mesh = host(&face.sheet, options);
    for name in ["skin", "deep"] {
        fs::write(out.join(format!("{name}.obj")), obj(&mesh, &mesh.named_faces[name], PARTS))?;
    }
    let mut fibres = "muscle,x_mm,y_mm,z_mm,dx,dy,dz\n".to_owned();
    for course in &face.muscles {
        for side in BodySide::ALL {
            let (mesh, angles) = course.mesh(&face.sheet, side);
            let name = format!("{}.{}", course.name, side.letter());
            fs::write(out.join(format!("{name}.obj")), obj(&mesh, &boundary_faces(&mesh), 1))?;
            for element in 0..mesh.elements() {
                let (x, _) = position_and_jacobian(mesh.element, &mesh.local(element), [0.5, 0.5, 1.0]);
                let d = angles.direction(&mesh, element, &mesh.local(element), [0.5; 3]);
                writeln!(fibres, "{name},{},{},{},{},{},{}", x[0], x[1], x[2], d[0], d[1], d[2])?;
            }
        }
    }
    fs::write(out.join("fibres.csv"), fibres)?;
    Ok(())
}

/// Faces of a mesh as quadrilaterals, each cut in `parts` x `parts`.
fn obj(mesh: &Mesh, faces: &[Face], parts: usize) -> String {
    let mut text = String::new();
    let mut first = 1;
    for face in faces {
        for b in 0..=parts {
            for a in 0..=parts {
                let xi = face.side.lift([a, b].map(|k| k as f64 / parts as f64));
                let [x, y, z] = mesh.position(MaterialPoint { element: face.element, xi });
                text += &format!("v {x:.5} {y:.5} {z:.5}\n");
            }
        }
        let node = |a: usize, b: usize| first + a + (parts + 1) * b;
        for b in 0..parts {
            for a in 0..parts {
                let corners = [node(a, b), node(a + 1, b), node(a + 1, b + 1), node(a, b + 1)];
                let [p, q, r, s] = corners;
                // outwards whichever end of the element the face is
                text +=
                    &if face.side.end == 1 { format!("f {p} {q} {r} {s}\n") } else { format!("f {s} {r} {q} {p}\n") };
            }
        }
        first += (parts + 1) * (parts + 1);
    }
    text
}
