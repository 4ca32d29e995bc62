//! Fibre angles as a field of an EX file: coordinate system `fibre`, trilinear or tricubic Hermite, in radians.

use super::LABELS;
use crate::mesh::Mesh;
use crate::mesh::fibre_angles::FibreAngles;
use std::collections::HashMap;
use std::fmt::Write;

/// The names of the components.
const COMPONENTS: [&str; 3] = ["fibre angle", "imbrication angle", "sheet angle"];

/// The value at a corner and, of a tricubic field, the derivatives there.
type Corner = Vec<[f64; 3]>;

/// The text that adds the field `name` to what [`write_mesh`](super::write_mesh) wrote of the same mesh; it follows that
/// text. A node at which elements have angles or derivatives of their own has a version for each. Read again, it gives the same bits.
pub fn write_angles(mesh: &Mesh, name: &str, angles: &FibreAngles) -> String {
    let labels = if angles.tricubic.is_some() { &LABELS[..] } else { &LABELS[..1] };
    let corner = |element: usize, corner: usize| -> Corner {
        match &angles.tricubic {
            Some(locals) => locals[element][8 * corner..8 * corner + 8].to_vec(),
            None => vec![angles.at_corners(mesh, element)[corner]],
        }
    };
    let mut versions: Vec<Vec<Corner>> = match angles.tricubic {
        Some(_) => vec![Vec::new(); mesh.nodes],
        None => angles.nodes.iter().map(|node| vec![vec![*node]]).collect(),
    };
    for (element, corners) in mesh.corners.iter().enumerate() {
        for (k, node) in corners.iter().enumerate() {
            version(&mut versions[*node], corner(element, k));
        }
    }
    let mut text = write_nodes(name, labels, &versions);
    text.push_str("!#mesh mesh3d, dimension=3, nodeset=nodes\n");
    let mut templates: HashMap<String, usize> = HashMap::new();
    for (element, corners) in mesh.corners.iter().enumerate() {
        let mut nodes: Vec<usize> = Vec::new();
        let mut map = String::new();
        for (k, node) in corners.iter().enumerate() {
            let local = nodes.iter().position(|known| known == node).unwrap_or_else(|| {
                nodes.push(*node);
                nodes.len() - 1
            });
            let of_version = match version(&mut versions[*node], corner(element, k)) {
                0 => labels.join(" "),
                number => labels.iter().map(|label| format!("{label}({})", number + 1)).collect::<Vec<_>>().join(" "),
            };
            put(&mut map, format!("  {}. #Values={}\n   Value labels: {of_version}\n", local + 1, labels.len()));
        }
        let mut header = format!("#Scale factor sets=0\n#Nodes={}\n#Fields=1\n", nodes.len()) + &field_line(name);
        let basis = [if labels.len() == 8 { "c.Hermite" } else { "l.Lagrange" }; 3].join("*");
        for component in COMPONENTS {
            put(
                &mut header,
                format!(" {component}. {basis}, no modify, standard node based.\n  #Nodes={}\n{map}", nodes.len()),
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

fn write_nodes(name: &str, labels: &[&str], versions: &[Vec<Corner>]) -> String {
    let mut text = String::from("!#nodeset nodes\n");
    // a template is defined once: the count of versions of each
    let mut defined: Vec<usize> = Vec::new();
    let mut current = 0;
    for (node, values) in versions.iter().enumerate().filter(|(_, values)| !values.is_empty()) {
        if values.len() != current {
            current = values.len();
            if !defined.contains(&current) {
                defined.push(current);
                let of_label =
                    |label: &&str| if current > 1 { format!("{label}({current})") } else { label.to_string() };
                let list = labels.iter().map(of_label).collect::<Vec<_>>().join(",");
                let count = current * labels.len();
                put(&mut text, format!("Define node template: {name}{current}\nShape. Dimension=0\n#Fields=1\n"));
                put(&mut text, field_line(name));
                COMPONENTS
                    .iter()
                    .for_each(|component| put(&mut text, format!(" {component}. #Values={count} ({list})\n")));
            }
            put(&mut text, format!("Node template: {name}{current}\n"));
        }
        put(&mut text, format!("Node: {}\n", node + 1));
        for component in 0..3 {
            // versions of a label follow each other
            for label in 0..labels.len() {
                values.iter().for_each(|value| put(&mut text, format!(" {:?}", value[label][component])));
            }
            text.push('\n');
        }
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

/// The place of a corner among the versions of its node, to which it is added if it is not there.
fn version(versions: &mut Vec<Corner>, corner: Corner) -> usize {
    versions.iter().position(|known| *known == corner).unwrap_or_else(|| {
        versions.push(corner);
        versions.len() - 1
    })
}
