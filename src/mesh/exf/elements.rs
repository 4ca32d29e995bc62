//! Elements of an EX file: their header, which says how nodal parameters become element parameters, and their nodes.

use super::basis::Basis;
use super::label;
use super::lines::{Lines, number_after, starts_something};
use super::nodes::FieldLine;
use super::theta::Unwind;
use crate::error::{Place, Result};

/// Which parameter of a node is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// By label (a bit mask) and version (from 1).
    Label(u8, u32),
    /// By its index among the values of the component, from 1 (version 1 of the format).
    Index(usize),
}

/// A term of a function's parameter: nodal parameter x product of scale factors.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Term {
    /// The node, as an index (from 0) into the nodes of the element.
    pub node: usize,
    pub source: Source,
    /// Indices (from 0) into the scale factors of the element.
    pub scales: Vec<usize>,
}

/// One component of a field in an element.
#[derive(Debug, Clone)]
pub(super) struct Component {
    pub name: String,
    pub place: Place,
    /// The basis, or the words that are not understood here.
    pub basis: std::result::Result<Basis, String>,
    /// How it runs along xi1 if it is an angle that goes around.
    pub unwind: Option<Unwind>,
    /// The terms of the parameter of each function; none means that it is zero.
    pub functions: Vec<Vec<Term>>,
}

/// What the elements that follow hold.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementTemplate {
    /// The shape, if it is not a cube.
    pub other_shape: Option<String>,
    nodes: usize,
    scale_factors: usize,
    pub fields: Vec<(FieldLine, Vec<Component>)>,
}

/// An element as one template describes it.
#[derive(Debug, Clone)]
pub(super) struct Element {
    pub identifier: i64,
    /// Index of its template in the file.
    pub template: usize,
    pub nodes: Vec<i64>,
    pub scale_factors: Vec<f64>,
    pub place: Place,
}

/// A range of scale factors with a name: `scaling1, #Scale factors=2, identifiers="element_general(1..2)"`.
struct ScaleFactorSet<'a> {
    name: &'a str,
    range: std::ops::Range<usize>,
}

impl ElementTemplate {
    /// Reads a header after its line `#Scale factor sets=`.
    pub fn read(
        lines: &mut Lines,
        sets: usize,
        version: u32,
        other_shape: Option<String>,
    ) -> Result<ElementTemplate> {
        let mut scale_sets = Vec::new();
        let mut scale_factors = 0usize;
        for _ in 0..sets {
            let line = lines.take().unwrap_or_default();
            let count = number_after(line, "#Scale factors").filter(|count| (1..=1_000_000).contains(count));
            let (Some((name, _)), Some(count)) = (line.split_once(','), count) else {
                return Err(
                    lines.wrong("a set of scale factors, as in `c.Hermite*c.Hermite*c.Hermite, #Scale factors=64`")
                );
            };
            scale_sets.push(ScaleFactorSet { name: name.trim(), range: scale_factors..scale_factors + count });
            scale_factors += count;
        }
        let nodes = counted(lines, "#Nodes")?;
        let mut template = ElementTemplate { other_shape, nodes, scale_factors, fields: Vec::new() };
        for _ in 0..counted(lines, "#Fields")? {
            let field = FieldLine::read(lines)?;
            let mut components = Vec::new();
            for _ in 0..field.components {
                components.push(Component::read(lines, &field, &scale_sets, nodes, version)?);
            }
            template.fields.push((field, components));
        }
        if lines.take_after("Values").is_some() {
            lines.skip_until(starts_something);
        }
        Ok(template)
    }

    /// Reads an element after its line `Element:`.
    pub fn read_element(&self, lines: &mut Lines, identifier: i64, template: usize) -> Result<Element> {
        let place = lines.place();
        const SECTIONS: [&str; 3] = ["Values", "Nodes", "Scale factors"];
        for passed_over in ["Faces", "Values"] {
            if lines.take_after(passed_over).is_some() {
                lines.skip_until(|line| {
                    starts_something(line) || SECTIONS.iter().any(|section| line.starts_with(section))
                });
            }
        }
        let nodes = section(lines, "Nodes", self.nodes, "numbers of nodes")?;
        let scale_factors: Vec<f64> = section(lines, "Scale factors", self.scale_factors, "scale factors")?;
        if scale_factors.iter().any(|factor| !factor.is_finite()) {
            return Err(lines.wrong("finite scale factors"));
        }
        Ok(Element { identifier, template, nodes, scale_factors, place })
    }
}

