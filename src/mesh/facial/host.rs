//! The superficial tissue of the face as a mesh: 28 x 20 tricubic Hermite elements of one or more layers, slit between the
//! lips and between the lids.

use super::grid::{self, COLUMNS, EYE_ENDS, EYE_ROW, MOUTH_END, MOUTH_ROW, ROWS, Side};
use super::sheet::{Sheet, Surface};
use crate::math::tensor::Vector;
use crate::mesh::Mesh;
use crate::mesh::element::{Element, TricubicHermite, ends};
use crate::mesh::face::{Face, Side as FaceSide, boundary_faces};
use std::collections::{BTreeMap, HashMap};

/// How the mesh of the face is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Elements through the thickness, 1 or more.
    pub layers: usize,
    /// Whether each element is cut in four along the sheet; the shape is the same.
    pub halved: bool,
    /// Only the left half, to be held by symmetry at the face `midline`.
    pub half: bool,
}

/// The names of faces that the mesh of a face has beside its sides; `midline` only a half, those in `.R` only a whole face.
pub const FACES: [&str; 22] = [
    "skin",
    "deep",
    "rim",
    "rim.skull",
    "rim.jaw",
    "midline",
    "lip.upper",
    "lip.lower",
    "lid.upper.L",
    "lid.upper.R",
    "lid.lower.L",
    "lid.lower.R",
    "deep.perioral",
    "deep.nose",
    "deep.sliding",
    "deep.perioral.skull",
    "deep.perioral.jaw",
    "deep.sliding.skull",
    "deep.sliding.jaw",
    "deep.sliding.cheek",
    "deep.eye.L",
    "deep.eye.R",
];

/// A node of a surface: X, by s, by t, by both, mm.
type Node = [Vector; 4];

/// The skin, the way from the deep surface to it, and how far both are from the middle of the thickness because the tissue is
/// round there: X = skin - (1 - w) way + margin(w) round, w from 0 deep to 1 at the skin.
#[derive(Debug, Clone, Copy)]
struct Pair {
    skin: Node,
    way: Node,
    round: Node,
}

/// All rows of nodes as seen from above and from below; they differ inside slits.
struct Rows {
    above: Vec<Vec<Pair>>,
    below: Vec<Vec<Pair>>,
}

/// Chain rule from the sheet to the grid.
fn on_grid(surface: &Surface, [u, v]: &[grid::Jet; 2]) -> Node {
    let (mut s, mut t, mut st) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for i in 0..3 {
        s[i] = surface.u[i] * u.s + surface.v[i] * v.s;
        t[i] = surface.u[i] * u.t + surface.v[i] * v.t;
        st[i] = surface.uu[i] * u.s * u.t
            + surface.uv[i] * (u.s * v.t + u.t * v.s)
            + surface.vv[i] * v.s * v.t
            + surface.u[i] * u.st
            + surface.v[i] * v.st;
    }
    [surface.value, s, t, st]
}

fn pair(sheet: &Sheet, s: usize, t: usize, side: Side) -> Pair {
    let (s, t) = (s as f64, t as f64);
    let at = grid::place(s, t, side);
    let (skin, way) = sheet.surfaces(at[0].value, at[1].value);
    let (mut skin, mut way) = (on_grid(&skin, &at), on_grid(&way, &at));
    let roll = grid::roll(s, t, side);
    for (k, by) in [roll.value, roll.s, roll.t, roll.st].into_iter().enumerate() {
        // the deep surface stays
        skin[k][2] -= by;
        way[k][2] -= by;
    }
    let round = grid::round(s, t, side);
    let round = [round.value, round.s, round.t, round.st].map(|up| [0.0, up, 0.0]);
    Pair { skin, way, round }
}

impl Pair {
    /// X and its derivative by w, with those by s, t and both.
    fn at(&self, w: f64) -> (Node, Node) {
        let of = |k: usize, skin: f64, way: f64, round: f64| -> Vector {
            std::array::from_fn(|i| skin * self.skin[k][i] + way * self.way[k][i] + round * self.round[k][i])
        };
        let [value, slope] = grid::margin(w);
        (std::array::from_fn(|k| of(k, 1.0, w - 1.0, value)), std::array::from_fn(|k| of(k, 0.0, 1.0, slope)))
    }
}

/// The node on the other half.
fn mirrored(node: Node) -> Node {
    let flip = |v: Vector, odd: bool| if odd { [v[0], -v[1], -v[2]] } else { [-v[0], v[1], v[2]] };
    [flip(node[0], false), flip(node[1], true), flip(node[2], false), flip(node[3], true)]
}

