//! Writing EX files, version 3: any mesh with any fields on its map, and points with values.

use super::LABELS;
use crate::math::tensor::Vector;
use crate::mesh::Mesh;
use crate::mesh::map::Term;
use std::collections::HashMap;

/// Values on points: name, then one value per point.
#[derive(Debug, Clone, Copy)]
pub enum Points<'a> {
    /// Vectors in rectangular cartesian coordinates.
    Vectors(&'a str, &'a [Vector]),
    /// Numbers.
    Scalars(&'a str, &'a [f64]),
}

/// The text of an EX file with a mesh and fields on it, each with its name and its global parameters. Nodes and elements
/// are numbered from 1 in the order of the mesh. Read again, it gives the same element parameters to the last bit.
pub fn write_mesh(mesh: &Mesh, fields: &[(&str, &[Vector])]) -> String {
    let names: Vec<&str> = fields.iter().map(|(name, _)| *name).collect();
    write_mesh_with(mesh, fields, &write_elements(mesh, &names))
}

/// The same with the elements as [`write_elements`] wrote them for fields of these names: no value stands in them.
pub fn write_mesh_with(mesh: &Mesh, fields: &[(&str, &[Vector])], elements: &str) -> String {
    let mut text = String::from("EX Version: 3\nRegion: /\n");
    write_nodes(&mut text, mesh, fields, &versions(mesh));
    text + elements
}

/// The text of a region of data points with values on them; it may follow that of a mesh. The path starts with `/`.
pub fn write_points(path: &str, fields: &[Points]) -> String {
    let mut text =
        format!("Region: {path}\n!#nodeset datapoints\nDefine node template: points\nShape. Dimension=0\n");
    put(&mut text, &format!("#Fields={}\n", fields.len()));
    let mut count = usize::MAX;
    for (number, field) in fields.iter().enumerate() {
        match field {
            Points::Vectors(name, values) => {
                count = count.min(values.len());
                put(&mut text, &field_line(number, name));
                ["x", "y", "z"]
                    .iter()
                    .for_each(|component| put(&mut text, &format!(" {component}. #Values=1 (value)\n")));
            }
            Points::Scalars(name, values) => {
                count = count.min(values.len());
                let number = number + 1;
                put(&mut text, &format!("{number}) {name}, field, rectangular cartesian, real, #Components=1\n"));
                put(&mut text, " 1. #Values=1 (value)\n");
            }
        }
    }
    put(&mut text, "Node template: points\n");
    for point in 0..if fields.is_empty() { 0 } else { count } {
        put(&mut text, &format!("Node: {}\n", point + 1));
        for field in fields {
            match field {
                Points::Vectors(_, values) => values[point].iter().for_each(|value| put_number(&mut text, *value)),
                Points::Scalars(_, values) => put_number(&mut text, values[point]),
            }
        }
        text.push('\n');
    }
    text
}

fn put(text: &mut String, more: &str) {
    text.push_str(more);
}

/// A number with the fewest digits that give the same bits again.
fn put_number(text: &mut String, value: f64) {
    text.push(' ');
    text.push_str(ryu::Buffer::new().format(value));
}

fn field_line(index: usize, name: &str) -> String {
    format!("{}) {name}, coordinate, rectangular cartesian, real, #Components=3\n", index + 1)
}

/// The version (from 1) of each global parameter among those of the same node and derivative.
fn versions(mesh: &Mesh) -> Vec<usize> {
    let mut count: HashMap<(usize, u8), usize> = HashMap::new();
    let keys = mesh.parameter_node.iter().zip(&mesh.parameter_derivative);
    keys.map(|(node, derivative)| {
        let version = count.entry((*node, *derivative)).or_default();
        *version += 1;
        *version
    })
    .collect()
}

fn write_nodes(text: &mut String, mesh: &Mesh, fields: &[(&str, &[Vector])], versions: &[usize]) {
    put(text, "!#nodeset nodes\n");
    let mut of_node: Vec<Vec<usize>> = vec![Vec::new(); mesh.nodes];
    (0..mesh.parameters.len()).for_each(|parameter| of_node[mesh.parameter_node[parameter]].push(parameter));
    let mut templates: HashMap<String, usize> = HashMap::new();
    let mut current = None;
    for (node, parameters) in of_node.iter_mut().enumerate() {
        // versions of a label follow each other
        parameters.sort_by_key(|parameter| (mesh.parameter_derivative[*parameter], versions[*parameter]));
        let groups = parameters.chunk_by(|a, b| mesh.parameter_derivative[*a] == mesh.parameter_derivative[*b]);
        let labels = groups.map(|group| {
            let label = LABELS[usize::from(mesh.parameter_derivative[group[0]])];
            if group.len() > 1 { format!("{label}({})", group.len()) } else { label.to_string() }
        });
        let list = format!("#Values={} ({})", parameters.len(), labels.collect::<Vec<_>>().join(","));
        let next = templates.len() + 1;
        let template = *templates.entry(list.clone()).or_insert_with(|| {
            put(text, &format!("Define node template: node{next}\nShape. Dimension=0\n#Fields={}\n", fields.len()));
            for (index, (name, _)) in fields.iter().enumerate() {
                put(text, &field_line(index, name));
                ["x", "y", "z"].iter().for_each(|component| put(text, &format!(" {component}. {list}\n")));
            }
            next
        });
        if current.replace(template) != Some(template) {
            put(text, &format!("Node template: node{template}\n"));
        }
        put(text, &format!("Node: {}\n", node + 1));
        for (_, values) in fields {
            for component in 0..3 {
                parameters.iter().for_each(|parameter| put_number(text, values[*parameter][component]));
                text.push('\n');
            }
        }
    }
}

