//! From the spec of a `surface_pde` scene to points, a method and a problem. Points from outside are unknown until a run is
//! built (`points`).

use super::data_fields;
use super::edges;
use super::field_choices::vector_in_space;
use super::methods::{self, Points, Scheme};
use super::motions;
use super::problems::{self, ProblemChoice};
use super::solvers;
use super::spec::{
    CleanWord, EvolutionChoice, MethodSpec, MetricWord, NormalsChoice, ProblemSpec, SolverChoice, StoppingSpec,
    SupportsWord, SurfaceChoice, SurfacePde,
};
use super::surfaces::{self, DEFAULT_COUNT, Extent, Sampling, Shape};
use super::transport_spec::MotionChoice;
use crate::geometry::Vector;
use crate::geometry::surfaces::{Ellipsoid, Torus};
use crate::operators::charts::tangent::Metric;
use crate::point_clouds::Bump;
use crate::scene::cloud::{CloudReference, CloudRole};
use crate::scene::{Planned, SceneSpec};
use crate::scenes::flow_data;
use crate::schemes::surface_equation::{EvolutionIntegrator, Form, Method};
use crate::spec::{Choice, Given, Parameter, Preset, Violation};
use crate::time::FixedStep;
use serde_json::{Value, json};

/// Where normals come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Normals {
    Exact,
    Estimated,
    Perturbed {
        sigma: f64,
    },
    /// With points from outside; estimated where they have none and nothing depends on it.
    Given {
        must_be_there: bool,
    },
}

pub(super) struct SurfaceScene {
    /// The spec as given, with the choice of normals: the method is planned again once points from outside are read.
    pub given: SurfacePde,
    /// The spec with everything filled in.
    pub spec: SurfacePde,
    pub shape: Shape,
    pub count: u64,
    pub sampling: Sampling,
    pub normals: Normals,
    pub scheme: Scheme,
    pub problem: ProblemChoice,
    pub fixed: FixedStep,
    /// The points of a surface from outside.
    pub points: Option<CloudReference>,
    /// All that comes from outside.
    pub clouds: Vec<CloudReference>,
}

/// Distances of points whose squares are numbers.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-50..=1e50;

impl SceneSpec for SurfacePde {
    fn plan(self) -> Planned {
        plan(self)
    }
}

/// 1. Surface and points. 2. Normals. 3. Method and problem. 4. What they mean together. 5. Steps.
fn plan(mut spec: SurfacePde) -> Planned {
    let mut errors = Vec::new();
    let points = match &spec.surface {
        SurfaceChoice::Points { source, .. } => source.reference("/surface", CloudRole::Surface, &mut errors),
        _ => None,
    };
    let data = data_fields::references(&spec, &mut errors);
    let motion = match &spec.problem {
        ProblemSpec::MovingDiffusion { motion: MotionChoice::Flow(flow), .. } => {
            flow_data::reference(flow, motions::POINTER, &mut errors)
        }
        _ => None,
    };
    let clouds = points.iter().cloned().chain(data).chain(motion).collect();
    let shape = shape(&spec, &mut errors);
    let dimension = shape.dimension();
    if let Some(given) = spec.dimension.filter(|given| *given != dimension) {
        let detail = format!("this surface lies in {dimension} dimensions");
        errors.push(Violation::new("/dimension", "conflict", detail, given, dimension));
    }
    spec.dimension = Some(dimension);
    let normals = normals(&mut spec, &shape, &mut errors);
    let given = spec.clone();
    let count = spec.count.unwrap_or(DEFAULT_COUNT);
    let sampling = surfaces::sampling(&mut spec, &shape, &mut errors);
    let spacing = shape.spacing(count);
    if !matches!(shape, Shape::Points(_)) && !LENGTHS.contains(&spacing) {
        let detail = "the distance of points is too small or too large for its square to be a number";
        let allowed = json!({"least": LENGTHS.start(), "most": LENGTHS.end()});
        errors.push(Violation::new("/surface", "range", detail, json!(spacing), allowed));
    }
    let (scheme, problem) = choices(&mut spec, (&shape, sampling, count), &mut errors);
    check_together(&given, &shape, scheme.as_ref(), problem.as_ref(), &mut errors);
    check_form(&given, scheme.as_ref(), problem.as_ref(), &mut errors);
    let form = match &scheme {
        Some(Scheme::Dcpse(Method { form, .. })) => Some(*form),
        _ => None,
    };
    edges::check(&given, &shape, form, problem.as_ref(), &mut errors);
    let (Some(scheme), Some(problem)) = (scheme, problem.filter(|_| errors.is_empty())) else {
        return Err(errors);
    };
    let fixed = match &problem {
        ProblemChoice::LaplaceBeltrami { .. } => FixedStep { time_step: 1.0, steps: spec.repeat },
        ProblemChoice::Poisson { .. } | ProblemChoice::Curvature { .. } | ProblemChoice::Gradient { .. } => {
            FixedStep { time_step: 1.0, steps: 1 }
        }
        ProblemChoice::GeodesicDistance { .. } => FixedStep { time_step: 1.0, steps: 1 },
        ProblemChoice::Eigenvalues { count } => FixedStep { time_step: 1.0, steps: *count as u64 },
        ProblemChoice::Evolution { end_time, time_step, .. }
        | ProblemChoice::Advection { end_time, time_step, .. }
        | ProblemChoice::Moving { end_time, time_step, .. } => FixedStep::from_limit(*end_time, *time_step),
    };
    fill_in_steps(&mut spec.problem, &problem, fixed);
    Ok(Box::new(SurfaceScene { given, spec, shape, count, sampling, normals, scheme, problem, fixed, points, clouds }))
}

