//! The problem of a scene: what it was understood as, what it is made of, what it costs.

use super::parameters::Written;
use super::surfaces::{DEFAULT_COUNT, Shape};
use crate::geometry::Vector;
use crate::geometry::random::CounterRandom;
use crate::linear_algebra::krylov::Stopping;
use crate::operators::charts::tangent::Metric;
use crate::scene::Violation;
use crate::scene::work::PhaseWork;
use crate::schemes::surface_equation::{
    Condition, Curvature, Evolution, EvolutionIntegrator, EvolutionParts, ExactCourse, ExactField, Model, Pointwise,
    Poisson, Problem, Reaction, Solver, SurfaceCloud,
};
use serde_json::{Value, json};

/// The problem.
#[derive(Debug, Clone)]
pub(super) enum ProblemChoice {
    LaplaceBeltrami { field: ExactField },
    Poisson { field: ExactField, is_dirichlet: bool, solver: Solver },
    Curvature { of_heights: bool },
    Evolution { start: Start, end_time: f64, time_step: f64, integrator: EvolutionIntegrator },
}

/// What evolves from where.
#[derive(Debug, Clone)]
pub(super) enum Start {
    Field(ExactField),
    Reaction { model: Model, diffusivity: [f64; 2], noise: f64, manufactured: Option<ExactField> },
}

/// Steps of a run whose Δt is not given.
const DEFAULT_STEPS: f64 = 100.0;
/// Tolerance where neither it nor Δt is given.
const DEFAULT_TOLERANCE: f64 = 1e-7;
/// k of a plane wave that is not given, by the reach of the surface.
const DEFAULT_WAVE: [f64; 3] = [2.0, -1.0, 3.0];

/// A vector of three numbers.
pub(super) fn in_space(value: &Value, pointer: &str, violations: &mut Vec<Violation>) -> Vector<3> {
    if value.as_array().map_or(0, Vec::len) != 3 {
        violations.push(Violation::new(pointer, "range", "a vector in space has three numbers", value, json!(3)));
    }
    Vector::<3>::from_fn(|d, _| value[d].as_f64().unwrap_or(f64::NAN))
}

fn is_sphere(shape: &Shape) -> bool {
    matches!(shape, Shape::Ellipsoid(e) if e.semi_axes.max() == e.semi_axes.min())
}

