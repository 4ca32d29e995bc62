//! 3-vectors and 3x3 matrices as plain arrays, row first: `m[i][j]`.

/// A vector of three components.
pub type Vector = [f64; 3];
/// A 3x3 matrix, `m[row][column]`.
pub type Matrix = [[f64; 3]; 3];

/// The unit matrix.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// a . b
#[inline(always)]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a x b
#[inline(always)]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|
#[inline(always)]
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// a - b
#[inline(always)]
pub fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + s b
#[inline(always)]
pub fn add_scaled(a: Vector, s: f64, b: Vector) -> Vector {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// a / |a|; the zero vector gives NaN.
#[inline(always)]
pub fn normalised(a: Vector) -> Vector {
    let length = norm(a);
    [a[0] / length, a[1] / length, a[2] / length]
}

/// m v
#[inline(always)]
pub fn apply(m: &Matrix, v: Vector) -> Vector {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// m^T v
#[inline(always)]
pub fn apply_transposed(m: &Matrix, v: Vector) -> Vector {
    std::array::from_fn(|j| m[0][j] * v[0] + m[1][j] * v[1] + m[2][j] * v[2])
}

/// det m
#[inline(always)]
pub fn determinant(m: &Matrix) -> f64 {
    dot(m[0], cross(m[1], m[2]))
}

/// The inverse of a matrix with determinant `det`, which must not be zero.
#[inline(always)]
pub fn inverse(m: &Matrix, det: f64) -> Matrix {
    // the columns of the inverse are the cross products of the rows, over the determinant
    let (a, b, c) = (cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]));
    std::array::from_fn(|i| [a[i] / det, b[i] / det, c[i] / det])
}

/// The rotation by `angle` (radians) about the unit vector `axis`:
/// R = cos(angle) I + sin(angle) axis x I + (1 - cos(angle)) axis axis^T  (Rodrigues).
pub fn rotation(axis: Vector, angle: f64) -> Matrix {
    let (sine, cosine) = angle.sin_cos();
    let [x, y, z] = axis;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| cosine * IDENTITY[i][j] + sine * skew[i][j] + (1.0 - cosine) * axis[i] * axis[j])
    })
}