impl Rows {
    fn new(sheet: &Sheet, half: bool) -> Rows {
        let row = |t: usize, side: Side| {
            let left: Vec<Pair> = (0..=COLUMNS).map(|s| pair(sheet, s, t, side)).collect();
            let right = left.iter().skip(1).rev().map(|p| map(*p, mirrored));
            if half { left } else { right.chain(left.iter().copied()).collect() }
        };
        Rows {
            above: (0..=ROWS).map(|t| row(t, Side::Above)).collect(),
            below: (0..=ROWS).map(|t| row(t, Side::Below)).collect(),
        }
    }

    /// The same surfaces on a grid twice as fine: a node between two others has the value and derivatives of the cubic
    /// through them, and derivatives are per half the step.
    fn halved(self) -> Rows {
        let columns = |row: Vec<Pair>| -> Vec<Pair> {
            let mut fine = Vec::with_capacity(2 * row.len() - 1);
            for (k, p) in row.iter().enumerate() {
                fine.push(map(*p, |n| [n[0], n[1].map(|x| 0.5 * x), n[2], n[3].map(|x| 0.5 * x)]));
                if let Some(next) = row.get(k + 1) {
                    fine.push(between(*p, *next, [0, 1], [2, 3]));
                }
            }
            fine
        };
        let above: Vec<Vec<Pair>> = self.above.into_iter().map(columns).collect();
        let below: Vec<Vec<Pair>> = self.below.into_iter().map(columns).collect();
        let own = |p: &Pair| map(*p, |n| [n[0], n[1], n[2].map(|x| 0.5 * x), n[3].map(|x| 0.5 * x)]);
        let mut fine = Rows { above: Vec::new(), below: Vec::new() };
        for t in 0..above.len() {
            fine.above.push(above[t].iter().map(own).collect());
            fine.below.push(below[t].iter().map(own).collect());
            if t + 1 < above.len() {
                let row: Vec<Pair> =
                    above[t].iter().zip(&below[t + 1]).map(|(a, b)| between(*a, *b, [0, 2], [1, 3])).collect();
                fine.above.push(row.clone());
                fine.below.push(row);
            }
        }
        fine
    }
}

fn map(pair: Pair, change: impl Fn(Node) -> Node) -> Pair {
    Pair { skin: change(pair.skin), way: change(pair.way), round: change(pair.round) }
}

/// The node halfway between two: `line` and `other` are each a parameter and its derivative along the line between them.
fn between(a: Pair, b: Pair, line: [usize; 2], other: [usize; 2]) -> Pair {
    let (h, g) = (TricubicHermite.values_1d(0.5), TricubicHermite.slopes_1d(0.5));
    let node = |a: Node, b: Node| {
        let mut middle = [[0.0; 3]; 4];
        for [value, slope] in [line, other] {
            for i in 0..3 {
                let ends = [a[value][i], a[slope][i], b[value][i], b[slope][i]];
                middle[value][i] = (0..4).map(|k| h[k] * ends[k]).sum();
                middle[slope][i] = (0..4).map(|k| 0.5 * g[k] * ends[k]).sum();
            }
        }
        middle
    };
    Pair { skin: node(a.skin, b.skin), way: node(a.way, b.way), round: node(a.round, b.round) }
}

/// Which nodes of row `t` are double, in columns from the midline; `fine` is 2 on a halved grid.
fn in_slit(s: i64, t: usize, fine: usize) -> bool {
    let (s, fine_s) = (s.unsigned_abs() as usize, fine);
    (t == MOUTH_ROW * fine && s < MOUTH_END * fine_s)
        || (t == EYE_ROW * fine && s > EYE_ENDS[0] * fine_s && s < EYE_ENDS[1] * fine_s)
}

