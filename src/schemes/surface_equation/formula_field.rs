//! A field that a user writes as a formula of the place, with its exact derivatives.

use crate::formulas::{Bound, Context, FormulaText, Input, NamedNumbers};
use crate::geometry::Vector;
use crate::spec::Violation;

/// Variables of fields on surfaces: the place, the unit normal there, and time.
pub const VARIABLES: [&str; 7] = ["x", "y", "z", "nx", "ny", "nz", "t"];
/// Index of time.
const TIME: usize = 6;

/// A field f(x, n, t) on a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaField {
    value: Bound,
    /// ∂f/∂x, ∂f/∂y, ∂f/∂z.
    gradient: Bound,
    /// The derivatives of the gradient, row by row.
    hessian: Bound,
}

impl FormulaField {
    /// A field that does not change in time. `place` is that of the formula below `pointer`.
    ///
    /// # Errors
    /// All that is wrong with the formula.
    pub fn at_rest(
        value: &FormulaText,
        parameters: &NamedNumbers,
        pointer: &str,
        place: &str,
    ) -> Result<Self, Vec<Violation>> {
        Self::new(value, Context { pointer, variables: &VARIABLES[..TIME], parameters }, place)
    }

    /// A field that may change in time.
    ///
    /// # Errors
    /// As [`Self::at_rest`].
    pub fn in_time(
        value: &FormulaText,
        parameters: &NamedNumbers,
        pointer: &str,
        place: &str,
    ) -> Result<Self, Vec<Violation>> {
        Self::new(value, Context { pointer, variables: &VARIABLES, parameters }, place)
    }

    fn new(value: &FormulaText, context: Context<'_>, place: &str) -> Result<Self, Vec<Violation>> {
        let value = Bound::new(&[(place.to_owned(), value)], context)?;
        let gradient = value.derivatives(&[vec![0, 1, 2]]);
        let hessian = gradient.derivatives(&[vec![0, 1, 2], vec![0, 1, 2], vec![0, 1, 2]]);
        Ok(Self { value, gradient, hessian })
    }

    /// The formula as it was given.
    #[must_use]
    pub fn text(&self) -> &str {
        self.value.texts().first().map_or("", String::as_str)
    }

    /// Whether the field is one of the place alone: then its derivatives along a surface follow from those in space.
    #[must_use]
    pub fn is_of_place(&self) -> bool {
        (3..VARIABLES.len()).all(|variable| !self.value.depends_on(variable))
    }

    fn numbers(x: &Vector<3>) -> [f64; 7] {
        [x[0], x[1], x[2], f64::NAN, f64::NAN, f64::NAN, 0.0]
    }

    /// The field at a place, where it is one of the place alone.
    #[must_use]
    pub fn value(&self, x: &Vector<3>) -> f64 {
        self.value.at(&Self::numbers(x)).first().copied().unwrap_or(f64::NAN)
    }

    /// ∇f in space.
    #[must_use]
    pub fn gradient(&self, x: &Vector<3>) -> Vector<3> {
        Vector::<3>::from_column_slice(&self.gradient.at(&Self::numbers(x)))
    }

    /// Δf − nᵀ(∇∇f)n − (∇·n) n·∇f: the Laplace–Beltrami operator on a surface with the unit normal n and the curvature ∇·n.
    #[must_use]
    pub fn laplace_beltrami(&self, x: &Vector<3>, n: &Vector<3>, curvature: f64) -> f64 {
        let hessian = nalgebra::Matrix3::from_row_slice(&self.hessian.at(&Self::numbers(x)));
        hessian.trace() - n.dot(&(hessian * n)) - curvature * n.dot(&self.gradient(x))
    }

    /// The field at all sites at a time.
    ///
    /// # Errors
    /// The formula and the first site where it is not finite.
    pub fn values(&self, sites: &Sites, time: f64) -> Result<Vec<f64>, String> {
        let values = self.value.everywhere(&sites.inputs(time), sites.len()).pop().unwrap_or_default();
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(values),
            Some(i) => Err(sites.fault(&self.value, i, time, &[])),
        }
    }
}

/// Points of a surface with their normals, column by column: the inputs of formulas.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sites([Vec<f64>; 6]);

impl Sites {
    /// The sites of points with unit normals; z is 0 in the plane.
    #[must_use]
    pub fn new<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>]) -> Self {
        let column = |vectors: &[Vector<D>], d: usize| -> Vec<f64> {
            vectors.iter().map(|x| if d < D { x[d] } else { 0.0 }).collect()
        };
        Self(std::array::from_fn(|k| if k < 3 { column(points, k) } else { column(normals, k - 3) }))
    }

    /// Number of sites.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0[0].len()
    }

    /// Whether there is no site.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0[0].is_empty()
    }

    /// The inputs of formulas of [`VARIABLES`].
    #[must_use]
    pub fn inputs(&self, time: f64) -> Vec<Input<'_>> {
        self.0.iter().map(|column| Input::Column(column)).chain([Input::Uniform(time)]).collect()
    }

    /// Those of some sites in a row.
    #[must_use]
    pub fn part(&self, from: usize, count: usize, time: f64) -> [Input<'_>; 7] {
        std::array::from_fn(|k| match self.0.get(k) {
            Some(column) => Input::Column(&column[from..from + count]),
            None => Input::Uniform(time),
        })
    }

    /// Why formulas have no value at site i: the first formula that has none, and where.
    #[must_use]
    pub fn fault(&self, formulas: &Bound, i: usize, time: f64, more: &[f64]) -> String {
        let mut at: Vec<f64> = self.0.iter().map(|column| column.get(i).copied().unwrap_or(f64::NAN)).collect();
        at.push(time);
        at.extend_from_slice(more);
        formulas
            .fault(&at)
            .map_or_else(|| format!("a formula has no value at point {i}"), |fault| format!("{fault}, point {i}"))
    }
}

#[cfg(test)]
mod tests {
    use super::{FormulaField, Sites, Vector};
    use crate::formulas::NamedNumbers;
    use crate::schemes::surface_equation::ExactField;

    #[test]
    fn derivatives_are_those_of_the_plane_wave() {
        let k = Vector::<3>::new(2.0, -1.0, 3.0);
        let numbers = NamedNumbers(vec![("a".to_owned(), 2.0)]);
        let field = FormulaField::at_rest(&"sin(a*x - y + 3*z)".into(), &numbers, "/field", "value").unwrap();
        let wave = ExactField::PlaneWave { k };
        let (x, n) = (Vector::<3>::new(0.3, 0.5, -0.2), Vector::<3>::new(0.48, 0.6, 0.64));
        assert!(field.is_of_place());
        assert!((field.value(&x) - wave.value(&x)).abs() < 1e-15);
        assert!((field.laplace_beltrami(&x, &n, 1.3) - wave.laplace_beltrami(&x, &n, 1.3)).abs() < 1e-14);
    }

    #[test]
    fn a_point_without_a_value_is_named() {
        let field = FormulaField::at_rest(&"1/(x - 0.5)".into(), &NamedNumbers::default(), "/field", "value").unwrap();
        let points = [Vector::<3>::new(0.0, 0.0, 1.0), Vector::<3>::new(0.5, 0.0, 0.0)];
        let told = field.values(&Sites::new(&points, &points), 0.0).unwrap_err();
        assert!(told.contains("\"1/(x - 0.5)\" is inf at x = 0.5") && told.contains("point 1"), "{told}");
    }
}
