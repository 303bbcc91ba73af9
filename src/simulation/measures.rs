//! Measures of a user's own: fields at places, and integrals, means and extremes of formulas of fields. They look at a state and
//! change nothing.

use super::{FieldValues, Fields, Selection, Simulation};
use crate::formulas::{Bound, Context, FormulaText, Input, NamedNumbers};
use crate::geometry::Vector;
use crate::neighbors::KdTree;
use crate::spec::Violation;
use serde_json::json;

/// A part of a scene that a measure is taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// All points.
    All,
    /// The fluid inside.
    Inside,
    /// The fluid outside.
    Outside,
    /// The interface of two fluids.
    Interface,
    /// A surface that is known by points.
    Surface,
}

impl Region {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Inside => "inside",
            Self::Outside => "outside",
            Self::Interface => "interface",
            Self::Surface => "surface",
        }
    }
}

/// What becomes of a formula's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// ∫ f dV, or dA on a surface or an interface.
    Integral,
    /// The integral by that of 1.
    Mean,
    /// The largest value.
    Max,
    /// The least value.
    Min,
}

/// A field at places.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Names of the columns, one a place.
    pub columns: Vec<String>,
    /// The places; z = 0 in the plane.
    pub places: Vec<[f64; 3]>,
    /// Name of the field or of a component (`velocity_x`).
    pub field: String,
}

/// A reduction of a formula of fields over a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Measure {
    /// Name of the column.
    pub column: String,
    reduction: Reduction,
    region: Region,
    formula: Bound,
}

/// The names that formulas of fields may use: coordinates, time and fields, vectors by their components.
///
/// `fields` are the names of the fields of a scene, with whether they are vectors.
#[must_use]
pub fn variables(fields: &[(&str, bool)]) -> Vec<String> {
    let components = |(name, is_vector): &(&str, bool)| -> Vec<String> {
        if *is_vector {
            ["x", "y", "z"].iter().map(|axis| format!("{name}_{axis}")).collect()
        } else {
            vec![(*name).to_owned()]
        }
    };
    ["x", "y", "z", "t"].iter().map(|name| (*name).to_owned()).chain(fields.iter().flat_map(components)).collect()
}

impl Measure {
    /// A measure; `known` are the names that its formula may use.
    ///
    /// # Errors
    /// All that is wrong with the formula, whose place is `place` below `pointer`.
    pub fn new(
        column: String,
        (reduction, region): (Reduction, Region),
        formula: &FormulaText,
        known: &[String],
        (pointer, place): (&str, &str),
    ) -> Result<Self, Vec<Violation>> {
        let variables: Vec<&str> = known.iter().map(String::as_str).collect();
        let parameters = NamedNumbers::default();
        let context = Context { pointer, variables: &variables, parameters: &parameters };
        let formula = Bound::new(&[(place.to_owned(), formula)], context)?;
        Ok(Self { column, reduction, region, formula })
    }
}

/// The measures of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measures {
    /// Fields at places.
    pub probes: Vec<Probe>,
    /// Reductions.
    pub reductions: Vec<Measure>,
    /// The names that formulas may use.
    pub variables: Vec<String>,
}

/// Neighbors of a place that a probe looks at, in the plane and in space.
const NEIGHBORS: [usize; 2] = [12, 24];
/// Distance of a place from the nearest point, by that of the farthest neighbor, beyond which it lies outside: among points it is
/// a third at most.
const FARTHEST: f64 = 0.6;
/// Singular values below this share of the largest stand for directions without points, as across a surface.
const FLAT: f64 = 1e-6;

