//! Values of fields, and of their exact operators, at the points of a cloud.

use super::field_choices::raised;
use super::surfaces::Shape;
use crate::geometry::Vector;
use crate::schemes::surface_equation::{ExactField, Sites, SurfaceCloud};
use crate::spec::Violation;
use serde_json::Value;

/// A field at the points of a cloud.
///
/// # Errors
/// One [`Violation`] where a formula has no value.
pub(super) fn values<const D: usize>(
    field: &ExactField,
    cloud: &SurfaceCloud<D>,
    pointer: &str,
) -> Result<Vec<f64>, Vec<Violation>> {
    if let ExactField::Formula(formula) = field {
        let told = formula.values(&sites(cloud), 0.0);
        return told.map_err(|fault| vec![Violation::new(pointer, "data", fault, formula.text(), Value::Null)]);
    }
    if let ExactField::Data(place) = field {
        let handed_over = cloud.data.get(place).cloned();
        let missing = || Violation::new(pointer, "data", "the values were not handed over", Value::Null, Value::Null);
        return handed_over.ok_or_else(|| vec![missing()]);
    }
    Ok(cloud.points[..cloud.rows].iter().map(|x| field.value(&raised(x))).collect())
}

/// The unknowns of a cloud as sites of formulas.
pub(super) fn sites<const D: usize>(cloud: &SurfaceCloud<D>) -> Sites {
    Sites::new(&cloud.points[..cloud.rows], &cloud.normals[..cloud.rows])
}

/// Δ_S of it, by the exact normals and curvatures of a shape that has them.
pub(super) fn operated<const D: usize>(field: &ExactField, shape: &Shape, cloud: &SurfaceCloud<D>) -> Option<Vec<f64>> {
    let at = |(x, curvature): (&Vector<D>, &f64)| {
        let x = raised(x);
        Some(field.laplace_beltrami(&x, &shape.normal(&x)?, *curvature))
    };
    let is_known = cloud.curvatures.len() == cloud.rows && field.is_of_place();
    is_known.then(|| cloud.points.iter().zip(&cloud.curvatures).map(at).collect()).flatten()
}
