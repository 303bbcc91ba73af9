//! A level function that a user writes as a formula.

use super::Vector;
use super::level::{Hessian, LevelFunction, LevelJet};
use crate::formulas::{BLOCK, Bound, Context, FormulaText, Input, NamedNumbers};
use crate::spec::Violation;

/// A level f(x) as a formula of x, y and, in space, z, with its exact derivatives.
#[derive(Debug, Clone)]
pub struct FormulaLevel<const D: usize> {
    value: Bound,
    /// f, ∇f and the second derivatives row by row, in one evaluation.
    jet: Bound,
}

impl<const D: usize> FormulaLevel<D> {
    /// A level. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// All that is wrong with the formula.
    pub fn new(level: &FormulaText, parameters: &NamedNumbers, pointer: &str) -> Result<Self, Vec<Violation>> {
        let variables: &[&str] = if D == 2 { &["x", "y"] } else { &["x", "y", "z"] };
        let value = Bound::new(&[("level".to_owned(), level)], Context { pointer, variables, parameters })?;
        let jet = value.jet(&(0..D).collect::<Vec<_>>());
        Ok(Self { value, jet })
    }
}

impl<const D: usize> LevelFunction<D> for FormulaLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        let mut value = [f64::NAN];
        self.values(&[*x], &mut value);
        value[0]
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let mut all = [f64::NAN; 13];
        let inputs: [Input<'_>; 3] = std::array::from_fn(|d| Input::Uniform(if d < D { x[d] } else { 0.0 }));
        self.jet.block(&inputs[..D], 1, |k, _, value| all[k] = value);
        LevelJet {
            value: all[0],
            gradient: Vector::<D>::from_fn(|d, _| all[1 + d]),
            hessian: Hessian::<D>::from_fn(|i, j| all[1 + D + i * D + j]),
        }
    }

    fn values(&self, points: &[Vector<D>], values: &mut [f64]) {
        for (points, values) in points.chunks(BLOCK).zip(values.chunks_mut(BLOCK)) {
            let mut columns = [[0.0; BLOCK]; 3];
            for (i, x) in points.iter().enumerate() {
                for d in 0..D {
                    columns[d][i] = x[d];
                }
            }
            let inputs: [Input<'_>; 3] = std::array::from_fn(|d| Input::Column(&columns[d][..points.len()]));
            self.value.block(&inputs[..D], points.len(), |_, i, value| values[i] = value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{FormulaLevel, LevelFunction, Vector};
    use crate::formulas::NamedNumbers;
    use crate::geometry::Surface;
    use crate::geometry::surfaces::{Ball, ImplicitSurface};
    use std::sync::Arc;

    #[test]
    fn a_jet_has_the_exact_derivatives() {
        let level = FormulaLevel::<2>::new(&"x^3*y - sin(y)".into(), &NamedNumbers::default(), "/shape").unwrap();
        let jet = level.jet(&Vector::<2>::new(0.5, 2.0));
        assert!((jet.gradient - Vector::<2>::new(1.5, 0.125 - 2.0_f64.cos())).norm() < 1e-15);
        assert!((jet.hessian[(0, 0)] - 6.0).abs() < 1e-15 && (jet.hessian[(0, 1)] - 0.75).abs() < 1e-15);
        assert!((jet.hessian[(1, 1)] - 2.0_f64.sin()).abs() < 1e-15);
    }

    /// A level that is no distance.
    #[test]
    fn a_disk_by_formula_is_the_circle() {
        let numbers = NamedNumbers(vec![("r".to_owned(), 0.15)]);
        let level = FormulaLevel::<2>::new(&"(x - 0.5)^2 + (y - 0.75)^2 - r^2".into(), &numbers, "/shape").unwrap();
        let disk = ImplicitSurface::new(Arc::new(level), Vector::<2>::zeros(), Vector::<2>::repeat(1.0)).unwrap();
        let circle = Ball { center: Vector::<2>::new(0.5, 0.75), radius: 0.15 };
        for k in 0..200 {
            let x = Vector::<2>::new(0.3 + 0.0021 * f64::from(k), 0.5 + 0.0031 * f64::from(k * k % 173));
            let (found, exact) = (disk.nearest(&x), circle.nearest(&x));
            assert!((found.distance - exact.distance).abs() < 1e-12, "{x:?}");
            assert!(
                (found.point - exact.point).norm() < 1e-9
                    && (found.normal.unwrap() - exact.normal.unwrap()).norm() < 1e-9
            );
            assert!((found.curvature.unwrap() - exact.curvature.unwrap()).abs() < 1e-8);
        }
        assert!((disk.area_or_volume() - circle.area_or_volume()).abs() < 1e-9 * circle.area_or_volume());
    }
}