/// A field as written, completed in `full`.
fn field(
    written: &Value,
    pointer: &str,
    shape: &Shape,
    count: u64,
    full: &mut Value,
    violations: &mut Vec<Violation>,
) -> Option<ExactField> {
    let default = match shape {
        Shape::Circle { .. } => json!({"type": "sin_plus_cos", "m": 1}),
        shape if is_sphere(shape) => json!({"type": "spherical_harmonic", "l": 4, "m": 0.0, "axis": "z"}),
        _ => json!({"type": "plane_wave"}),
    };
    let mut chosen = if written.is_null() { default } else { written.clone() };
    let belongs = |is_there: bool, detail: &str, violations: &mut Vec<Violation>| {
        if !is_there {
            violations.push(Violation::new(pointer, "conflict", detail, &chosen, json!(["plane_wave"])));
        }
    };
    let found = match chosen["type"].as_str() {
        Some("spherical_harmonic") => {
            belongs(is_sphere(shape), "spherical harmonics belong to a sphere", violations);
            let (l, m) = (chosen["l"].as_u64().unwrap_or(4) as u32, chosen["m"].as_f64().unwrap_or(0.0));
            if m.abs() > f64::from(l) || m.fract() != 0.0 {
                let detail = format!("the order is a whole number from −{l} to {l}");
                let (place, allowed) = (format!("{pointer}/m"), json!([-f64::from(l), l]));
                violations.push(Violation::new(place, "range", detail, &json!(m), allowed));
            }
            let axis = ["x", "y", "z"].iter().position(|axis| chosen["axis"] == *axis).unwrap_or(2);
            ExactField::SphericalHarmonic { l, m: m as i32, axis }
        }
        Some("sin_plus_cos") => {
            belongs(matches!(shape, Shape::Circle { .. }), "sin mθ + cos mθ belongs to a circle", violations);
            let m = chosen["m"].as_u64().unwrap_or(1);
            if m > count / 2 {
                let detail = format!("a wave has two points at least, and there are {count}");
                let (place, allowed) = (format!("{pointer}/m"), json!({"most": count / 2}));
                violations.push(Violation::new(place, "range", detail, &json!(m), allowed));
            }
            ExactField::SinPlusCos { m: m as u32 }
        }
        Some("truncated_gaussian") => {
            let center = in_space(&chosen["center"], &format!("{pointer}/center"), violations);
            ExactField::TruncatedGaussian { center, sigma: chosen["sigma"].as_f64().unwrap_or(0.2) }
        }
        _ => {
            // Before points are read their size is not known, and so neither what a wave is by it.
            let is_sized = !matches!(shape, Shape::Points(extent) if !extent.is_known);
            if chosen["k"].is_null() {
                let wave = DEFAULT_WAVE.iter().take(shape.dimension()).map(|k| k / shape.reach());
                chosen["k"] = is_sized.then(|| wave.collect::<Vec<f64>>()).into();
            }
            let k = if chosen["k"].is_null() {
                Vector::<3>::from(DEFAULT_WAVE)
            } else if shape.is_curve() {
                if chosen["k"].as_array().map_or(0, Vec::len) != 2 {
                    let (place, detail) = (format!("{pointer}/k"), "a vector in the plane has two numbers");
                    violations.push(Violation::new(place, "range", detail, &chosen["k"], json!(2)));
                }
                Vector::<3>::from_fn(|d, _| if d < 2 { chosen["k"][d].as_f64().unwrap_or(f64::NAN) } else { 0.0 })
            } else {
                in_space(&chosen["k"], &format!("{pointer}/k"), violations)
            };
            let size = k.norm() * shape.reach();
            if is_sized && !size.is_nan() && !(1e-6..1e6).contains(&size) {
                let detail = "by the size of the surface a wave must have a length that numbers can tell";
                violations.push(Violation::new(format!("{pointer}/k"), "range", detail, &chosen["k"], Value::Null));
            }
            ExactField::PlaneWave { k }
        }
    };
    *full = chosen;
    Some(found)
}

