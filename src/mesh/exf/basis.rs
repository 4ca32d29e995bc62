//! The bases of EX files, and how their parameters give those of a cubic Hermite element.

/// A basis along one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Basis1d {
    Linear,
    Quadratic,
    CubicLagrange,
    CubicHermite,
}

/// A tensor-product basis on the cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Basis(pub [Basis1d; 3]);

impl std::fmt::Display for Basis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b, c] = self.0.map(Basis1d::word);
        write!(f, "{a}*{b}*{c}")
    }
}

impl Basis1d {
    /// As files have it.
    fn word(self) -> &'static str {
        match self {
            Basis1d::Linear => "l.Lagrange",
            Basis1d::Quadratic => "q.Lagrange",
            Basis1d::CubicLagrange => "c.Lagrange",
            Basis1d::CubicHermite => "c.Hermite",
        }
    }

    fn functions(self) -> usize {
        match self {
            Basis1d::Linear => 2,
            Basis1d::Quadratic => 3,
            Basis1d::CubicLagrange | Basis1d::CubicHermite => 4,
        }
    }

    /// Parameters of one node: value, or value and derivative.
    fn per_node(self) -> usize {
        if self == Basis1d::CubicHermite { 2 } else { 1 }
    }

    /// Row r: the weights of this basis' parameters in the cubic Hermite parameter r of (v0, d0, v1, d1).
    ///
    /// Linear: d0 = d1 = v1 - v0. Quadratic, with the value m at 1/2: d0 = -3 v0 + 4 m - v1, d1 = v0 - 4 m + 3 v1.
    /// Cubic Lagrange, with values p, q at 1/3, 2/3: d0 = (-11 v0 + 18 p - 9 q + 2 v1) / 2,
    /// d1 = (-2 v0 + 9 p - 18 q + 11 v1) / 2.
    fn hermite_rows(self) -> [[f64; 4]; 4] {
        match self {
            Basis1d::Linear => {
                [[1.0, 0.0, 0.0, 0.0], [-1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 1.0, 0.0, 0.0]]
            }
            Basis1d::Quadratic => {
                [[1.0, 0.0, 0.0, 0.0], [-3.0, 4.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, -4.0, 3.0, 0.0]]
            }
            Basis1d::CubicLagrange => {
                [[1.0, 0.0, 0.0, 0.0], [-5.5, 9.0, -4.5, 1.0], [0.0, 0.0, 0.0, 1.0], [-1.0, 4.5, -9.0, 5.5]]
            }
            Basis1d::CubicHermite => {
                [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
            }
        }
    }
}

impl Basis {
    /// From its description, for example `l.Lagrange*c.Hermite*c.Hermite`.
    pub fn parse(text: &str) -> Option<Basis> {
        let mut words = text.split('*').map(|word| match word.trim() {
            "l.Lagrange" => Some(Basis1d::Linear),
            "q.Lagrange" => Some(Basis1d::Quadratic),
            "c.Lagrange" => Some(Basis1d::CubicLagrange),
            "c.Hermite" => Some(Basis1d::CubicHermite),
            _ => None,
        });
        let basis = [words.next()??, words.next()??, words.next()??];
        words.next().is_none().then_some(Basis(basis))
    }

    /// Whether it is linear in all directions.
    pub fn is_trilinear(self) -> bool {
        self.0 == [Basis1d::Linear; 3]
    }

    /// Whether it is cubic Hermite in all directions.
    pub fn is_tricubic_hermite(self) -> bool {
        self.0 == [Basis1d::CubicHermite; 3]
    }

    /// The number of its functions.
    pub fn functions(self) -> usize {
        self.0.iter().map(|basis| basis.functions()).product()
    }

    /// The number of its nodes along each direction.
    pub fn nodes(self) -> [usize; 3] {
        self.0.map(|basis| basis.functions() / basis.per_node())
    }

    /// The function that is the value at a node (nodes with xi1 fastest).
    pub fn value_at(self, node: usize) -> usize {
        node * self.0.iter().map(|basis| basis.per_node()).product::<usize>()
    }

    /// For function `f` in the order of EX files (nodes with xi1 fastest, within a node derivatives with xi1 fastest), the
    /// index of its 1-D factor in each direction.
    fn factors(self, f: usize) -> [usize; 3] {
        let per_node = self.0.map(Basis1d::per_node);
        let nodes = self.nodes();
        let at_node: usize = per_node.iter().product();
        let (mut node, mut derivative) = (f / at_node, f % at_node);
        std::array::from_fn(|d| {
            let factor = node % nodes[d] * per_node[d] + derivative % per_node[d];
            (node, derivative) = (node / nodes[d], derivative / per_node[d]);
            factor
        })
    }

    /// The parameters of the tricubic Hermite element that is the same polynomial: for each of its 64 parameters, the
    /// functions of this basis that enter and their weights (none of them 0).
    pub fn hermite_weights(self) -> Vec<Vec<(usize, f64)>> {
        let rows = self.0.map(Basis1d::hermite_rows);
        let factors: Vec<[usize; 3]> = (0..self.functions()).map(|f| self.factors(f)).collect();
        let weights = |a: usize| {
            let (node, derivative) = (a / 8, a % 8);
            let row = |d: usize| rows[d][2 * (node >> d & 1) + (derivative >> d & 1)];
            let weight = |factors: &[usize; 3]| (0..3).map(|d| row(d)[factors[d]]).product::<f64>();
            let all = factors.iter().map(weight).enumerate();
            all.filter(|(_, weight)| *weight != 0.0).collect()
        };
        (0..64).map(weights).collect()
    }
}