/// The values of a section such as `Nodes:`; it may be absent where there are none.
fn section<T: std::str::FromStr>(lines: &mut Lines, keyword: &str, count: usize, what: &str) -> Result<Vec<T>> {
    match lines.take_after(keyword) {
        Some(rest) => lines.values(rest, count, what),
        None if count == 0 => Ok(Vec::new()),
        None => Err(lines.wrong_next(format!("`{keyword}:` with the {count} {what} of this element"))),
    }
}

/// The number of the line `<key>=<number>`.
fn counted(lines: &mut Lines, key: &str) -> Result<usize> {
    let line = lines.take().unwrap_or_default();
    number_after(line, key).ok_or_else(|| lines.wrong(format!("`{key}=` and a number")))
}

impl Component {
    /// `x. c.Hermite*c.Hermite*c.Hermite, no modify, standard node based. scale factor set=scaling1`, then `#Nodes=8` and
    /// the map of each node.
    fn read(
        lines: &mut Lines,
        field: &FieldLine,
        sets: &[ScaleFactorSet],
        nodes: usize,
        version: u32,
    ) -> Result<Component> {
        const EXPECTED: &str =
            "a component, as in `x. c.Hermite*c.Hermite*c.Hermite, no modify, standard node based.`";
        let line = lines.take().ok_or_else(|| lines.wrong_next(EXPECTED))?;
        let place = lines.place();
        let (name, rest) = line.split_once('.').ok_or_else(|| lines.wrong(EXPECTED))?;
        let name = name.trim().to_string();
        if field.in_header {
            return Ok(Component {
                name,
                place,
                basis: Err("a field that is constant".into()),
                unwind: None,
                functions: Vec::new(),
            });
        }
        let mut parts = rest.splitn(3, ',').map(str::trim);
        let (Some(basis), Some(modify), Some(map)) = (parts.next(), parts.next(), parts.next()) else {
            return Err(lines.wrong(EXPECTED));
        };
        let (map, options) = map.split_once('.').ok_or_else(|| lines.wrong(EXPECTED))?;
        let unwind = Unwind::parse(modify);
        let parsed = match (modify == "no modify" || unwind.is_some(), map) {
            (true, "standard node based" | "node based") => {
                Basis::parse(basis).ok_or_else(|| format!("the basis `{basis}`"))
            }
            (true, _) => Err(format!("a field that is `{map}`")),
            (false, _) => Err(format!("a basis with `{modify}`")),
        };
        if !map.ends_with("node based") {
            lines.skip_until(|line| !line.starts_with('#'));
            return Ok(Component { name, place, basis: parsed, unwind, functions: Vec::new() });
        }
        let set = if version < 2 {
            Some(basis)
        } else {
            options.split_once("scale factor set").map(|(_, rest)| {
                let rest = rest.trim_start_matches([' ', '=']);
                rest.split([',', ';']).next().unwrap_or(rest).trim()
            })
        };
        let scales = set.and_then(|name| sets.iter().find(|set| set.name == name)).map(|set| set.range.clone());
        if let (Some(set), None, 2..) = (set, &scales, version) {
            return Err(lines.wrong(format!("the name of a scale factor set of this header, not `{set}`")));
        }
        counted(lines, "#Nodes")?;
        let mut functions = Vec::new();
        while let Some(locals) = lines.peek().and_then(local_nodes) {
            let line = lines.take().unwrap_or_default();
            let count = number_after(line, "#Values").filter(|count| (1..=64).contains(count));
            let count = count.ok_or_else(|| lines.wrong("`#Values=` and a number from 1 to 64"))?;
            if let Some(node) = locals.iter().find(|node| **node > nodes) {
                return Err(lines.wrong(format!("a local node from 0 to #Nodes={nodes}, not {node}")));
            }
            functions.extend(read_functions(lines, &locals, count, &scales.clone().unwrap_or(0..0))?);
        }
        if let Ok(basis) = parsed
            && basis.functions() != functions.len()
        {
            let found = functions.len();
            return Err(lines.wrong_next(format!(
                "the next of the {} values of component `{name}` ({found} so far)",
                basis.functions()
            )));
        }
        Ok(Component { name, place, basis: parsed, unwind, functions })
    }
}