pub(super) fn understand(
    written: &Written,
    shape: &Shape,
    metric: Metric,
    resolved: &mut Value,
    violations: &mut Vec<Violation>,
) -> Option<ProblemChoice> {
    let problem = &written.problem;
    let mut field_of = |name: &str, violations: &mut Vec<Violation>| {
        let pointer = format!("/problem/{name}");
        field(
            &problem[name],
            &pointer,
            shape,
            written.count.unwrap_or(DEFAULT_COUNT),
            &mut resolved["problem"][name],
            violations,
        )
    };
    let end_time = problem["end_time"].as_f64().unwrap_or(1.0);
    let time_step = problem["time_step"].as_f64();
    let explicit = |tolerance: &Value| match (tolerance.as_f64(), time_step) {
        (Some(tolerance), _) => EvolutionIntegrator::Controlled { tolerance },
        (None, None) => EvolutionIntegrator::Controlled { tolerance: DEFAULT_TOLERANCE },
        (None, Some(_)) => EvolutionIntegrator::FixedSteps,
    };
    let time_step = time_step.unwrap_or(end_time / DEFAULT_STEPS);
    let choice = match problem["type"].as_str() {
        Some("poisson") => {
            let field = field_of("field", violations)?;
            if let Shape::Bump(_) = shape {
                let detail = "the areas of a bump's points differ: a solution without mean is not defined by their sum";
                let got = &problem["type"];
                violations.push(Violation::new("/problem", "conflict", detail, got, json!(["diffusion"])));
            }
            let is_dirichlet = problem["condition"] == "dirichlet";
            if let (Shape::Points(_), true) = (shape, is_dirichlet) {
                let detail = "points hold the exact solution, which is not known on points from outside";
                let (got, allowed) = (&problem["condition"], json!(["zero_mean"]));
                violations.push(Violation::new("/problem/condition", "conflict", detail, got, allowed));
            }
            ProblemChoice::Poisson { field, is_dirichlet, solver: solver(&written.solver) }
        }
        Some("diffusion") => {
            let name = "initial";
            let start = if problem[name].is_null() && matches!(shape, Shape::Bump(_)) {
                let chosen = json!({"type": "truncated_gaussian", "center": [0.0, 0.0, 0.0], "sigma": 0.2});
                field(
                    &chosen,
                    "/problem/initial",
                    shape,
                    written.count.unwrap_or(DEFAULT_COUNT),
                    &mut resolved["problem"][name],
                    violations,
                )?
            } else {
                field_of(name, violations)?
            };
            let integrator = match problem["integrator"]["type"].as_str() {
                Some("bdf2") => EvolutionIntegrator::Bdf2(solver(&written.solver)),
                _ => explicit(&problem["integrator"]["tolerance"]),
            };
            ProblemChoice::Evolution { start: Start::Field(start), end_time, time_step, integrator }
        }
        Some("curvature") => ProblemChoice::Curvature { of_heights: metric == Metric::FromHeights },
        Some("reaction_diffusion") => {
            let manufactured =
                if problem["manufactured"].is_null() { None } else { Some(field_of("manufactured", violations)?) };
            if let (Shape::Points(_), Some(_)) = (shape, manufactured) {
                let detail = "forcing takes the exact operator, which is not known on points from outside";
                let got = &problem["manufactured"];
                violations.push(Violation::new("/problem/manufactured", "conflict", detail, got, Value::Null));
            }
            let number = |of: &Value, name: &str| of[name].as_f64().unwrap_or(1.0);
            let model = &problem["model"];
            let model = match model["type"].as_str() {
                Some("gray_scott") => Model::GrayScott { feed: number(model, "feed"), kill: number(model, "kill") },
                _ => Model::Brusselator { a: number(model, "a"), b: number(model, "b") },
            };
            let diffusivity = [number(problem, "diffusivity"), number(problem, "second_diffusivity")];
            let start = Start::Reaction { model, diffusivity, noise: number(problem, "noise"), manufactured };
            let integrator = explicit(&problem["tolerance"]);
            ProblemChoice::Evolution { start, end_time, time_step, integrator }
        }
        _ => ProblemChoice::LaplaceBeltrami { field: field_of("field", violations)? },
    };
    Some(choice)
}

fn solver(written: &Value) -> Solver {
    let stopping = Stopping {
        tolerance: written["tolerance"].as_f64().unwrap_or(1e-10),
        max_iterations: written["max_iterations"].as_u64().unwrap_or(5000),
    };
    match written["type"].as_str() {
        Some("gmres") => Solver::Gmres { restart: written["restart"].as_u64().unwrap_or(60) as usize, stopping },
        Some("sparse_lu") => Solver::SparseLu,
        _ => Solver::BiCgStab(stopping),
    }
}

/// A point in space, z = 0 in the plane.
fn raised<const D: usize>(x: &Vector<D>) -> Vector<3> {
    Vector::<3>::from_fn(|d, _| if d < D { x[d] } else { 0.0 })
}

/// A field at the points of a cloud.
fn values<const D: usize>(field: &ExactField, cloud: &SurfaceCloud<D>) -> Vec<f64> {
    cloud.points[..cloud.rows].iter().map(|x| field.value(&raised(x))).collect()
}

