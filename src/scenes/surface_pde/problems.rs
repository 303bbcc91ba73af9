//! The problem of a scene: what it is made of, what it costs.

use super::data_fields;
use super::field_choices::{Course, Site, default_field, raised};
use super::field_spec::{FieldChoice, InitialChoice};
use super::field_values::{operated, sites, values};
use super::motions::{self, MotionPlan, place};
use super::solvers::explicit;
use super::spec::{ConditionWord, EdgesChoice, EvolutionChoice, ProblemSpec, SurfacePde};
use super::spread::{Spread, spread};
use super::starts::{self, Start, begin};
use super::surfaces::Shape;
use super::velocities::{self, Velocity};
use crate::geometry::Vector;
use crate::operators::charts::tangent::Metric;
use crate::schemes::surface_equation::{
    Advection, Condition, Curvature, Eigenmodes, Evolution, EvolutionIntegrator, EvolutionParts, ExactField,
    GeodesicDistance, MovingSurface, Pointwise, Poisson, Problem, Solver, Source, SurfaceCloud, SurfaceGradient,
    surface_gradient,
};
use crate::simulation::Quantity;
use crate::spec::{Choice, Parameter, Places, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

/// The planned problem.
#[derive(Debug, Clone)]
pub(super) enum ProblemChoice {
    LaplaceBeltrami {
        field: ExactField,
    },
    Gradient {
        field: ExactField,
    },
    /// `has_source`: the field is the right-hand side, and no exact solution is known.
    Poisson {
        field: ExactField,
        has_source: bool,
        is_dirichlet: bool,
        solver: Solver,
    },
    Curvature {
        of_heights: bool,
    },
    Eigenvalues {
        count: usize,
    },
    GeodesicDistance {
        from: Option<Vec<Vector<3>>>,
    },
    Moving {
        initial: ExactField,
        motion: MotionPlan,
        diffusivity: f64,
        end_time: f64,
        time_step: f64,
    },
    Advection {
        initial: ExactField,
        velocity: Velocity,
        diffusivity: f64,
        end_time: f64,
        time_step: f64,
    },
    Evolution {
        start: Start,
        end_time: f64,
        time_step: f64,
        integrator: EvolutionIntegrator,
    },
}

/// Where the field of a problem stands.
const FIELD: &str = "/problem/field";
/// Steps of a run whose Δt is not given.
const DEFAULT_STEPS: f64 = 100.0;

/// Places on a surface as vectors in space.
fn places(from: &Places, shape: &Shape, errors: &mut Vec<Violation>) -> Vec<Vector<3>> {
    let places = from.0.iter().enumerate();
    places.map(|(k, from)| place(from, shape, &format!("/problem/from/{k}"), errors)).collect()
}

/// Plans the problem on a shape; the spec gets what was left open.
pub(super) fn plan(
    spec: &mut SurfacePde,
    shape: &Shape,
    (metric, solver, count): (Metric, Solver, u64),
    errors: &mut Vec<Violation>,
) -> Option<ProblemChoice> {
    let site = |pointer| Site { pointer, shape, count };
    let name = spec.problem.name();
    Some(match &mut spec.problem {
        ProblemSpec::LaplaceBeltrami { field } => {
            let field = field.get_or_insert_with(|| default_field(shape));
            ProblemChoice::LaplaceBeltrami { field: site("/problem/field").field(field, errors) }
        }
        ProblemSpec::Gradient { field } => {
            let field = field.get_or_insert(FieldChoice::PlaneWave { k: None });
            ProblemChoice::Gradient { field: site("/problem/field").field(field, errors) }
        }
        ProblemSpec::Poisson { field, source, condition } => {
            check_poisson(shape, *condition, name, errors);
            check_source(field.as_ref(), source.as_ref(), *condition, errors);
            let is_dirichlet = *condition == ConditionWord::Dirichlet;
            let (field, has_source) = match source {
                Some(source) => (site("/problem/source").field(source, errors), true),
                None => (site(FIELD).field(field.get_or_insert_with(|| default_field(shape)), errors), false),
            };
            ProblemChoice::Poisson { field, has_source, is_dirichlet, solver }
        }
        ProblemSpec::Diffusion { .. } => diffusion(&mut spec.problem, site("/problem/initial"), solver, errors)?,
        ProblemSpec::Eigenvalues { count } => {
            check_eigenvalues(&spec.edges, (*count, site("").count, shape), errors);
            ProblemChoice::Eigenvalues { count: *count as usize }
        }
        ProblemSpec::GeodesicDistance { from } => {
            ProblemChoice::GeodesicDistance { from: from.as_ref().map(|from| places(from, shape, errors)) }
        }
        ProblemSpec::MovingDiffusion { .. } | ProblemSpec::Advection { .. } => {
            transport(&mut spec.problem, shape, count, errors)?
        }
        ProblemSpec::Curvature => ProblemChoice::Curvature { of_heights: metric == Metric::FromHeights },
        ProblemSpec::ReactionDiffusion { end_time, time_step, tolerance, .. } => {
            let (end_time, integrator) = (*end_time, explicit(*tolerance, *time_step));
            let time_step = time_step.unwrap_or(end_time / DEFAULT_STEPS);
            let start = starts::reaction(site("/problem/manufactured"), &mut spec.problem, errors)?;
            ProblemChoice::Evolution { start, end_time, time_step, integrator }
        }
    })
}

/// Plans a diffusion.
fn diffusion(
    problem: &mut ProblemSpec,
    site: Site,
    solver: Solver,
    errors: &mut Vec<Violation>,
) -> Option<ProblemChoice> {
    let ProblemSpec::Diffusion { initial, diffusivity, source, parameters, end_time, time_step, integrator, .. } =
        problem
    else {
        return None;
    };
    let owner = ("/problem", &*parameters);
    let at = |pointer| Site { pointer, ..site };
    let source = source.as_ref();
    let source = source.map(|source| at(data_fields::SOURCE).value(source, owner, Course::InTime, errors));
    let diffusivity = spread(at(data_fields::DIFFUSIVITY), diffusivity, owner, errors);
    let start = Start::Field { initial: start(site, initial, errors), diffusivity, source };
    let integrator = match integrator.get_or_insert_with(|| default_integrator(site.shape)) {
        EvolutionChoice::Dopri5 { tolerance } => explicit(*tolerance, *time_step),
        EvolutionChoice::Bdf2 => EvolutionIntegrator::Bdf2(solver),
    };
    let time_step = time_step.unwrap_or(*end_time / DEFAULT_STEPS);
    Some(ProblemChoice::Evolution { start, end_time: *end_time, time_step, integrator })
}

/// Plans what is carried by a motion of the surface, or by a velocity on it.
fn transport(
    problem: &mut ProblemSpec,
    shape: &Shape,
    count: u64,
    errors: &mut Vec<Violation>,
) -> Option<ProblemChoice> {
    let site = |pointer| Site { pointer, shape, count };
    Some(match problem {
        ProblemSpec::MovingDiffusion { initial, motion, diffusivity, end_time, time_step } => ProblemChoice::Moving {
            initial: start(site("/problem/initial"), initial, errors),
            motion: motions::plan(motion, shape, *end_time, errors),
            diffusivity: *diffusivity,
            end_time: *end_time,
            time_step: time_step.unwrap_or(*end_time / DEFAULT_STEPS),
        },
        ProblemSpec::Advection { initial, velocity, diffusivity, end_time, time_step } => ProblemChoice::Advection {
            initial: start(site("/problem/initial"), initial, errors),
            velocity: velocities::plan(velocity, site("/problem/velocity"), errors),
            diffusivity: *diffusivity,
            end_time: *end_time,
            time_step: time_step.unwrap_or(*end_time / DEFAULT_STEPS),
        },
        _ => return None,
    })
}

/// The field at the start, which gets what was left open.
fn start(site: Site, initial: &mut Option<InitialChoice>, errors: &mut Vec<Violation>) -> ExactField {
    let initial = initial.get_or_insert_with(|| match site.shape {
        Shape::Bump(_) => InitialChoice::TruncatedGaussian { center: [0.0, 0.0, 0.0].into(), sigma: 0.2 },
        shape => InitialChoice::Field(default_field(shape)),
    });
    site.initial(initial, errors)
}

/// What eigenvalues do not go together with.
fn check_eigenvalues(edges: &EdgesChoice, (modes, points, shape): (u64, u64, &Shape), errors: &mut Vec<Violation>) {
    // How many points from outside there are is known when they are read.
    if modes > points && !matches!(shape, Shape::Points(extent) if !extent.is_known) {
        let detail = format!("{points} points have as many eigenvalues at most");
        errors.push(Violation::new("/problem/count", "range", detail, modes, json!({"most": points})));
    }
    if let EdgesChoice::Dirichlet { value, .. } = edges
        && value.number() != Some(0.0)
    {
        let detail = "the modes of an operator are zero at edges that hold a value";
        errors.push(Violation::new("/edges/value", "conflict", detail, value.to_json(), 0));
    }
}

/// The integrator of diffusion that is taken where none is given. Points that are close together make explicit steps short.
fn default_integrator(shape: &Shape) -> EvolutionChoice {
    match shape {
        Shape::Points(_) => EvolutionChoice::Bdf2,
        _ => EvolutionChoice::Dopri5 { tolerance: None },
    }
}

/// What a source of a Poisson equation does not go together with.
fn check_source(
    field: Option<&FieldChoice>,
    source: Option<&FieldChoice>,
    condition: ConditionWord,
    errors: &mut Vec<Violation>,
) {
    if source.is_none() {
        return;
    }
    if field.is_some() {
        let detail = "the right-hand side is that of a field, or a source; give one of them";
        errors.push(Violation::new("/problem/field", "conflict", detail, field.map(Choice::name), Value::Null));
    }
    if condition == ConditionWord::Dirichlet {
        let detail = "points hold the exact solution, which is not known of a source";
        let at = "/problem/condition";
        errors.push(Violation::new(at, "conflict", detail, condition.to_json(), json!(["zero_mean"])));
    }
}

/// What a Poisson equation does not go together with.
fn check_poisson(shape: &Shape, condition: ConditionWord, name: &str, errors: &mut Vec<Violation>) {
    if let Shape::Bump(_) = shape {
        let detail = "the areas of a bump's points differ: a solution without mean is not defined by their sum";
        errors.push(Violation::new("/problem", "conflict", detail, name, json!(["diffusion"])));
    }
    if let (Shape::Points(_), ConditionWord::Dirichlet) = (shape, condition) {
        let detail = "points hold the exact solution, which is not known on points from outside";
        let at = "/problem/condition";
        errors.push(Violation::new(at, "conflict", detail, condition.to_json(), json!(["zero_mean"])));
    }
}

impl ProblemChoice {
    /// How its systems of equations are solved, where it has any.
    pub fn solver(&self) -> Option<Solver> {
        match self {
            Self::Poisson { solver, .. } | Self::Evolution { integrator: EvolutionIntegrator::Bdf2(solver), .. } => {
                Some(*solver)
            }
            _ => None,
        }
    }

    /// Whether values at points are the result, and no equation is solved.
    pub fn is_pointwise(&self) -> bool {
        matches!(self, Self::LaplaceBeltrami { .. } | Self::Gradient { .. } | Self::Curvature { .. })
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::LaplaceBeltrami { .. } => "applied",
            Self::Gradient { .. } => "gradient",
            Self::Poisson { solver: Solver::SparseLu, .. } => "poisson_lu",
            Self::Poisson { .. } => "poisson",
            Self::Curvature { .. } => "curvature",
            Self::Eigenvalues { .. } => "eigenvalues",
            Self::GeodesicDistance { .. } => "geodesic_distance",
            Self::Advection { .. } => "advection",
            Self::Moving { .. } => "moving_diffusion",
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(Solver::SparseLu), .. } => "implicit_lu",
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => "implicit",
            Self::Evolution { .. } => "explicit",
        }
    }

    /// Fields that frames show of it.
    pub fn fields(&self, shape: &Shape) -> Vec<&'static Quantity> {
        let is_exact = !matches!(shape, Shape::Points(_));
        match self {
            Self::LaplaceBeltrami { field } => Pointwise::shown_fields(is_exact && field.is_of_place()),
            Self::Gradient { .. } => surface_gradient::shown_fields(),
            Self::Poisson { has_source, .. } => Poisson::shown_fields(is_exact && !has_source),
            Self::Curvature { .. } => Curvature::shown_fields(shape.dimension()),
            Self::Eigenvalues { .. } => Eigenmodes::shown_fields(),
            Self::GeodesicDistance { .. } => GeodesicDistance::shown_fields(),
            Self::Moving { motion, initial, diffusivity, .. } => {
                MovingSurface::<3>::shown_fields(motion.has_course(initial, *diffusivity, shape))
            }
            Self::Advection { velocity, initial, diffusivity, .. } => {
                Advection::<3>::shown_fields(velocity.has_course(initial, *diffusivity, shape))
            }
            Self::Evolution { start: Start::Field { initial, diffusivity, source }, .. } => {
                let is_mode = matches!(initial, ExactField::SphericalHarmonic { .. } | ExactField::SinPlusCos { .. });
                let is_uniform = matches!(diffusivity, Spread::Uniform(_));
                Evolution::shown_fields(1, is_mode && is_uniform && source.is_none())
            }
            Self::Evolution { start: Start::Reaction { diffusivity, manufactured, .. }, .. } => {
                Evolution::shown_fields(diffusivity.len(), manufactured.is_some())
            }
        }
    }

    /// The field that is operated on, its values and its exact operator.
    pub fn known(&self, shape: &Shape, cloud: &SurfaceCloud<3>) -> Option<(ExactField, Vec<f64>, Vec<f64>)> {
        let Self::LaplaceBeltrami { field } = self else { return None };
        Some((field.clone(), values(field, cloud, FIELD).ok()?, operated(field, shape, cloud)?))
    }

    /// The problem on a surface that stays.
    ///
    /// # Errors
    /// What is wrong with the values at the start; nothing where the surface moves, which has a simulation of its own.
    pub fn build<const D: usize>(
        &self,
        shape: &Shape,
        cloud: &SurfaceCloud<D>,
        seed: u64,
        time_step: f64,
    ) -> Result<Box<dyn Problem<D>>, Vec<Violation>> {
        Ok(match self {
            Self::Moving { .. } => return Err(Vec::new()),
            Self::LaplaceBeltrami { field } => {
                Box::new(Pointwise::new(values(field, cloud, FIELD)?, operated(field, shape, cloud)))
            }
            Self::Gradient { field } => {
                let at = |x: &Vector<D>| field.gradient(&raised(x), &shape.normal(&raised(x))?);
                let exact: Option<Vec<Vector<3>>> = cloud.points[..cloud.rows].iter().map(at).collect();
                let flat = |g: &Vector<3>| Vector::<D>::from_fn(|d, _| g[d]);
                let exact = exact.map(|exact| exact.iter().map(flat).collect());
                Box::new(SurfaceGradient::new(values(field, cloud, FIELD)?, exact))
            }
            Self::Eigenvalues { count } => {
                let shift = -shape.least_eigenvalue();
                Box::new(Eigenmodes::new(cloud.rows, *count, shift, shape.eigenvalues(*count)))
            }
            Self::Advection { initial, velocity, diffusivity, .. } => {
                let (values, at) = (start_values(initial, cloud)?, |x: &Vector<D>, n: &Vector<D>| velocity.at(x, n));
                let course = velocity.course(initial, *diffusivity, shape, cloud);
                if D == 2 {
                    Box::new(Advection::new::<1>(values, &at, *diffusivity, course, cloud))
                } else {
                    Box::new(Advection::new::<2>(values, &at, *diffusivity, course, cloud))
                }
            }
            Self::GeodesicDistance { from } => Box::new(distance(from.as_deref(), shape, cloud)),
            Self::Curvature { of_heights } => Box::new(Curvature::new(cloud.rows, *of_heights)),
            Self::Poisson { field, has_source, is_dirichlet, solver } => {
                Box::new(poisson((field, *has_source, *is_dirichlet, *solver), shape, cloud)?)
            }
            Self::Evolution { start, integrator, .. } => {
                let (initial, reaction, diffusivities, exact) = begin(start, shape, cloud, seed)?;
                let source = match start {
                    Start::Field { source: Some(ExactField::Formula(field)), .. } => {
                        Some(Source::Formula { field: Arc::clone(field), sites: sites(cloud) })
                    }
                    Start::Field { source: Some(field), .. } => {
                        Some(Source::Values(values(field, cloud, data_fields::SOURCE)?))
                    }
                    _ => None,
                };
                if source.is_none() {
                    check_not_zero(&initial[..cloud.rows])?;
                }
                let integrator = *integrator;
                let parts = EvolutionParts { initial, reaction, diffusivities, source, time_step, integrator, exact };
                Box::new(Evolution::new(parts, cloud))
            }
        })
    }
}