/// What method, problem, solver and repetition do not go together with.
fn check_together(
    given: &SurfacePde,
    shape: &Shape,
    scheme: Option<&Scheme>,
    problem: Option<&ProblemChoice>,
    errors: &mut Vec<Violation>,
) {
    if let (Some(Scheme::Embedding { .. }), Some(problem)) = (scheme, problem) {
        if shape.in_space().is_none() {
            let detail = "the embedding method is for spheres, ellipsoids and tori";
            errors.push(Violation::new("/method", "conflict", detail, "closest_point", json!(["surface_dcpse"])));
        }
        if let ProblemChoice::LaplaceBeltrami { field } = problem
            && !field.is_of_place()
        {
            let detail = "the embedding method takes a field in space, so neither normals nor data";
            errors.push(Violation::new("/problem/field", "conflict", detail, Value::Null, json!(["surface_dcpse"])));
        }
        if !matches!(problem, ProblemChoice::LaplaceBeltrami { .. }) {
            let detail = "the embedding method is for the operator applied to a field";
            let allowed = json!(["laplace_beltrami"]);
            errors.push(Violation::new("/problem", "conflict", detail, given.problem.name(), allowed));
        }
    }
    let default = default_solver(shape);
    let is_wish = |solver: &&SolverChoice| **solver != default;
    if let (Some(problem), Some(solver)) = (problem, given.solver.as_ref().filter(is_wish))
        && problem.solver().is_none()
    {
        let detail = "only `poisson` and `bdf2` have a choice of solvers";
        errors.push(Violation::new("/solver", "conflict", detail, solver.to_json(), default.to_json()));
    }
    let is_applied = matches!(problem, Some(ProblemChoice::LaplaceBeltrami { .. }) | None);
    if given.repeat > 1 && !is_applied {
        let detail = "only `laplace_beltrami` is applied more than once";
        errors.push(Violation::new("/repeat", "conflict", detail, given.repeat, 1));
    }
}