/// Δ_S of it, by the exact normals and curvatures of a shape that has them.
fn operated<const D: usize>(field: &ExactField, shape: &Shape, cloud: &SurfaceCloud<D>) -> Option<Vec<f64>> {
    let at = |(x, curvature): (&Vector<D>, &f64)| {
        let x = raised(x);
        Some(field.laplace_beltrami(&x, &shape.normal(&x)?, *curvature))
    };
    let is_known = cloud.curvatures.len() == cloud.rows;
    is_known.then(|| cloud.points.iter().zip(&cloud.curvatures).map(at).collect()).flatten()
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

    pub fn name(&self) -> &'static str {
        match self {
            Self::LaplaceBeltrami { .. } => "applied",
            Self::Poisson { solver: Solver::SparseLu, .. } => "poisson_lu",
            Self::Poisson { .. } => "poisson",
            Self::Curvature { .. } => "curvature",
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(Solver::SparseLu), .. } => "implicit_lu",
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => "implicit",
            Self::Evolution { .. } => "explicit",
        }
    }

    /// Operators that it needs.
    pub fn copies(&self) -> f64 {
        match self {
            Self::Curvature { .. }
            | Self::Poisson { .. }
            | Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => 3.0,
            _ => 1.0,
        }
    }

    pub fn field_names(&self, shape: &Shape) -> Vec<&'static str> {
        match self {
            Self::LaplaceBeltrami { .. } | Self::Poisson { .. } if matches!(shape, Shape::Points(_)) => {
                vec!["value", "field"]
            }
            Self::LaplaceBeltrami { .. } | Self::Poisson { .. } => vec!["value", "field", "reference"],
            Self::Curvature { .. } => vec!["mean_curvature", "gauss_curvature"],
            Self::Evolution { start: Start::Field(field), .. } => match field {
                ExactField::SphericalHarmonic { .. } | ExactField::SinPlusCos { .. } => vec!["value", "reference"],
                _ => vec!["value"],
            },
            Self::Evolution { start: Start::Reaction { manufactured, .. }, .. } => match manufactured {
                Some(_) => vec!["value", "second_value", "reference"],
                None => vec!["value", "second_value"],
            },
        }
    }

    /// Work beside the construction, in products of a row; a controlled integrator makes so many steps of one.
    pub fn work(&self, application: f64, points: f64, steps: f64, inner_steps: f64) -> Vec<PhaseWork> {
        let wide = points.ln().max(1.0);
        match self {
            Self::LaplaceBeltrami { .. } => vec![PhaseWork::every_step("operators/application", application * steps)],
            Self::Curvature { of_heights: true } => Vec::new(),
            Self::Curvature { .. } => vec![PhaseWork::every_step("operators/application", 9.0 * application)],
            Self::Poisson { solver: Solver::SparseLu, .. } => vec![
                PhaseWork::every_step("solver/assembly", application),
                // Nested dissection of a plane fills n ln n entries and takes n^1.5 operations.
                PhaseWork::every_step("solver/factors", points.powf(1.5)),
                PhaseWork::every_step("solver/solution", points * wide),
            ],
            Self::Poisson { .. } => vec![
                PhaseWork::every_step("solver/assembly", application),
                PhaseWork::every_step("solver/factors", 10.0 * application),
                // Iterations grow with the number of points along a line.
                PhaseWork::every_step("solver/solution", application * points.sqrt()),
            ],
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(Solver::SparseLu), .. } => {
                // Factors of the first step and of all others.
                let factors = 2.0 * points.powf(1.5);
                vec![PhaseWork::every_step("solver/solution", factors + points * wide * steps)]
            }
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => {
                vec![PhaseWork::every_step("solver/solution", 20.0 * application * steps)]
            }
            Self::Evolution { start, integrator, .. } => {
                let fields = if let Start::Reaction { .. } = start { 2.0 } else { 1.0 };
                let inner = if let EvolutionIntegrator::Controlled { .. } = integrator { inner_steps } else { 1.0 };
                vec![PhaseWork::every_step("evolution", 6.0 * fields * application * steps * inner)]
            }
        }
    }

    /// The largest diffusivity.
    pub fn diffusivity(&self) -> f64 {
        match self {
            Self::Evolution { start: Start::Reaction { diffusivity, .. }, .. } => diffusivity[0].max(diffusivity[1]),
            _ => 1.0,
        }
    }

    /// Bytes a point that a solver fills beside its system, for rows of so many entries: the basis of GMRES, or a direct decomposition,
    /// n ln n entries of it on a surface (measured: 23 kB at 35 entries and 16,000 points).
    pub fn fill(&self, entries: f64, points: f64) -> f64 {
        match self.solver() {
            Some(Solver::SparseLu) => 70.0 * entries * points.ln(),
            Some(Solver::Gmres { restart, stopping }) => 8.0 * (stopping.max_iterations.min(restart as u64) + 1) as f64,
            _ => 0.0,
        }
    }

    /// The field that is operated on, its values and its exact operator.
    pub fn known(&self, shape: &Shape, cloud: &SurfaceCloud<3>) -> Option<(ExactField, Vec<f64>, Vec<f64>)> {
        let Self::LaplaceBeltrami { field } = self else { return None };
        Some((*field, values(field, cloud), operated(field, shape, cloud)?))
    }

    pub fn build<const D: usize>(
        &self,
        shape: &Shape,
        cloud: &SurfaceCloud<D>,
        seed: u64,
        time_step: f64,
    ) -> Result<Box<dyn Problem<D>>, Vec<Violation>> {
        Ok(match self {
            Self::LaplaceBeltrami { field } => {
                Box::new(Pointwise::new(values(field, cloud), operated(field, shape, cloud)))
            }
            Self::Curvature { of_heights } => Box::new(Curvature::new(cloud.rows, *of_heights)),
            Self::Poisson { field, is_dirichlet, solver } => {
                let values = values(field, cloud);
                let condition = if *is_dirichlet {
                    Condition::Dirichlet(held(shape, cloud).into_iter().map(|i| (i, values[i])).collect())
                } else {
                    Condition::ZeroMean { alpha: shape.least_eigenvalue() }
                };
                let (right, exact) = match operated(field, shape, cloud) {
                    Some(operated) => (operated, Some(values)),
                    None => (values, None),
                };
                Box::new(Poisson::new(right, exact, condition, *solver))
            }
            Self::Evolution { start, integrator, .. } => {
                let (initial, reaction, exact) = begin(start, shape, cloud, seed);
                if initial.iter().all(|value| *value == 0.0) {
                    let detail = format!("the field is zero at all of the {} points", cloud.rows);
                    return Err(vec![Violation::new("/problem/initial", "data", detail, &Value::Null, Value::Null)]);
                }
                let parts = EvolutionParts { initial, reaction, time_step, integrator: *integrator, exact };
                Box::new(Evolution::new(parts, cloud))
            }
        })
    }
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