/// A Poisson equation: its field or source, the condition and the solver.
fn poisson<const D: usize>(
    (field, has_source, is_dirichlet, solver): (&ExactField, bool, bool, Solver),
    shape: &Shape,
    cloud: &SurfaceCloud<D>,
) -> Result<Poisson, Vec<Violation>> {
    let values = values(field, cloud, if has_source { "/problem/source" } else { FIELD })?;
    let condition = if !cloud.held.is_empty() {
        Condition::Dirichlet(cloud.held.clone())
    } else if is_dirichlet {
        Condition::Dirichlet(held(shape, cloud).into_iter().map(|i| (i, values[i])).collect())
    } else {
        Condition::ZeroMean { alpha: shape.least_eigenvalue() }
    };
    let operated = if has_source { None } else { operated(field, shape, cloud) };
    let (right, exact) = match operated {
        Some(operated) => (operated, Some(values)),
        None => (values, None),
    };
    Ok(Poisson::new(right, exact, condition, solver, cloud))
}

/// Refuses a field that is zero at all points, as one that misses the surface.
fn check_not_zero(values: &[f64]) -> Result<(), Vec<Violation>> {
    if values.iter().any(|value| *value != 0.0) {
        return Ok(());
    }
    let detail = format!("the field is zero at all of the {} points", values.len());
    Err(vec![Violation::new("/problem/initial", "data", detail, Value::Null, Value::Null)])
}