/// The elements of an EX file with fields of these names.
pub fn write_elements(mesh: &Mesh, fields: &[&str]) -> String {
    let (mut all, versions) = (String::new(), versions(mesh));
    let text = &mut all;
    put(text, "!#mesh mesh3d, dimension=3, nodeset=nodes\n");
    let mut templates: HashMap<String, usize> = HashMap::new();
    let mut current = None;
    for element in 0..mesh.elements() {
        let local = LocalElement::new(mesh, element, &versions);
        let header = local.header(mesh, fields);
        let next = templates.len() + 1;
        let template = *templates.entry(header.clone()).or_insert_with(|| {
            put(
                text,
                &format!("Define element template: element{next}\nShape. Dimension=3, line*line*line\n{header}"),
            );
            next
        });
        if current.replace(template) != Some(template) {
            put(text, &format!("Element template: element{template}\n"));
        }
        put(text, &format!("Element: {}\n Nodes:\n", element + 1));
        local.nodes.iter().for_each(|node| put(text, &format!(" {}", node + 1)));
        text.push('\n');
        if !local.scales.is_empty() {
            put(text, " Scale factors:\n");
            local.scales.iter().for_each(|scale| put_number(text, *scale));
            text.push('\n');
        }
    }
    all
}

/// An element in its own numbering.
struct LocalElement {
    /// Its nodes: the corners, then others whose parameters it uses; none twice.
    nodes: Vec<usize>,
    /// Its scale factors other than 1; none twice.
    scales: Vec<f64>,
    /// The maps of all functions as the lines of a component.
    map: String,
}

impl LocalElement {
    fn new(mesh: &Mesh, element: usize, versions: &[usize]) -> LocalElement {
        let mut local = LocalElement { nodes: Vec::new(), scales: Vec::new(), map: String::new() };
        for node in mesh.corners[element] {
            position(&mut local.nodes, node, |a, b| a == b);
        }
        // nodes, labels and scale factor indices of each function, each joined by `+`
        let functions: Vec<[String; 3]> = (0..mesh.element.functions())
            .map(|a| local.function(mesh, mesh.map.terms(element, a), versions))
            .collect();
        for group in functions.chunk_by(|a, b| a[0] == b[0]) {
            let column =
                |index: usize| group.iter().map(|function| function[index].as_str()).collect::<Vec<_>>().join(" ");
            put(
                &mut local.map,
                &format!("  {}. #Values={}\n   Value labels: {}\n", group[0][0], group.len(), column(1)),
            );
            if !local.scales.is_empty() {
                put(&mut local.map, &format!("   Scale factor indices: {}\n", column(2)));
            }
        }
        local
    }

    fn function(&mut self, mesh: &Mesh, terms: &[Term], versions: &[usize]) -> [String; 3] {
        if terms.is_empty() {
            return ["0", "zero", "0"].map(String::from);
        }
        let mut columns: [Vec<String>; 3] = Default::default();
        for term in terms {
            let global = term.global as usize;
            let node = position(&mut self.nodes, mesh.parameter_node[global], |a, b| a == b);
            let label = LABELS[usize::from(mesh.parameter_derivative[global])];
            let scale = match term.scale {
                1.0 => 0,
                scale => 1 + position(&mut self.scales, scale, |a, b| a.to_bits() == b.to_bits()),
            };
            columns[0].push((node + 1).to_string());
            columns[1].push(match versions[global] {
                1 => label.to_string(),
                version => format!("{label}({version})"),
            });
            columns[2].push(scale.to_string());
        }
        columns.map(|column| column.join("+"))
    }

    fn header(&self, mesh: &Mesh, fields: &[&str]) -> String {
        let (mut header, mut set) = (String::from("#Scale factor sets=0\n"), "");
        if !self.scales.is_empty() {
            let count = self.scales.len();
            // of an element's own scale factors every identifier is 0
            let identifiers = vec!["0"; count].join(",");
            header = "#Scale factor sets=1\n".into();
            put(
                &mut header,
                &format!("  scaling1, #Scale factors={count}, identifiers=\"element_general({identifiers})\"\n"),
            );
            set = " scale factor set=scaling1";
        }
        put(&mut header, &format!("#Nodes={}\n#Fields={}\n", self.nodes.len(), fields.len()));
        let basis =
            if mesh.element.parameters_per_node() == 8 { ["c.Hermite"; 3] } else { ["l.Lagrange"; 3] }.join("*");
        for (index, name) in fields.iter().enumerate() {
            put(&mut header, &field_line(index, name));
            for component in ["x", "y", "z"] {
                put(&mut header, &format!(" {component}. {basis}, no modify, standard node based.{set}\n"));
                put(&mut header, &format!("  #Nodes={}\n{}", self.nodes.len(), self.map));
            }
        }
        header
    }
}

/// The position of a value in a list to which it is added if it is not there.
fn position<T: Copy>(list: &mut Vec<T>, value: T, same: impl Fn(&T, &T) -> bool) -> usize {
    list.iter().position(|known| same(known, &value)).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}