/// Fields at the start, the reaction, and what is known of the course.
fn begin<const D: usize>(
    start: &Start,
    shape: &Shape,
    cloud: &SurfaceCloud<D>,
    seed: u64,
) -> (Vec<f64>, Option<Reaction>, ExactCourse) {
    match start {
        Start::Field(field) => {
            let exact = field.decay(shape.reach()).map_or(ExactCourse::Unknown, ExactCourse::Decay);
            (values(field, cloud), None, exact)
        }
        Start::Reaction { model, diffusivity, noise, manufactured } => {
            let known = |field: &ExactField| Some((values(field, cloud), operated(field, shape, cloud)?));
            let known = manufactured.as_ref().and_then(known);
            let is_exact = known.is_some();
            let reaction = Reaction { model: *model, diffusivity: *diffusivity, manufactured: known };
            let random = CounterRandom::new(seed ^ 0x7265_6163);
            let rest = model.rest();
            let at = |i: usize| match (&reaction.manufactured, model) {
                (Some((field, _)), _) => reaction.exact(field[i], 0.0),
                (None, Model::GrayScott { .. }) => {
                    // The second substance is sown on a cap.
                    let [u, v] = if shape.is_on_cap(&raised(&cloud.points[i])) { [0.5, 0.25] } else { rest };
                    let off = noise * random.symmetric(&[i as i64]);
                    [u, v * (1.0 + off)]
                }
                (None, Model::Brusselator { .. }) => {
                    [0, 1].map(|k| rest[k] * (1.0 + noise * random.symmetric(&[i as i64, k as i64])))
                }
            };
            let both: Vec<[f64; 2]> = (0..cloud.rows).map(at).collect();
            let values = both.iter().map(|b| b[0]).chain(both.iter().map(|b| b[1])).collect();
            let exact = if is_exact { ExactCourse::Manufactured } else { ExactCourse::Unknown };
            (values, Some(reaction), exact)
        }
    }
}