/// What the forms by stars do not go together with.
fn check_form(
    given: &SurfacePde,
    scheme: Option<&Scheme>,
    problem: Option<&ProblemChoice>,
    errors: &mut Vec<Violation>,
) {
    let Some(Scheme::Dcpse(Method { form, .. })) = scheme else { return };
    let is_conservative = *form == Form::Conservative;
    let is_pointwise = problem.is_some_and(ProblemChoice::is_pointwise);
    if is_conservative && is_pointwise {
        let detail = "the rows of the conservative form are right in equations only, not point by point";
        errors.push(Violation::new("/method", "conflict", detail, "conservative", json!(["auto", "surface_dcpse"])));
    }
    if matches!(problem, Some(ProblemChoice::GeodesicDistance { .. })) && !matches!(form, Form::Stars { .. }) {
        let detail = "distances take the exchange between the stars of points, and gradients by fits along them";
        errors.push(Violation::new("/method", "conflict", detail, given.method.to_json(), json!(["auto"])));
    }
    let is_by_cells = matches!(problem, Some(ProblemChoice::Advection { .. } | ProblemChoice::Moving { .. }));
    if is_by_cells && !is_conservative {
        let detail = "this problem takes the cells of the stars of points";
        errors.push(Violation::new("/method", "conflict", detail, given.method.to_json(), json!(["conservative"])));
    }
    let has_held_points = matches!(problem, Some(ProblemChoice::Poisson { is_dirichlet: true, .. }));
    solvers::check_cg(given.solver.as_ref(), (is_conservative, has_held_points), errors);
    if matches!(given.surface, SurfaceChoice::Bump { .. })
        && !matches!(form, Form::Intrinsic { .. } | Form::Copies { .. })
    {
        let detail = "a bump has mirrored points at its edges, which supports along stars do not know";
        errors.push(Violation::new("/method", "conflict", detail, given.method.to_json(), json!(["surface_dcpse"])));
    }
    if let (SurfaceChoice::Points { clean, .. }, Form::Intrinsic { .. }) = (&given.surface, form)
        && *clean != CleanWord::Refuse
    {
        let detail = "supports of one radius want points without duplicates and strays";
        errors.push(Violation::new("/surface/clean", "conflict", detail, clean.to_json(), json!(["refuse"])));
    }
}

/// The solver of a shape where none is named.
fn default_solver(shape: &Shape) -> SolverChoice {
    let stopping = StoppingSpec::default();
    match shape {
        Shape::Points(_) => SolverChoice::Auto { stopping },
        _ => SolverChoice::Bicgstab { stopping },
    }
}

/// A resolved scene of points whose method does not say how neighbors are found is of version 0.2.0 or before: they were found
/// within one radius, and points with faults were refused.
pub(super) fn of_earlier_version(given: Given) -> Preset {
    let surface = given.read(SurfacePde::surface());
    let method = given.read(SurfacePde::method()).flatten();
    let (Some(SurfaceChoice::Points { source, .. }), Some(method)) = (surface, method) else {
        return Preset::default();
    };
    let MethodSpec::SurfaceDcpse { order, form, cutoff_dn, layers, normal_spacing, supports: None } = method else {
        return Preset::default();
    };
    let supports = Some(SupportsWord::Ball);
    let method = MethodSpec::SurfaceDcpse { order, form, cutoff_dn, layers, normal_spacing, supports };
    Preset::default()
        .set(SurfacePde::surface(), SurfaceChoice::Points { source, clean: CleanWord::Refuse })
        .set(SurfacePde::method(), Some(method))
}

/// Writes the planned steps into the spec of an evolution. A time step alone asks for steps of that length, so a tolerance that
/// controls steps must be written out.
fn fill_in_steps(spec: &mut ProblemSpec, planned: &ProblemChoice, fixed: FixedStep) {
    let controlled = match planned {
        ProblemChoice::Evolution { integrator: EvolutionIntegrator::Controlled { tolerance }, .. } => Some(*tolerance),
        _ => None,
    };
    match spec {
        ProblemSpec::Diffusion { time_step, integrator, .. } => {
            *time_step = Some(fixed.time_step);
            if let Some(EvolutionChoice::Dopri5 { tolerance }) = integrator {
                *tolerance = controlled;
            }
        }
        ProblemSpec::ReactionDiffusion { time_step, tolerance, .. } => {
            *time_step = Some(fixed.time_step);
            *tolerance = controlled;
        }
        ProblemSpec::Advection { time_step, .. } | ProblemSpec::MovingDiffusion { time_step, .. } => {
            *time_step = Some(fixed.time_step);
        }
        ProblemSpec::LaplaceBeltrami { .. }
        | ProblemSpec::Gradient { .. }
        | ProblemSpec::Poisson { .. }
        | ProblemSpec::Eigenvalues { .. }
        | ProblemSpec::GeodesicDistance { .. }
        | ProblemSpec::Curvature => {}
    }
}

