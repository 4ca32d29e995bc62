//! A field of coordinates evaluated as its file means it, whatever its coordinate system, bases and maps.

use super::file::ExFile;
use super::jet::Jet;
use super::sums::{FieldInElement, unsupported};
use super::system::System;
use crate::error::Result;
use crate::math::tensor::{Matrix, Vector};
use crate::mesh::element::TricubicHermite;
use crate::mesh::position_and_jacobian;

/// Coordinates in the elements of a file. They are interpolated in the system of the file, each component on a map and a
/// basis of its own, and then converted to rectangular cartesian coordinates, so there is nothing fitted in them.
#[derive(Debug, Clone)]
pub struct Coordinates {
    /// The identifier of each element.
    pub elements: Vec<i64>,
    system: System,
    /// Per element and component, the parameters of the tricubic Hermite that is the same polynomial.
    locals: Vec<[[f64; 64]; 3]>,
}

impl ExFile {
    /// The field of coordinates `field`; which it is without a name, says [`ExFile::geometry`].
    ///
    /// # Errors
    /// Those of [`ExFile::geometry`].
    pub fn coordinates(&self, field: Option<&str>) -> Result<Coordinates> {
        let (region, field) = self.choose(field)?;
        let elements = self.field_in_elements(&self.regions[region], &field);
        let system = match elements.first() {
            Some(first) => self.system(first, &field)?,
            None => System::RectangularCartesian,
        };
        let mut all = Coordinates { elements: Vec::new(), system, locals: Vec::new() };
        for element in &elements {
            if self.system(element, &field)? != system {
                let construct = format!("field `{field}` in several systems of coordinates");
                return Err(unsupported(
                    construct,
                    "give the field one system in all elements",
                    &element.element.place,
                ));
            }
            let mut local = [[0.0; 64]; 3];
            for (index, local) in local.iter_mut().enumerate() {
                *local = self.local(region, element, &field, index)?;
            }
            all.locals.push(local);
            all.elements.push(element.element.identifier);
        }
        Ok(all)
    }

    /// The tricubic Hermite parameters of one component of an element in the system of the file.
    fn local(&self, region: usize, element: &FieldInElement, field: &str, index: usize) -> Result<[f64; 64]> {
        let region = &self.regions[region];
        let basis = self.basis(element, index)?;
        let mut values = Vec::with_capacity(basis.functions());
        for sum in self.sums(region, element, field, index)? {
            let mut value = 0.0;
            for (key, scale) in sum {
                value += scale * self.value(region, field, index, key)?;
            }
            values.push(value);
        }
        if let Some(unwind) = element.components[index].unwind {
            let count = basis.nodes();
            let at: Vec<usize> = (0..count.iter().product()).map(|node| basis.value_at(node)).collect();
            let mut angles: Vec<f64> = at.iter().map(|f| values[*f]).collect();
            unwind.apply(&mut angles, count);
            at.iter().zip(angles).for_each(|(f, angle)| values[*f] = angle);
        }
        let mut local = [0.0; 64];
        for (local, weights) in local.iter_mut().zip(basis.hermite_weights()) {
            *local = weights.iter().map(|(function, weight)| weight * values[*function]).sum();
        }
        Ok(local)
    }
}

impl Coordinates {
    /// Position at xi of the element with this index, mm.
    pub fn position(&self, element: usize, xi: [f64; 3]) -> Vector {
        self.at(element, xi).map(|x| x.0[0])
    }

    /// dx/dxi at xi of the element with this index: `jacobian[i][d]` = dx_i/dxi_d, mm.
    pub fn jacobian(&self, element: usize, xi: [f64; 3]) -> Matrix {
        self.at(element, xi).map(|x| [x.0[1], x.0[2], x.0[4]])
    }

    /// Values and first derivatives.
    fn at(&self, element: usize, xi: [f64; 3]) -> [Jet; 3] {
        let (values, slopes) = position_and_jacobian(&TricubicHermite, &self.locals[element], xi);
        let jet = |c: usize| Jet([values[c], slopes[c][0], slopes[c][1], 0.0, slopes[c][2], 0.0, 0.0, 0.0]);
        self.system.cartesian([jet(0), jet(1), jet(2)])
    }

    /// The tricubic Hermite parameters in x, y, z that have the values and all derivatives of an element at its corners.
    pub(super) fn hermite(&self, element: usize) -> [[f64; 64]; 3] {
        let mut local = [[0.0; 64]; 3];
        for corner in 0..8 {
            let jet = |c: usize| Jet(std::array::from_fn(|m| self.locals[element][c][8 * corner + m]));
            let x = self.system.cartesian([jet(0), jet(1), jet(2)]);
            for (local, x) in local.iter_mut().zip(x) {
                local[8 * corner..8 * corner + 8].copy_from_slice(&x.0);
            }
        }
        local
    }

    /// The conversion of all derivatives at a point from the system of the file.
    pub(super) fn cartesian(&self, at: [Jet; 3]) -> [Jet; 3] {
        self.system.cartesian(at)
    }
}