/// The values of a field at the start.
///
/// # Errors
/// One [`Violation`] where it is zero at all points.
pub(super) fn start_values<const D: usize>(
    field: &ExactField,
    cloud: &SurfaceCloud<D>,
) -> Result<Vec<f64>, Vec<Violation>> {
    let values = values(field, cloud, "/problem/initial")?;
    check_not_zero(&values).map(|()| values)
}

/// Distances from the points of a cloud nearest to given places, or from the topmost one.
fn distance<const D: usize>(from: Option<&[Vector<3>]>, shape: &Shape, cloud: &SurfaceCloud<D>) -> GeodesicDistance {
    let flat = |x: &Vector<3>| Vector::<D>::from_fn(|d, _| x[d]);
    let places: Vec<Vector<D>> = match from {
        Some(places) => places.iter().map(flat).collect(),
        None => cloud.points[..cloud.rows]
            .iter()
            .max_by(|a, b| a[D - 1].total_cmp(&b[D - 1]))
            .copied()
            .into_iter()
            .collect(),
    };
    let radius = shape.radius();
    let exact = radius.map(|radius| {
        move |a: &Vector<D>, b: &Vector<D>| 2.0 * radius * (0.5 * (a - b).norm() / radius).min(1.0).asin()
    });
    GeodesicDistance::new(&places, cloud, exact)
}

/// Points next to the plane x = 0; on a circle the one nearest to (R, 0).
fn held<const D: usize>(shape: &Shape, cloud: &SurfaceCloud<D>) -> Vec<usize> {
    if let Shape::Circle { radius } = shape {
        let from = |x: &Vector<D>| (x[0] - radius).hypot(x[1]);
        let nearest = (0..cloud.rows).min_by(|a, b| from(&cloud.points[*a]).total_cmp(&from(&cloud.points[*b])));
        return nearest.into_iter().collect();
    }
    let half = 0.5 * shape.spacing(cloud.rows as u64);
    (0..cloud.rows).filter(|i| cloud.points[*i][0].abs() <= half).collect()
}