/// Method and problem for a shape and a number of points; again for points from outside, once they are read. The spec gets what
/// was left open.
pub(super) fn choices(
    spec: &mut SurfacePde,
    (shape, sampling, count): (&Shape, Sampling, u64),
    errors: &mut Vec<Violation>,
) -> (Option<Scheme>, Option<ProblemChoice>) {
    let metric = match &spec.normals {
        Some(NormalsChoice::Exact) => Metric::FromNormals,
        Some(NormalsChoice::Perturbed { metric, .. } | NormalsChoice::Given { metric })
            if *metric == MetricWord::Normals =>
        {
            Metric::FromNormals
        }
        _ => Metric::FromHeights,
    };
    let solver = solvers::solver(spec.solver.get_or_insert_with(|| default_solver(shape)));
    let has_slopes = !matches!(
        spec.problem,
        ProblemSpec::LaplaceBeltrami { .. }
            | ProblemSpec::Poisson { .. }
            | ProblemSpec::Diffusion { .. }
            | ProblemSpec::ReactionDiffusion { .. }
    );
    let scheme = methods::scheme(spec, Points { shape, sampling, count, metric, has_slopes }, errors);
    (scheme, problems::plan(spec, shape, (metric, solver, count), errors))
}

/// Where normals come from; the spec gets the choice. The exact normals of points from outside are not known, and those of
/// other surfaces are not given.
fn normals(spec: &mut SurfacePde, shape: &Shape, errors: &mut Vec<Violation>) -> Normals {
    let (default, allowed, detail) = match shape {
        Shape::Points(_) => (
            NormalsChoice::Given { metric: MetricWord::Heights },
            ["given", "estimated"].as_slice(),
            "the exact normals of points from outside are not known; `given` takes theirs",
        ),
        _ => (
            NormalsChoice::Exact,
            ["exact", "estimated", "perturbed"].as_slice(),
            "the normals of this surface are known; only points from outside come with given ones",
        ),
    };
    let chosen = spec.normals.get_or_insert(default);
    if !allowed.contains(&chosen.name()) {
        errors.push(Violation::new("/normals", "conflict", detail, chosen.name(), json!(allowed)));
    }
    match *chosen {
        NormalsChoice::Exact => Normals::Exact,
        NormalsChoice::Estimated => Normals::Estimated,
        NormalsChoice::Perturbed { sigma, .. } => Normals::Perturbed { sigma },
        NormalsChoice::Given { metric } => Normals::Given { must_be_there: metric == MetricWord::Normals },
    }
}

fn shape(spec: &SurfacePde, errors: &mut Vec<Violation>) -> Shape {
    let center = Vector::<3>::zeros();
    match &spec.surface {
        SurfaceChoice::Circle { radius } => Shape::Circle { radius: *radius },
        SurfaceChoice::Sphere { radius } => {
            Shape::Ellipsoid(Ellipsoid { center, semi_axes: Vector::<3>::repeat(*radius) })
        }
        SurfaceChoice::Ellipsoid { semi_axes } => {
            let semi_axes = vector_in_space(semi_axes, "/surface/semi_axes", errors);
            Shape::Ellipsoid(Ellipsoid { center, semi_axes })
        }
        SurfaceChoice::Torus { major_radius, minor_radius } => {
            if minor_radius >= major_radius {
                let detail = "the tube must be thinner than its circle";
                let (at, allowed) = ("/surface/minor_radius", json!({"below": major_radius}));
                errors.push(Violation::new(at, "range", detail, *minor_radius, allowed));
            }
            Shape::Torus(Torus { center, major_radius: *major_radius, minor_radius: *minor_radius })
        }
        SurfaceChoice::Bump { height } => Shape::Bump(Bump { height: *height }),
        SurfaceChoice::Points { .. } => Shape::Points(Extent::unknown(spec.dimension.unwrap_or(3))),
    }
}
