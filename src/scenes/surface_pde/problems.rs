//! The problem of a scene: what it is made of, what it costs.

use super::solvers::explicit;
use super::spec::{ConditionWord, EvolutionChoice, FieldChoice, InitialChoice, ModelChoice, ProblemSpec, SurfacePde};
use super::surfaces::{DEFAULT_COUNT, Shape};
use crate::geometry::Vector;
use crate::geometry::random::CounterRandom;
use crate::operators::charts::tangent::Metric;
use crate::scene::work::PhaseWork;
use crate::schemes::surface_equation::{
    Condition, Curvature, Evolution, EvolutionIntegrator, EvolutionParts, ExactCourse, ExactField, Model, Pointwise,
    Poisson, Problem, Reaction, Solver, SurfaceCloud, SurfaceGradient, surface_gradient,
};
use crate::simulation::Quantity;
use crate::spec::{Choice, Coordinates, Parameter, Violation};
use serde_json::{Value, json};

/// The planned problem.
#[derive(Debug, Clone)]
pub(super) enum ProblemChoice {
    LaplaceBeltrami { field: ExactField },
    Gradient { field: ExactField },
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
/// Wave vector that is not given, by the extent of the surface.
const DEFAULT_WAVE: [f64; 3] = [2.0, -1.0, 3.0];
/// Wave numbers, by the extent of the surface, for which a wave has a length that numbers can tell.
const WAVE_SIZES: std::ops::Range<f64> = 1e-6..1e6;

/// A vector of three numbers; NaN where there are fewer, with an error.
pub(super) fn vector_in_space(numbers: &Coordinates, pointer: &str, errors: &mut Vec<Violation>) -> Vector<3> {
    if numbers.len() != 3 {
        let detail = "a vector in space has three numbers";
        errors.push(Violation::new(pointer, "range", detail, numbers.to_json(), 3));
    }
    Vector::<3>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(f64::NAN))
}

fn is_sphere(shape: &Shape) -> bool {
    matches!(shape, Shape::Ellipsoid(e) if e.semi_axes.max() == e.semi_axes.min())
}

/// The field that is taken where none is given: an eigenfunction where the surface has known ones.
fn default_field(shape: &Shape) -> FieldChoice {
    use super::spec::AxisWord;
    match shape {
        Shape::Circle { .. } => FieldChoice::SinPlusCos { m: 1 },
        shape if is_sphere(shape) => FieldChoice::SphericalHarmonic { l: 4, m: 0.0, axis: AxisWord::Z },
        _ => FieldChoice::PlaneWave { k: None },
    }
}

/// Where a field stands, and on what.
#[derive(Clone, Copy)]
struct Site<'a> {
    pointer: &'a str,
    shape: &'a Shape,
    /// Number of points.
    count: u64,
}

impl Site<'_> {
    /// The exact field of a choice, which gets what was left open.
    fn field(self, chosen: &mut FieldChoice, errors: &mut Vec<Violation>) -> ExactField {
        let written = chosen.to_json();
        let belongs = |is_there: bool, detail: &str, errors: &mut Vec<Violation>| {
            if !is_there {
                errors.push(Violation::new(self.pointer, "conflict", detail, written, json!(["plane_wave"])));
            }
        };
        match chosen {
            FieldChoice::SphericalHarmonic { l, m, axis } => {
                belongs(is_sphere(self.shape), "spherical harmonics belong to a sphere", errors);
                if m.abs() > f64::from(*l) || m.fract() != 0.0 {
                    let detail = format!("the order is a whole number from −{l} to {l}");
                    let (at, allowed) = (format!("{}/m", self.pointer), json!([-f64::from(*l), l]));
                    errors.push(Violation::new(at, "range", detail, *m, allowed));
                }
                ExactField::SphericalHarmonic { l: *l, m: *m as i32, axis: *axis as usize }
            }
            FieldChoice::SinPlusCos { m } => {
                let is_circle = matches!(self.shape, Shape::Circle { .. });
                belongs(is_circle, "sin mθ + cos mθ belongs to a circle", errors);
                if *m > self.count / 2 {
                    let detail = format!("a wave needs two points at least, and there are {}", self.count);
                    let (at, allowed) = (format!("{}/m", self.pointer), json!({"most": self.count / 2}));
                    errors.push(Violation::new(at, "range", detail, *m, allowed));
                }
                ExactField::SinPlusCos { m: *m as u32 }
            }
            FieldChoice::PlaneWave { k } => ExactField::PlaneWave { k: self.wave_vector(k, errors) },
        }
    }

    /// The wave vector; one that is not given is set by the extent of the surface, where it is known.
    fn wave_vector(self, given: &mut Option<Coordinates>, errors: &mut Vec<Violation>) -> Vector<3> {
        let shape = self.shape;
        // Before points are read their extent is not known.
        let is_sized = !matches!(shape, Shape::Points(extent) if !extent.is_known);
        if given.is_none() && is_sized {
            let wave = DEFAULT_WAVE.iter().take(shape.dimension()).map(|k| k / shape.reach());
            *given = Some(Coordinates(wave.collect()));
        }
        let Some(numbers) = given else { return Vector::<3>::from(DEFAULT_WAVE) };
        let at = format!("{}/k", self.pointer);
        let k = if shape.is_curve() {
            if numbers.len() != 2 {
                let detail = "a vector in the plane has two numbers";
                errors.push(Violation::new(at.clone(), "range", detail, numbers.to_json(), 2));
            }
            Vector::<3>::from_fn(|d, _| if d < 2 { numbers.get(d).copied().unwrap_or(f64::NAN) } else { 0.0 })
        } else {
            vector_in_space(numbers, &at, errors)
        };
        let size = k.norm() * shape.reach();
        if is_sized && !size.is_nan() && !WAVE_SIZES.contains(&size) {
            let detail = "the wave length is too small or too large beside the surface";
            errors.push(Violation::new(at, "range", detail, numbers.to_json(), Value::Null));
        }
        k
    }

    /// The exact field of a choice of fields at the start.
    fn initial(self, chosen: &mut InitialChoice, errors: &mut Vec<Violation>) -> ExactField {
        match chosen {
            InitialChoice::Field(field) => self.field(field, errors),
            InitialChoice::TruncatedGaussian { center, sigma } => {
                let center = vector_in_space(center, &format!("{}/center", self.pointer), errors);
                ExactField::TruncatedGaussian { center, sigma: *sigma }
            }
        }
    }
}