/// The local nodes (from 1; none for `0`) of a line such as `2+2. #Values=1`.
fn local_nodes(line: &str) -> Option<Vec<usize>> {
    let (sum, rest) = line.split_once('.')?;
    if !rest.trim_start().starts_with("#Values") {
        return None;
    }
    let nodes: Option<Vec<usize>> = sum.split('+').map(|node| node.trim().parse().ok()).collect();
    nodes.filter(|nodes| nodes.len() <= 1000 && (nodes.len() == 1 || !nodes.contains(&0)))
}

/// The terms of `count` functions: labels (or indices) and, if there are any, indices of scale factors.
fn read_functions(
    lines: &mut Lines,
    locals: &[usize],
    count: usize,
    scales: &std::ops::Range<usize>,
) -> Result<Vec<Vec<Term>>> {
    let mut functions: Vec<Vec<Term>> = Vec::with_capacity(count);
    if let Some(rest) = lines.take_after("Value indices") {
        let indices: Vec<usize> = lines.values(rest, count, "indices of values")?;
        for index in indices {
            let term = |node: &usize| Term { node: node - 1, source: Source::Index(index), scales: Vec::new() };
            let locals = locals.iter().filter(|node| **node > 0 && index > 0);
            functions.push(locals.map(term).collect());
        }
    } else if let Some(rest) = lines.take_after("Value labels") {
        for word in rest.split_whitespace() {
            let terms = labels(word, locals).ok_or_else(|| {
                lines.wrong(format!("{} labels of nodal parameters joined by `+`, not `{word}`", locals.len()))
            })?;
            functions.push(terms);
        }
        if functions.len() != count {
            return Err(lines.wrong(format!("{count} labels, not {}", functions.len())));
        }
    } else {
        return Err(lines.wrong_next("`Value labels:` or `Value indices:`"));
    }
    let Some(rest) = lines.take_after("Scale factor indices") else { return Ok(functions) };
    let words: Vec<&str> = rest.split_whitespace().collect();
    if words.len() != count {
        return Err(lines.wrong(format!("{count} indices of scale factors, not {}", words.len())));
    }
    for (function, word) in functions.iter_mut().zip(words) {
        let products: Option<Vec<Vec<usize>>> =
            word.split('+').map(|product| scale_indices(product, scales)).collect();
        let expected = || {
            let (first, last) = (scales.start + 1, scales.end);
            lines.wrong(format!("0 or scale factors {first} to {last} of this component, not `{word}`"))
        };
        let products = products.ok_or_else(expected)?;
        // a function without terms is written with the index 0
        if products.len() != function.len().max(1) {
            return Err(expected());
        }
        function.iter_mut().zip(products).for_each(|(term, scales)| term.scales = scales);
    }
    Ok(functions)
}

/// `value`, `zero`, `d/ds1(2)`, `d/ds1+d/ds3`: one label for each of the local nodes.
fn labels(word: &str, locals: &[usize]) -> Option<Vec<Term>> {
    if word == "zero" {
        return (locals.len() == 1).then(Vec::new);
    }
    let words: Vec<&str> = word.split('+').collect();
    if words.len() != locals.len() || locals.contains(&0) {
        return None;
    }
    let term = |(word, node): (&&str, &usize)| {
        let (name, version) = match word.split_once('(') {
            Some((name, version)) => (name, version.strip_suffix(')')?.parse().ok().filter(|version| *version > 0)?),
            None => (*word, 1),
        };
        Some(Term { node: node - 1, source: Source::Label(label(name)?, version), scales: Vec::new() })
    };
    words.iter().zip(locals).map(term).collect()
}

/// `0`, `7` or `7*12`: indices from 1 into the scale factors of the element, as indices from 0.
fn scale_indices(product: &str, allowed: &std::ops::Range<usize>) -> Option<Vec<usize>> {
    if product == "0" {
        return Some(Vec::new());
    }
    product
        .split('*')
        .map(|index| index.parse::<usize>().ok()?.checked_sub(1).filter(|i| allowed.contains(i)))
        .collect()
}