impl Measures {
    /// Names of the columns.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let probes = self.probes.iter().flat_map(|probe| probe.columns.iter().map(String::as_str));
        probes.chain(self.reductions.iter().map(|measure| measure.column.as_str()))
    }

    /// Whether there is nothing to be measured.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.probes.is_empty() && self.reductions.is_empty()
    }

    /// Fields that probes and formulas name and frames do not have.
    #[must_use]
    pub fn missing_fields(&self, simulation: &dyn Simulation) -> Vec<String> {
        if self.is_empty() {
            return Vec::new();
        }
        let fields = simulation.fields(Selection::All);
        let probed = self.probes.iter().map(|probe| &probe.field);
        let named = self
            .variables
            .iter()
            .enumerate()
            .filter(|(k, _)| *k > 3 && self.reductions.iter().any(|measure| measure.formula.names(*k)));
        let mut missing: Vec<String> = probed
            .chain(named.map(|(_, name)| name))
            .filter(|name| component(&fields, name).is_none())
            .cloned()
            .collect();
        missing.dedup();
        missing
    }

    /// The values of a state, in the order of the columns; NaN where there is none.
    #[must_use]
    pub fn take(&self, simulation: &dyn Simulation) -> Vec<f64> {
        if self.is_empty() {
            return Vec::new();
        }
        let fields = simulation.fields(Selection::All);
        let mut values = Vec::new();
        if !self.probes.is_empty() {
            let places: Vec<Vector<3>> = fields.points.iter().map(|x| Vector::<3>::from_column_slice(x)).collect();
            let is_plane = places.iter().all(|x| x[2] == 0.0);
            let tree = KdTree::new(&places);
            for probe in &self.probes {
                let column = component(&fields, &probe.field);
                for place in &probe.places {
                    values.push(
                        column.as_deref().map_or(f64::NAN, |column| at_place(&tree, &places, column, place, is_plane)),
                    );
                }
            }
        }
        let time = simulation.clock().time;
        values.extend(self.reductions.iter().map(|measure| self.reduce(measure, simulation, &fields, time)));
        values
    }

    fn reduce(&self, measure: &Measure, simulation: &dyn Simulation, fields: &Fields<'_>, time: f64) -> f64 {
        let count = fields.points.len();
        let columns: Vec<Option<Vec<f64>>> = self
            .variables
            .iter()
            .enumerate()
            .map(|(k, name)| (k != 3 && measure.formula.names(k)).then(|| component(fields, name)).flatten())
            .collect();
        let inputs: Vec<Input<'_>> = columns
            .iter()
            .enumerate()
            .map(|(k, column)| match column {
                Some(column) => Input::Column(column),
                None => Input::Uniform(if k == 3 { time } else { f64::NAN }),
            })
            .collect();
        let values = measure.formula.everywhere(&inputs, count).pop().unwrap_or_default();
        let weights = simulation.weights(measure.region);
        let is_one = |k: usize| weights.as_ref().is_none_or(|weights| weights[k] > 0.0);
        match measure.reduction {
            Reduction::Max | Reduction::Min => {
                let sign = if measure.reduction == Reduction::Max { 1.0 } else { -1.0 };
                let most = (0..count).filter(|k| is_one(*k)).map(|k| sign * values[k]).filter(|value| !value.is_nan());
                most.reduce(f64::max).map_or(f64::NAN, |most| sign * most)
            }
            Reduction::Integral | Reduction::Mean => {
                let weight = |k: usize| weights.as_ref().map_or(1.0, |weights| weights[k]);
                let (mut sum, mut whole) = (0.0, 0.0);
                // A point without weight may have no value.
                for k in (0..count).filter(|k| weight(*k) != 0.0) {
                    sum += weight(k) * values[k];
                    whole += weight(k);
                }
                if measure.reduction == Reduction::Integral { sum } else { sum / whole }
            }
        }
    }
}

/// The numbers of a field, of a component of one, or of a coordinate.
fn component(fields: &Fields<'_>, name: &str) -> Option<Vec<f64>> {
    let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
    if let Some(axis) = axis(name) {
        return Some(fields.points.iter().map(|x| x[axis]).collect());
    }
    for column in &fields.columns {
        match &column.values {
            FieldValues::Scalar(values) if column.name == name => return Some(values.clone()),
            FieldValues::Id(values) if column.name == name => {
                return Some(values.iter().map(|id| *id as f64).collect());
            }
            FieldValues::Vector(values) => {
                let found = name.strip_prefix(column.name).and_then(|rest| rest.strip_prefix('_')).and_then(axis);
                if let Some(axis) = found {
                    return Some(values.iter().map(|x| x[axis]).collect());
                }
            }
            _ => {}
        }
    }
    None
}