/// The gradient of a field, which gets what was left open.
fn gradient(site: Site, field: &mut Option<FieldChoice>, errors: &mut Vec<Violation>) -> ProblemChoice {
    let field = field.get_or_insert(FieldChoice::PlaneWave { k: None });
    ProblemChoice::Gradient { field: site.field(field, errors) }
}

/// Plans the problem on a shape; the spec gets what was left open.
pub(super) fn plan(
    spec: &mut SurfacePde,
    shape: &Shape,
    (metric, solver): (Metric, Solver),
    errors: &mut Vec<Violation>,
) -> Option<ProblemChoice> {
    let count = spec.count.unwrap_or(DEFAULT_COUNT);
    let site = |pointer| Site { pointer, shape, count };
    let name = spec.problem.name();
    match &mut spec.problem {
        ProblemSpec::LaplaceBeltrami { field } => {
            let field = field.get_or_insert_with(|| default_field(shape));
            Some(ProblemChoice::LaplaceBeltrami { field: site("/problem/field").field(field, errors) })
        }
        ProblemSpec::Gradient { field } => Some(gradient(site("/problem/field"), field, errors)),
        ProblemSpec::Poisson { field, condition } => {
            let field = field.get_or_insert_with(|| default_field(shape));
            let field = site("/problem/field").field(field, errors);
            check_poisson(shape, *condition, name, errors);
            Some(ProblemChoice::Poisson { field, is_dirichlet: *condition == ConditionWord::Dirichlet, solver })
        }
        ProblemSpec::Diffusion { initial, end_time, time_step, integrator, .. } => {
            let initial = initial.get_or_insert_with(|| match shape {
                Shape::Bump(_) => InitialChoice::TruncatedGaussian { center: [0.0, 0.0, 0.0].into(), sigma: 0.2 },
                shape => InitialChoice::Field(default_field(shape)),
            });
            let start = Start::Field(site("/problem/initial").initial(initial, errors));
            let integrator = match integrator.get_or_insert_with(|| default_integrator(shape)) {
                EvolutionChoice::Dopri5 { tolerance } => explicit(*tolerance, *time_step),
                EvolutionChoice::Bdf2 => EvolutionIntegrator::Bdf2(solver),
            };
            let time_step = time_step.unwrap_or(*end_time / DEFAULT_STEPS);
            Some(ProblemChoice::Evolution { start, end_time: *end_time, time_step, integrator })
        }
        ProblemSpec::Curvature => Some(ProblemChoice::Curvature { of_heights: metric == Metric::FromHeights }),
        ProblemSpec::ReactionDiffusion {
            model,
            diffusivity,
            second_diffusivity,
            noise,
            manufactured,
            end_time,
            time_step,
            tolerance,
        } => {
            let exact = manufactured.as_mut().map(|field| site("/problem/manufactured").field(field, errors));
            if let (Shape::Points(_), Some(_)) = (shape, exact) {
                let detail = "forcing takes the exact operator, which is not known on points from outside";
                let at = "/problem/manufactured";
                errors.push(Violation::new(at, "conflict", detail, manufactured.to_json(), Value::Null));
            }
            let model = reaction(model);
            let diffusivity = [*diffusivity, *second_diffusivity];
            let start = Start::Reaction { model, diffusivity, noise: *noise, manufactured: exact };
            let integrator = explicit(*tolerance, *time_step);
            let time_step = time_step.unwrap_or(*end_time / DEFAULT_STEPS);
            Some(ProblemChoice::Evolution { start, end_time: *end_time, time_step, integrator })
        }
    }
}

