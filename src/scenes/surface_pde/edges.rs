//! What equations keep to at the edges of points from outside.

use super::data_fields;
use super::field_choices::{Course, Site};
use super::field_spec::FieldValue;
use super::field_values::values;
use super::problems::ProblemChoice;
use super::spec::{EdgesChoice, ProblemSpec, SolverChoice, SurfacePde};
use super::surfaces::Shape;
use crate::formulas::constants;
use crate::geometry::Vector;
use crate::point_clouds::{PreparedCloud, edges};
use crate::schemes::surface_equation::{ExactField, Form, SurfaceCloud};
use crate::simulation::Diagnostic;
use crate::spec::{Choice, Coordinates, Parameter, Violation};
use serde_json::{Value, json};

/// Refuses edges that hold a value where there are none, or where a problem does not keep to them.
pub(super) fn check(
    given: &SurfacePde,
    shape: &Shape,
    form: Option<Form>,
    problem: Option<&ProblemChoice>,
    errors: &mut Vec<Violation>,
) {
    let (normal, offset) = match &given.edges {
        EdgesChoice::Neumann => return,
        EdgesChoice::Periodic { period, second_period } => {
            check_periods((period, second_period.as_ref()), (given, shape, form), problem, errors);
            return;
        }
        EdgesChoice::Dirichlet { value, normal, offset } => {
            let site = Site { pointer: data_fields::HELD, shape, count: 0 };
            held_field(value, site, errors);
            (normal, offset)
        }
    };
    let conflict =
        |at: &str, detail: &str, given: Value, allowed: Value| Violation::new(at, "conflict", detail, given, allowed);
    if !matches!(shape, Shape::Points(_)) {
        let detail = "only points from outside have edges that hold a value";
        errors.push(conflict("/edges", detail, json!("dirichlet"), json!(["neumann"])));
    } else if form.is_some_and(|form| !matches!(form, Form::Stars { .. } | Form::Conservative)) {
        let detail = "edges are found by the stars of points";
        errors.push(conflict("/edges", detail, json!("dirichlet"), json!(["neumann"])));
    }
    let is_linear = matches!(
        given.problem,
        ProblemSpec::Poisson { .. } | ProblemSpec::Diffusion { .. } | ProblemSpec::Eigenvalues { .. }
    );
    if problem.is_some() && !is_linear {
        let detail = "edges hold a value in the problems `poisson`, `diffusion` and `eigenvalues`";
        errors.push(conflict(
            "/edges",
            detail,
            json!(given.problem.name()),
            json!(["poisson", "diffusion", "eigenvalues"]),
        ));
    }
    if matches!(given.solver, Some(SolverChoice::Cg { .. })) {
        let detail = "conjugate gradients need a symmetric system, which held points do not leave";
        errors.push(conflict("/solver", detail, json!("cg"), json!(["auto", "bicgstab", "gmres", "sparse_lu"])));
    }
    check_half_space(normal.as_ref(), *offset, shape.dimension(), errors);
}

/// Refuses a half-space that is none.
fn check_half_space(normal: Option<&Coordinates>, offset: f64, dimension: usize, errors: &mut Vec<Violation>) {
    match normal {
        Some(normal) if normal.len() != dimension || normal.iter().all(|c| *c == 0.0) => {
            let detail = format!("a direction has {dimension} numbers, which are not all zero");
            errors.push(Violation::new("/edges/normal", "range", detail, normal.to_json(), dimension));
        }
        None if offset != 0.0 => {
            let detail = "without a normal there is no half-space";
            errors.push(Violation::new("/edges/offset", "conflict", detail, offset, 0.0));
        }
        _ => {}
    }
}

/// The field that edges hold the values of.
fn held_field(value: &FieldValue, site: Site, errors: &mut Vec<Violation>) -> ExactField {
    site.value(value, ("/edges", &constants()), Course::AtRest, errors)
}

/// The values that the edges of a cloud would hold, at all points.
///
/// # Errors
/// One [`Violation`] where a formula has no value.
pub(super) fn held_values<const D: usize>(
    choice: &EdgesChoice,
    shape: &Shape,
    cloud: &SurfaceCloud<D>,
) -> Result<Vec<f64>, Vec<Violation>> {
    let EdgesChoice::Dirichlet { value, .. } = choice else { return Ok(Vec::new()) };
    if let Some(number) = value.number() {
        return Ok(vec![number; cloud.rows]);
    }
    let mut errors = Vec::new();
    let field = held_field(value, Site { pointer: data_fields::HELD, shape, count: 0 }, &mut errors);
    if errors.is_empty() { values(&field, cloud, data_fields::HELD) } else { Err(errors) }
}

