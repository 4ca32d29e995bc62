//! Fibre angles as a field of an EX file: coordinate system `fibre`, trilinear, in radians.

use crate::mesh::Mesh;
use crate::mesh::fibre_angles::FibreAngles;
use std::collections::HashMap;
use std::fmt::Write;

/// The names of the components.
const COMPONENTS: [&str; 3] = ["fibre angle", "imbrication angle", "sheet angle"];

/// The text that adds the field `name` to what [`write_mesh`](super::write_mesh) wrote of the same mesh; it follows that
/// text. A node at which elements have angles of their own has a version for each. Read again, it gives the same bits.
pub fn write_angles(mesh: &Mesh, name: &str, angles: &FibreAngles) -> String {
    let mut versions: Vec<Vec<[f64; 3]>> = angles.nodes.iter().map(|node| vec![*node]).collect();
    for (element, corners) in &angles.own {
        for (node, corner) in mesh.corners[*element].iter().zip(corners) {
            version(&mut versions[*node], corner);
        }
    }
    let mut text = String::from("!#nodeset nodes\n");
    // a template is defined once: the count of versions of each
    let mut defined: Vec<usize> = Vec::new();
    let mut current = 0;
    for (node, values) in versions.iter().enumerate() {
        if values.len() != current {
            current = values.len();
            if !defined.contains(&current) {
                defined.push(current);
                let labels = if current > 1 { format!("value({current})") } else { "value".into() };
                put(&mut text, format!("Define node template: {name}{current}\nShape. Dimension=0\n#Fields=1\n"));
                put(&mut text, field_line(name));
                COMPONENTS
                    .iter()
                    .for_each(|component| put(&mut text, format!(" {component}. #Values={current} ({labels})\n")));
            }
            put(&mut text, format!("Node template: {name}{current}\n"));
        }
        put(&mut text, format!("Node: {}\n", node + 1));
        for component in 0..3 {
            values.iter().for_each(|value| put(&mut text, format!(" {:?}", value[component])));
            text.push('\n');
        }
    }
    text.push_str("!#mesh mesh3d, dimension=3, nodeset=nodes\n");
    let mut templates: HashMap<String, usize> = HashMap::new();
    for element in 0..mesh.elements() {
        let mut nodes: Vec<usize> = Vec::new();
        let mut map = String::new();
        for (node, corner) in mesh.corners[element].iter().zip(angles.at_corners(mesh, element)) {
            let local = nodes.iter().position(|known| known == node).unwrap_or_else(|| {
                nodes.push(*node);
                nodes.len() - 1
            });
            let label = match version(&mut versions[*node], &corner) {
                0 => "value".to_string(),
                number => format!("value({})", number + 1),
            };
            put(&mut map, format!("  {}. #Values=1\n   Value labels: {label}\n", local + 1));
        }
        let mut header = format!("#Scale factor sets=0\n#Nodes={}\n#Fields=1\n", nodes.len()) + &field_line(name);
        for component in COMPONENTS {
            put(
                &mut header,
                format!(
                    " {component}. l.Lagrange*l.Lagrange*l.Lagrange, no modify, standard node based.\n  #Nodes={}\n{map}",
                    nodes.len()
                ),
            );
        }
        let next = templates.len() + 1;
        let template = *templates.entry(header).or_insert_with_key(|header| {
            put(
                &mut text,
                format!("Define element template: {name}{next}\nShape. Dimension=3, line*line*line\n{header}"),
            );
            next
        });
        put(&mut text, format!("Element template: {name}{template}\nElement: {}\n Nodes:\n", element + 1));
        nodes.iter().for_each(|node| put(&mut text, format!(" {}", node + 1)));
        text.push('\n');
    }
    text
}

fn put(text: &mut String, more: impl AsRef<str>) {
    // writing to a String does not fail
    let _ = text.write_str(more.as_ref());
}

fn field_line(name: &str) -> String {
    format!("1) {name}, field, fibre, real, #Components=3\n")
}

/// The place of a value among the versions of a node, to which it is added if it is not there.
fn version(versions: &mut Vec<[f64; 3]>, value: &[f64; 3]) -> usize {
    versions.iter().position(|known| known == value).unwrap_or_else(|| {
        versions.push(*value);
        versions.len() - 1
    })
}