/// The integrator of diffusion that is taken where none is given. Points that are close together make explicit steps short.
fn default_integrator(shape: &Shape) -> EvolutionChoice {
    match shape {
        Shape::Points(_) => EvolutionChoice::Bdf2,
        _ => EvolutionChoice::Dopri5 { tolerance: None },
    }
}

/// The reaction of a choice.
fn reaction(choice: &ModelChoice) -> Model {
    match *choice {
        ModelChoice::GrayScott { feed, kill } => Model::GrayScott { feed, kill },
        ModelChoice::Brusselator { a, b } => Model::Brusselator { a, b },
        ModelChoice::Schnakenberg { a, b, gamma } => Model::Schnakenberg { a, b, gamma },
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
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(Solver::SparseLu), .. } => "implicit_lu",
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => "implicit",
            Self::Evolution { .. } => "explicit",
        }
    }

    /// Operators that it needs.
    pub fn copies(&self) -> f64 {
        match self {
            Self::Curvature { .. }
            | Self::Gradient { .. }
            | Self::Poisson { .. }
            | Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => 3.0,
            _ => 1.0,
        }
    }

    /// Fields that frames show of it.
    pub fn fields(&self, shape: &Shape) -> Vec<&'static Quantity> {
        let is_exact = !matches!(shape, Shape::Points(_));
        match self {
            Self::LaplaceBeltrami { .. } => Pointwise::shown_fields(is_exact),
            Self::Gradient { .. } => surface_gradient::shown_fields(),
            Self::Poisson { .. } => Poisson::shown_fields(is_exact),
            Self::Curvature { .. } => Curvature::shown_fields(shape.dimension()),
            Self::Evolution { start: Start::Field(field), .. } => Evolution::shown_fields(
                false,
                matches!(field, ExactField::SphericalHarmonic { .. } | ExactField::SinPlusCos { .. }),
            ),
            Self::Evolution { start: Start::Reaction { manufactured, .. }, .. } => {
                Evolution::shown_fields(true, manufactured.is_some())
            }
        }
    }

    /// Work beside the construction, in products of a row; a controlled integrator makes so many steps of one.
    pub fn work(&self, application: f64, points: f64, steps: f64, inner_steps: f64) -> Vec<PhaseWork> {
        let wide = points.ln().max(1.0);
        match self {
            Self::LaplaceBeltrami { .. } => vec![PhaseWork::every_step("operators/application", application * steps)],
            Self::Curvature { of_heights: true } => Vec::new(),
            Self::Curvature { .. } | Self::Gradient { .. } => {
                vec![PhaseWork::every_step("operators/application", 9.0 * application)]
            }
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

    /// The larger of the diffusivities.
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
            Self::Gradient { field } => {
                let at = |x: &Vector<D>| field.gradient(&raised(x), &shape.normal(&raised(x))?);
                let exact: Option<Vec<Vector<3>>> = cloud.points[..cloud.rows].iter().map(at).collect();
                let flat = |g: &Vector<3>| Vector::<D>::from_fn(|d, _| g[d]);
                let exact = exact.map(|exact| exact.iter().map(flat).collect());
                Box::new(SurfaceGradient::new(values(field, cloud), exact))
            }
            Self::Curvature { of_heights } => Box::new(Curvature::new(cloud.rows, *of_heights)),
            Self::Poisson { field, is_dirichlet, solver } => {
                let values = values(field, cloud);
                let condition = if !cloud.held.is_empty() {
                    Condition::Dirichlet(cloud.held.clone())
                } else if *is_dirichlet {
                    Condition::Dirichlet(held(shape, cloud).into_iter().map(|i| (i, values[i])).collect())
                } else {
                    Condition::ZeroMean { alpha: shape.least_eigenvalue() }
                };
                let (right, exact) = match operated(field, shape, cloud) {
                    Some(operated) => (operated, Some(values)),
                    None => (values, None),
                };
                Box::new(Poisson::new(right, exact, condition, *solver, cloud))
            }
            Self::Evolution { start, integrator, .. } => {
                let (initial, reaction, exact) = begin(start, shape, cloud, seed);
                if initial.iter().all(|value| *value == 0.0) {
                    let detail = format!("the field is zero at all of the {} points", cloud.rows);
                    return Err(vec![Violation::new("/problem/initial", "data", detail, Value::Null, Value::Null)]);
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
                (None, Model::Brusselator { .. } | Model::Schnakenberg { .. }) => {
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
