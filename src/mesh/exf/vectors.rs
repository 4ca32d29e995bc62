//! Vectors at the nodes and data points of an EX file.

use super::file::ExFile;
use super::nodes::{Node, NodeField};
use crate::math::tensor::Vector;
use std::collections::BTreeSet;

/// The field that says where a node is.
const POSITION: &str = "coordinates";

/// The values of a field of three components at a node, without derivatives.
fn values(field: &NodeField) -> Option<Vector> {
    let value = |component: &Vec<super::nodes::Parameter>| component.iter().find(|p| p.label == 0).map(|p| p.value);
    match &field[..] {
        [x, y, z] => Some([value(x)?, value(y)?, value(z)?]),
        _ => None,
    }
}

impl ExFile {
    fn all_nodes(&self) -> impl Iterator<Item = &Node> {
        self.regions.iter().flat_map(|region| region.points.values().chain(region.nodes.values()))
    }

    /// The names of the fields of three components that nodes or data points have beside `coordinates`.
    pub fn vector_fields(&self) -> Vec<String> {
        let has = |node: &&Node| node.get(POSITION).and_then(values).is_some();
        let fields = self.all_nodes().filter(has).flat_map(|node| node.iter());
        let names: BTreeSet<&String> = fields
            .filter(|(name, field)| *name != POSITION && values(field).is_some())
            .map(|(name, _)| name)
            .collect();
        names.into_iter().cloned().collect()
    }

    /// Position and vector of every data point, then of every node, that has `coordinates` and the field.
    pub fn vectors(&self, field: &str) -> Vec<(Vector, Vector)> {
        let pair = |node: &Node| Some((values(node.get(POSITION)?)?, values(node.get(field)?)?));
        self.all_nodes().filter_map(pair).collect()
    }
}