/// Refuses periods where the points are not from outside, or a problem takes the chords between neighbors.
fn check_periods(
    (period, second): (&Coordinates, Option<&Coordinates>),
    (given, shape, form): (&SurfacePde, &Shape, Option<Form>),
    problem: Option<&ProblemChoice>,
    errors: &mut Vec<Violation>,
) {
    let conflict =
        |at: &str, detail: &str, given: Value| Violation::new(at, "conflict", detail, given, json!(["neumann"]));
    if !matches!(shape, Shape::Points(_)) {
        errors.push(conflict(
            "/edges",
            "only points from outside have edges where the surface repeats",
            json!("periodic"),
        ));
    } else if form.is_some_and(|form| !matches!(form, Form::Stars { .. } | Form::Conservative)) {
        errors.push(conflict("/edges", "edges are found by the stars of points", json!("periodic")));
    }
    let takes_chords = matches!(
        problem,
        Some(ProblemChoice::Advection { .. } | ProblemChoice::Moving { .. } | ProblemChoice::GeodesicDistance { .. })
    );
    if takes_chords {
        let detail = "this problem takes the way from a point to its neighbors, which periods break";
        errors.push(conflict("/edges", detail, json!(given.problem.name())));
    }
    for (at, period) in [("/edges/period", Some(period)), ("/edges/second_period", second)] {
        let dimension = shape.dimension();
        if let Some(period) = period.filter(|period| period.len() != dimension || period.iter().all(|c| *c == 0.0)) {
            let detail = format!("a period has {dimension} numbers, which are not all zero");
            errors.push(Violation::new(at, "range", detail, period.to_json(), dimension));
        }
    }
}

/// The periods of a choice; none where the surface does not repeat.
pub(super) fn periods<const D: usize>(choice: &EdgesChoice) -> Vec<Vector<D>> {
    let EdgesChoice::Periodic { period, second_period } = choice else { return Vec::new() };
    let vector = |period: &Coordinates| Vector::<D>::from_fn(|d, _| period.get(d).copied().unwrap_or(0.0));
    std::iter::once(period).chain(second_period).map(vector).collect()
}

/// Conormals where nothing flows, and points that hold a value.
pub(super) struct Edges<const D: usize> {
    conormals: Vec<Option<Vector<D>>>,
    held: Vec<usize>,
    /// Number of points with open stars that are in no row, and so of no edge.
    single: usize,
}

impl<const D: usize> Edges<D> {
    /// The edges of a prepared cloud, whose first `rows` points count.
    pub fn new(cloud: &PreparedCloud<D>, rows: usize, choice: &EdgesChoice) -> Self {
        let conormals = edges::conormals(&cloud.points, &cloud.normals, &cloud.graph);
        let is_edge = edges::in_rows(&conormals, &cloud.graph);
        let single = (0..rows).filter(|i| cloud.graph.is_open(*i) && !is_edge[*i]).count();
        let mut found = Self { conormals, held: Vec::new(), single };
        if let EdgesChoice::Dirichlet { normal, offset, .. } = choice {
            for (i, x) in cloud.points.iter().enumerate().filter(|(i, _)| is_edge[*i]) {
                let is_in = |normal: &[f64]| x.iter().zip(normal).map(|(x, n)| x * n).sum::<f64>() >= *offset;
                if normal.as_ref().is_none_or(|normal| is_in(normal)) {
                    found.held.push(i);
                    found.conormals[i] = None;
                }
            }
        }
        found
    }

    /// Number of points that hold a value.
    pub fn held_count(&self) -> usize {
        self.held.len()
    }

    /// Refuses edges that hold a value where a part has none of them: the equation then has no solution, or none alone.
    ///
    /// # Errors
    /// One [`Violation`].
    pub fn check(&self, cloud: &PreparedCloud<D>, choice: &EdgesChoice) -> Result<(), Vec<Violation>> {
        if !matches!(choice, EdgesChoice::Dirichlet { .. }) {
            return Ok(());
        }
        let mut has_held = vec![false; cloud.graph.part_count];
        self.held.iter().for_each(|i| has_held[cloud.graph.parts[*i] as usize] = true);
        let without = has_held.iter().filter(|held| !**held).count();
        if without == 0 {
            return Ok(());
        }
        let detail = format!(
            "{without} of {} parts of the surface have no point of an edge that would hold the value; {} points have \
             neighbors on one side alone, {} of them not in a row",
            has_held.len(),
            cloud.graph.open_count(),
            self.single
        );
        Err(vec![Violation::new("/edges", "data", detail, choice.to_json(), json!(["neumann"]))])
    }

    /// Counts of the first `rows` points for the report.
    pub fn counted(&self, rows: usize) -> Vec<Diagnostic> {
        let closed = self.conormals[..rows].iter().flatten().count() as u64;
        vec![
            Diagnostic::count("edges.no_flux", closed, "Points of edges that fits keep free of flux."),
            Diagnostic::count("edges.held", self.held.len() as u64, "Points of edges that hold a value in equations."),
            Diagnostic::count("edges.single", self.single as u64, "Points with open stars that are in no row."),
        ]
    }

    /// Puts the edges into the cloud of a simulation, those of copies into theirs; held points hold their value of `values`.
    pub fn put_into(self, cloud: &mut SurfaceCloud<D>, values: &[f64]) {
        cloud.conormals = self.conormals[..cloud.rows].to_vec();
        if let Some(copies) = &mut cloud.copies {
            copies.conormals = self.conormals;
        }
        cloud.held = self.held.into_iter().map(|i| (i, values[i])).collect();
    }
}

#[cfg(test)]
mod tests;
