//! FAMILY of files with measured directions; to add a format: one file here and one arm in [`read`].

use super::{csv, exf, vtk};
use crate::error::{Error, Result};
use crate::math::tensor::{Vector, norm, subtract};
use crate::scene::FibreDataSpec;

/// A measured direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Where, mm.
    pub position: Vector,
    /// Along the fibre, of any length but 0; its sign says nothing.
    pub fibre: Vector,
    /// In the sheet across the fibre, where that was measured; its sign says nothing.
    pub sheet: Option<Vector>,
    /// How much it counts: the inverse of its variance, up to a factor. Positive.
    pub weight: f64,
    /// Axes with the same number are held out together: those of one trace.
    pub group: u32,
}

/// Measured directions and what was passed over.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axes {
    /// The axes.
    pub all: Vec<Axis>,
    /// Entries that say nothing: a direction of length 0, a weight of 0, a value that is not a number.
    pub empty: usize,
}

impl Axes {
    /// Adds an axis if it says something.
    pub fn add(&mut self, axis: Axis) {
        let numbers = axis.position.iter().chain(&axis.fibre).chain(axis.sheet.iter().flatten());
        let finite = numbers.chain([&axis.weight]).all(|x| x.is_finite());
        if finite && norm(axis.fibre) > 0.0 && axis.weight > 0.0 {
            let sheet = axis.sheet.filter(|sheet| norm(*sheet) > 0.0);
            self.all.push(Axis { sheet, ..axis });
        } else {
            self.empty += 1;
        }
    }

    /// Adds the pieces of a trace as axes in their middles, each with its length (in relation to 1) times `weight`.
    pub fn add_trace(&mut self, points: &[Vector], weight: f64, group: u32) {
        for pair in points.windows(2) {
            let fibre = subtract(pair[1], pair[0]);
            let position = std::array::from_fn(|i| 0.5 * (pair[0][i] + pair[1][i]));
            self.add(Axis { position, fibre, sheet: None, weight: weight * norm(fibre), group });
        }
    }

    /// Adds a diffusion tensor (xx, yy, zz, xy, yz, xz): its principal axis with its fractional anisotropy as weight.
    ///
    /// FA = sqrt(3/2) |D - tr D / 3| / |D| (Basser and Pierpaoli 1996, Eq. 10).
    pub fn add_tensor(&mut self, position: Vector, tensor: [f64; 6], weight: f64, group: u32) {
        let [xx, yy, zz, xy, yz, xz] = tensor;
        let matrix = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        if !tensor.iter().all(|x| x.is_finite()) || matrix.norm() == 0.0 {
            self.empty += 1;
            return;
        }
        let deviator = matrix - nalgebra::Matrix3::identity() * (matrix.trace() / 3.0);
        let anisotropy = (1.5_f64).sqrt() * deviator.norm() / matrix.norm();
        let fibre = principal(matrix);
        self.add(Axis { position, fibre, sheet: None, weight: weight * anisotropy, group });
    }
}

/// The unit eigenvector of the greatest eigenvalue of a symmetric matrix.
pub(super) fn principal(matrix: nalgebra::Matrix3<f64>) -> Vector {
    let eigen = matrix.symmetric_eigen();
    let v = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    [v[0], v[1], v[2]]
}

/// Reads all files; groups of different files are different, and lengths are in mm afterwards. In every file weights are
/// divided by their mean, then multiplied by the weight of the file.
///
/// # Errors
/// [`Error::Io`]; what is wrong in the files, all at once.
pub fn read(files: &[FibreDataSpec]) -> Result<Axes> {
    let mut axes = Axes::default();
    let mut mistakes = Vec::new();
    for spec in files {
        let extension = spec.file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let field = spec.field.as_deref();
        let read = match extension.as_deref() {
            Some("vtk" | "vtu" | "vtp") => vtk::read(&spec.file, field),
            Some("exf") => exf::read(&spec.file, field),
            _ => csv::read(&spec.file),
        };
        let Axes { all, empty } = match read {
            Ok(read) => read,
            Err(error @ Error::Axes { .. }) => {
                mistakes.push(Error::Named(Box::new((error, spec.place.clone()))));
                continue;
            }
            Err(error) => {
                mistakes.extend(error.into_mistakes());
                continue;
            }
        };
        axes.empty += empty;
        let first = axes.all.iter().map(|axis| axis.group + 1).max().unwrap_or(0);
        let mean = all.iter().map(|axis| axis.weight).sum::<f64>() / all.len().max(1) as f64;
        axes.all.extend(all.into_iter().map(|axis| Axis {
            position: axis.position.map(|x| x * spec.units.mm()),
            weight: axis.weight / mean * spec.weight,
            group: axis.group + first,
            ..axis
        }));
    }
    if mistakes.is_empty() { Ok(axes) } else { Err(Error::all(mistakes)) }
}