/// A linear fit, with weights that vanish at the farthest neighbor, to the values next to a place. The fit has the least slope
/// that the points ask for, so that points of a surface need none across it. NaN away from all points: there is no field.
fn at_place(tree: &KdTree<3>, places: &[Vector<3>], values: &[f64], place: &[f64; 3], is_plane: bool) -> f64 {
    let x = Vector::<3>::from_column_slice(place);
    let mut found = Vec::new();
    tree.nearest(&x, NEIGHBORS[usize::from(!is_plane)], &mut found);
    let near: Vec<usize> = found.iter().map(|(_, i)| *i as usize).filter(|i| values[*i].is_finite()).collect();
    let distance = |i: usize| (places[i] - x).norm();
    let Some(&nearest) = near.first() else { return f64::NAN };
    let reach = near.iter().map(|i| distance(*i)).fold(0.0, f64::max) * 1.001;
    if distance(nearest) > FARTHEST * reach {
        return f64::NAN;
    }
    if near.len() < 4 || reach == 0.0 {
        return values[nearest];
    }
    let weight = |i: usize| 1.0 - (distance(i) / reach).powi(2);
    let rows = nalgebra::DMatrix::from_fn(near.len(), 4, |k, column| {
        let d = (places[near[k]] - x) / reach;
        weight(near[k]) * if column == 0 { 1.0 } else { d[column - 1] }
    });
    let right = nalgebra::DVector::from_fn(near.len(), |k, _| weight(near[k]) * values[near[k]]);
    let svd = rows.svd(true, true);
    let least = FLAT * svd.singular_values.max();
    svd.solve(&right, least).map_or(values[nearest], |fit| fit[0])
}

/// What is wrong with a region for a scene that has others.
#[must_use]
pub fn check_region(region: Region, reduction: Reduction, known: &[Region], at: &str) -> Option<Violation> {
    let allowed: Vec<&str> = known.iter().map(|region| region.name()).collect();
    if known.contains(&region) {
        return None;
    }
    if region == Region::All && reduction != Reduction::Integral {
        return None;
    }
    let detail = if known.is_empty() {
        "the points of this scene stand for no areas or volumes: there are means, and the largest and least values over all of them"
    } else {
        "the scene has no such region"
    };
    Some(Violation::new(at, "conflict", detail, region.name(), json!(allowed)))
}

#[cfg(test)]
mod tests {
    use super::{KdTree, Vector, at_place};

    #[test]
    fn probes_are_exact_for_linear_fields_also_on_flat_surfaces() {
        let plane: Vec<Vector<3>> = (0..100)
            .map(|k| {
                Vector::<3>::new(0.1 * f64::from(k % 10) + 0.013 * f64::from(k / 10), 0.1 * f64::from(k / 10), 0.0)
            })
            .collect();
        let values: Vec<f64> = plane.iter().map(|x| 2.0 - 3.0 * x[0] + x[1]).collect();
        let found = at_place(&KdTree::new(&plane), &plane, &values, &[0.43, 0.51, 0.0], true);
        assert!((found - (2.0 - 1.29 + 0.51)).abs() < 1e-12, "{found}");
        let away = at_place(&KdTree::new(&plane), &plane, &values, &[3.0, 0.5, 0.0], true);
        assert!(away.is_nan(), "{away}");
        let tilted: Vec<Vector<3>> = plane.iter().map(|x| Vector::<3>::new(x[0], x[1], x[0] + 0.5)).collect();
        let found = at_place(&KdTree::new(&tilted), &tilted, &values, &[0.43, 0.51, 0.93], false);
        assert!((found - (2.0 - 1.29 + 0.51)).abs() < 1e-9, "{found}");
    }
}