/// The mesh of the face. xi1 runs to the subject's left, xi2 up, xi3 outwards; elements are numbered from the right ear, row
/// by row from the chin, layer by layer from the deep surface.
pub fn host(sheet: &Sheet, options: Options) -> Mesh {
    let fine = if options.halved { 2 } else { 1 };
    let rows = Rows::new(sheet, options.half);
    let rows = if options.halved { rows.halved() } else { rows };
    let columns = rows.above[0].len() - 1;
    let first = if options.half { 0 } else { -((COLUMNS * fine) as i64) };
    let layers = options.layers;

    let mut parameters = Vec::new();
    let mut number: HashMap<(usize, usize, usize, bool), usize> = HashMap::new();
    for k in 0..=layers {
        let w = k as f64 / layers as f64;
        for t in 0..=ROWS * fine {
            for s in 0..=columns {
                let double = in_slit(first + s as i64, t, fine);
                for above in [false, true] {
                    if above && !double {
                        number.insert((k, t, s, true), number[&(k, t, s, false)]);
                        continue;
                    }
                    let pair = if above { rows.above[t][s] } else { rows.below[t][s] };
                    number.insert((k, t, s, above), parameters.len() / 8);
                    let (place, by_w) = pair.at(w);
                    parameters.extend(place);
                    parameters.extend(by_w.map(|x| x.map(|x| x / layers as f64)));
                }
            }
        }
    }

    let mut corners = Vec::new();
    let mut named: BTreeMap<String, Vec<Face>> = BTreeMap::new();
    for k in 0..layers {
        for t in 0..ROWS * fine {
            for s in 0..columns {
                let element = corners.len();
                corners.push(std::array::from_fn(|corner| {
                    let [i, j, l] = ends(corner);
                    number[&(k + l, t + j, s + i, j == 0)]
                }));
                let column = first + s as i64;
                for (name, side) in names(column, t, k, fine, options) {
                    named.entry(name).or_default().push(Face { element, side });
                }
            }
        }
    }
    let mut mesh = Mesh::new(&TricubicHermite, parameters, corners);
    for face in boundary_faces(&mesh) {
        named.entry(face.side.to_string()).or_default().push(face);
    }
    mesh.named_faces = named;
    mesh
}

/// The names of the sides of an element between columns `s` and `s + 1` (negative on the right), rows `t` and `t + 1`.
fn names(s: i64, t: usize, layer: usize, fine: usize, options: Options) -> Vec<(String, FaceSide)> {
    let side = |direction, end| FaceSide { direction, end };
    let (from_middle, letter) = if s < 0 { ((-s - 1) as usize, 'R') } else { (s as usize, 'L') };
    // the column and row of the element of the coarse grid that this one is a part of
    let (column, row) = (from_middle / fine, t / fine);
    let mut all: Vec<(String, FaceSide)> = Vec::new();
    let mut add = |name: &str, side: FaceSide| all.push((name.to_owned(), side));
    if layer + 1 == options.layers {
        add("skin", side(2, 1));
    }
    let eye = (EYE_ENDS[0]..EYE_ENDS[1]).contains(&column);
    if layer == 0 {
        let deep = side(2, 0);
        add("deep", deep);
        if eye && (row == EYE_ROW || row + 1 == EYE_ROW) {
            add(&format!("deep.eye.{letter}"), deep);
        } else if NOSE.0.contains(&row) && column < NOSE.1 {
            add("deep.nose", deep);
        } else {
            let perioral = PERIORAL.0.contains(&row) && column < PERIORAL.1;
            let part = if perioral { "deep.perioral" } else { "deep.sliding" };
            let cheek = !perioral && CHEEK.0.contains(&row) && column < CHEEK.1;
            let bone = if row < MOUTH_ROW { "jaw" } else { "skull" };
            add(part, deep);
            add(&format!("{part}.{}", if cheek { "cheek" } else { bone }), deep);
        }
    }
    let mut border = |side: FaceSide, bone: Option<&str>| {
        add("rim", side);
        if let Some(bone) = bone {
            add(&format!("rim.{bone}"), side);
        }
    };
    if from_middle + 1 == COLUMNS * fine {
        border(if s < 0 { side(0, 0) } else { side(0, 1) }, (row >= MOUTH_ROW).then_some("skull"));
    }
    if t == 0 {
        border(side(1, 0), (column < CHIN_END).then_some("jaw"));
    }
    if t + 1 == ROWS * fine {
        border(side(1, 1), Some("skull"));
    }
    if options.half && s == 0 {
        add("midline", side(0, 0));
    }
    if column < MOUTH_END {
        if t == MOUTH_ROW * fine {
            add("lip.upper", side(1, 0));
        }
        if t + 1 == MOUTH_ROW * fine {
            add("lip.lower", side(1, 1));
        }
    }
    if eye {
        if t == EYE_ROW * fine {
            add(&format!("lid.upper.{letter}"), side(1, 0));
        }
        if t + 1 == EYE_ROW * fine {
            add(&format!("lid.lower.{letter}"), side(1, 1));
        }
    }
    all
}

/// Rows and columns (from the midline) of the tissue on bone and cartilage of the nose, with the base of the upper lip.
const NOSE: (std::ops::Range<usize>, usize) = (8..14, 3);
/// Rows and columns (from the midline) of the tissue that lies on teeth and jaws: from the chin to below the base of the nose.
const PERIORAL: (std::ops::Range<usize>, usize) = (2..8, 5);
/// Rows and columns (from the midline) of the tissue between the jaws, which lies on the mucosa and on no bone: where a jaw that
/// opens turns away from the skull.
const CHEEK: (std::ops::Range<usize>, usize) = (4..8, 10);
/// Columns of the lower border below the chin and the body of the jaw, from the midline.
const CHIN_END: usize = 8;
