//! From the spec of a `front` scene to a front and what moves it.

use super::spec::{Front, Law};
use super::wavefront::{self, WavefrontScene};
use crate::geometry::Vector;
use crate::geometry::flows::Stretch;
use crate::parallel::Interrupt;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::curvature_stability::longest_step;
use crate::scenes::flow_work::{error_units, path_units, stretch};
use crate::scenes::gbpm_spec::{GbpmContext, GbpmPlan, GbpmSpec, Motion, TopologyWord};
use crate::scenes::particle_estimate::{band_particles, check_extent};
use crate::scenes::shapes::Shape;
use crate::scenes::work_estimate;
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::grid_based_particle::{
    self as gbpm, ExactFrontMotion, FrontParts, FrontSystem, Grid, GridBasedParticles,
};
use crate::simulation::{OutputPlan, Simulation};
use crate::spec::Violation;
use crate::time::{FixedStep, PathIntegrator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// dt · max speed/h in a flow, and with a given speed.
const FLOW_CFL: f64 = 10.0;
const SPEED_CFL: f64 = 0.75;
/// The same for rays.
const RAY_CFL: f64 = 2.0;
/// dt/h² under motion by curvature.
const CURVATURE_STEP: f64 = 0.5;
/// Steps in the period of a flow that turns back, at least.
const STEPS_A_TURN: f64 = 32.0;
/// Paths of an error in space by particle, by the cost of a tight one, beside that: three, and those of samples.
const PATHS_IN_SPACE: f64 = 8.0;
/// Resident bytes a foot-point: its columns twice, its outcome, cells, a frame and a checkpoint in the making.
pub(super) const BYTES: u64 = 1200;
/// The same on a refined grid, with the cells that are split in the making.
const REFINED_BYTES: u64 = 5000;
/// The longest wave front, in spacings.
const MOST_CURVE: f64 = 1e6;
/// Foot-points up to which an estimate counts them.
const COUNTED: u64 = 20_000;
/// Steps at most.
const MOST_STEPS: u64 = 1_000_000_000;

/// What a front is given by, of whatever kind of scene.
pub(in crate::scenes) struct FrontChoice {
    pub law: Law,
    pub shape: Shape,
    pub spacing: f64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub steps: Option<u64>,
    pub integrator: PathIntegrator,
    pub method: GbpmSpec,
    /// None where the scene has no choice: segments merge.
    pub topology: Option<TopologyWord>,
    /// Where the parameters of the method are.
    pub pointer: &'static str,
}

/// What was left open in a [`FrontChoice`].
pub(in crate::scenes) struct Completed {
    pub dimension: usize,
    pub time_step: f64,
    pub method: GbpmSpec,
}

/// The kind of a scene and its resolved parameters.
type Resolved = (&'static str, Value);

struct FrontScene<const D: usize, const M: usize> {
    resolved: Resolved,
    choice: FrontChoice,
    chosen: GbpmPlan,
    fixed: FixedStep,
}

impl SceneSpec for Front {
    fn plan(self) -> Planned {
        let choice = FrontChoice {
            law: self.law.clone(),
            shape: self.shape.clone(),
            spacing: self.spacing,
            end_time: self.end_time,
            time_step: self.time_step,
            steps: None,
            integrator: self.integrator.path_integrator(),
            method: self.method.clone(),
            topology: Some(self.topology),
            pointer: "",
        };
        plan_front(choice, self.dimension, |completed| {
            let full = Front {
                dimension: Some(completed.dimension),
                time_step: Some(completed.time_step),
                method: completed.method,
                ..self
            };
            (super::KIND.kind, scene::resolved(super::KIND.kind, &full))
        })
    }
}

/// A front from its choices; `complete` writes what was left open into the spec that they came from.
pub(in crate::scenes) fn plan_front(
    choice: FrontChoice,
    dimension: Option<usize>,
    complete: impl FnOnce(Completed) -> Resolved,
) -> Planned {
    match dimension.or_else(|| choice.shape.dimension()).unwrap_or(2) {
        3 => plan::<3, 2>(choice, complete),
        _ => plan::<2, 1>(choice, complete),
    }
}

/// 1. Shape. 2. Law. 3. Method. 4. Grid. 5. Time step.
fn plan<const D: usize, const M: usize>(choice: FrontChoice, complete: impl FnOnce(Completed) -> Resolved) -> Planned {
    let mut errors = Vec::new();
    if let Shape::Points { .. } = choice.shape {
        let detail = "a front starts from a shape that is known exactly";
        let allowed = json!(["circle", "sphere", "ellipse", "box", "union", "…"]);
        return Err(vec![Violation::new("/shape/type", "conflict", detail, "points", allowed)]);
    }
    let surface = choice.shape.surface::<D>("/shape");
    match &surface {
        Ok(surface) => errors.extend(check_extent(surface.as_ref(), 4.0 * choice.spacing, choice.spacing)),
        Err(found) => errors.extend(found.iter().cloned()),
    }
    let flow = match &choice.law {
        Law::Flow { flow } => flow.flow::<D>().map_err(|found| errors.push(at_law(found, choice.pointer))).ok(),
        _ => None,
    };
    let wavefront = match &choice.law {
        Law::GeometricalOptics { speed } => {
            wavefront::from_shape(&choice.shape, *speed).map_err(|found| errors.push(found)).ok()
        }
        _ => None,
    };
    let motion = motion(&choice.law);
    let topology = choice.topology.unwrap_or(TopologyWord::Merge);
    let context = GbpmContext { pointer: choice.pointer, dimension: D, motion, topology };
    let planned = choice.method.clone().plan(context);
    check_steps(&choice, motion, &mut errors);
    let levels = choice.method.levels();
    let is_inside = match (&surface, &choice.law, &wavefront) {
        (_, Law::GeometricalOptics { .. }, Some(front)) => {
            let is_short = front.length() < MOST_CURVE * choice.spacing;
            is_short && is_within_grid(front.bounding_box(choice.end_time), choice.spacing, levels)
        }
        (Ok(surface), law, _) if !matches!(law, Law::GeometricalOptics { .. }) => {
            is_within_grid(surface.bounding_box(), choice.spacing, levels)
        }
        _ => true,
    };
    if !is_inside {
        let detail = "the grid ends before the shape does: its finest level counts so many cells from the origin alone";
        errors.push(Violation::new("/spacing", "range", detail, choice.spacing, json!("a larger number")));
    }
    let top = match (&surface, &flow) {
        (Ok(surface), Some(flow)) => {
            let (low, high) = surface.bounding_box();
            flow.top_speed(&low, &high)
        }
        _ => 0.0,
    };
    let turn = flow.as_ref().and_then(|flow| flow.return_time());
    let fixed = fixed_step(&choice, D, motion, top, turn, &mut errors);
    let (chosen, method) = match planned {
        Ok(planned) if errors.is_empty() => planned,
        Ok(_) => return Err(errors),
        Err(found) => {
            errors.extend(found);
            return Err(errors);
        }
    };
    let resolved = complete(Completed { dimension: D, time_step: fixed.time_step, method });
    Ok(match wavefront {
        Some(front) => Box::new(WavefrontScene { resolved, choice, chosen, fixed, front }),
        None => Box::new(FrontScene::<D, M> { resolved, choice, chosen, fixed }),
    })
}

fn motion(law: &Law) -> Motion {
    match law {
        Law::Flow { .. } => Motion::Flow,
        Law::MeanCurvature => Motion::Curvature,
        Law::Normal { .. } | Law::GeometricalOptics { .. } => Motion::Speed,
    }
}

/// Ways to give a step that do not go together, or not with the motion.
fn check_steps(choice: &FrontChoice, motion: Motion, errors: &mut Vec<Violation>) {
    let cfl = choice.method.cfl;
    let is_by_curvature = motion == Motion::Curvature;
    if is_by_curvature && let PathIntegrator::Dopri5 { .. } = choice.integrator {
        let detail = "error control is for prescribed flows";
        errors.push(Violation::new("/integrator/type", "conflict", detail, "dopri5", json!(["rk4", "tvd_rk2"])));
    }
    let given = [cfl.is_some(), choice.time_step.is_some(), choice.steps.is_some()];
    if given.iter().filter(|is_given| **is_given).count() > 1 {
        let detail = "a step is given in more than one way; give one of cfl, time_step and steps";
        let at = if cfl.is_some() { format!("{}/cfl", choice.pointer) } else { "/time_step".to_owned() };
        errors.push(Violation::new(at, "conflict", detail, json!(cfl.or(choice.time_step)), Value::Null));
    }
    if is_by_curvature && let Some(cfl) = cfl {
        let detail = "motion by curvature has no speed to measure a step by; give time_step";
        errors.push(Violation::new("/cfl", "conflict", detail, cfl, Value::Null));
    }
}

/// The step: as given, else the longest that the law allows.
fn fixed_step(
    choice: &FrontChoice,
    dimension: usize,
    motion: Motion,
    top: f64,
    turn: Option<f64>,
    errors: &mut Vec<Violation>,
) -> FixedStep {
    let method = &choice.method;
    let finest = Grid { spacing: choice.spacing }.spacing_at(method.levels() - 1);
    let (degree, weight) = (method.degree_for(dimension, motion), method.weight_for(dimension, motion));
    let factor = longest_step(choice.integrator, dimension, degree, weight);
    let longest = factor * finest * finest;
    if motion == Motion::Curvature
        && let Some(step) = choice.time_step.filter(|step| *step > longest)
    {
        let detail =
            format!("motion by curvature is unstable with steps longer than {factor:.3} h² (of the finest level)");
        errors.push(Violation::new("/time_step", "range", detail, step, format!("a number ≤ {longest:e}")));
    }
    let limit = match &choice.law {
        Law::MeanCurvature => CURVATURE_STEP.min(factor) * finest * finest,
        Law::Flow { .. } => {
            let by_speed = method.cfl.unwrap_or(FLOW_CFL) * finest / top;
            turn.map_or(by_speed, |turn| by_speed.min(turn / STEPS_A_TURN))
        }
        Law::Normal { speed } => method.cfl.unwrap_or(SPEED_CFL) * finest / speed.abs(),
        Law::GeometricalOptics { speed } => method.cfl.unwrap_or(RAY_CFL) * finest / speed.abs(),
    };
    let fixed = match (choice.time_step, choice.steps) {
        (Some(step), _) => FixedStep::from_time_step(choice.end_time, step),
        (None, Some(steps)) => FixedStep::from_steps(choice.end_time, steps),
        (None, None) => landing_on_turns(FixedStep::from_limit(choice.end_time, limit), choice.end_time, turn),
    };
    if !fixed.time_step.is_normal() || fixed.steps == 0 || fixed.steps > MOST_STEPS {
        let allowed = format!("a number from {} to {}", choice.end_time * 1e-9, choice.end_time);
        let detail = "the run would have too many steps or none";
        errors.push(Violation::new("/time_step", "range", detail, json!(fixed.time_step), allowed));
    }
    fixed
}

/// What a report says of the method; `in_bends` is how many particles the quadratics of sharp bends have, where these have their own.
pub(super) fn labels(chosen: &GbpmPlan, fixed: FixedStep, in_bends: Option<usize>) -> BTreeMap<&'static str, String> {
    let method = &chosen.method;
    let mut reconstruction = format!(
        "degree {}, {} particles, weight {}, that of normals {}, normals to {}",
        method.degree, method.neighbors, method.weight, method.normal_weight, method.cosine
    );
    if let Some(number) = in_bends.filter(|_| method.degree > 2) {
        reconstruction += &format!("; in sharp bends degree 2, {number} particles");
    }
    let mut said = BTreeMap::from([("reconstruction", reconstruction), ("time_step", format!("{}", fixed.time_step))]);
    if let Some(adaptivity) = method.adaptivity {
        let levels = format!("{} levels where |κ| h ≥ {}", adaptivity.levels, adaptivity.curvature_constant);
        said.insert("adaptivity", levels);
    }
    said
}

/// Whether a grid reaches around a box: with three levels more, for lattices that are finer still.
fn is_within_grid<const D: usize>((low, high): (Vector<D>, Vector<D>), spacing: f64, levels: u32) -> bool {
    let grid = Grid { spacing };
    let margin = 8.0 * spacing;
    [low.add_scalar(-margin), high.add_scalar(margin)].iter().all(|x| grid.nearest(x, levels + 2).is_some())
}

/// A few more steps where the end is a whole number of half turns, so that each of these ends a step: errors are asked for there.
fn landing_on_turns(fixed: FixedStep, end_time: f64, turn: Option<f64>) -> FixedStep {
    let halves = turn.map_or(0.0, |turn| 2.0 * end_time / turn);
    let is_whole = (halves - halves.round()).abs() < 1e-9 && halves >= 1.0 && halves < fixed.steps as f64;
    let is_whole = is_whole && fixed.steps <= MOST_STEPS;
    if !is_whole {
        return fixed;
    }
    FixedStep::from_steps(end_time, fixed.steps.next_multiple_of(halves.round() as u64))
}

/// A violation of a flow, where the flow is a part of the law.
fn at_law(mut violation: Violation, pointer: &str) -> Violation {
    if pointer.is_empty() {
        violation.pointer = format!("/law{}", violation.pointer);
    }
    violation
}

impl<const D: usize, const M: usize> FrontScene<D, M> {
    fn law(&self) -> Result<gbpm::Law<D>, Vec<Violation>> {
        Ok(match &self.choice.law {
            Law::Normal { speed } => gbpm::Law::Normal { speed: *speed },
            Law::MeanCurvature => gbpm::Law::MeanCurvature,
            Law::Flow { flow } => gbpm::Law::Flow(flow.flow::<D>().map_err(|found| vec![found])?),
            Law::GeometricalOptics { .. } => {
                let detail = "a wave front is a curve, not a surface of this dimension";
                return Err(vec![Violation::new("/law/type", "conflict", detail, Value::Null, Value::Null)]);
            }
        })
    }

    /// The front at the start.
    fn system(&self, interrupt: Interrupt) -> Result<FrontSystem<D, M>, Vec<Violation>> {
        let parts = FrontParts {
            grid: Grid { spacing: self.choice.spacing },
            method: self.chosen.method,
            law: self.law()?,
            integrator: self.choice.integrator,
            topology: self.chosen.topology,
            segments: self.chosen.segments,
            interrupt,
        };
        let surfaces = self.choice.shape.parts::<D>("/shape")?;
        Ok(FrontSystem::about(&surfaces, parts))
    }

    /// How much larger the front becomes.
    fn stretch(&self) -> Stretch {
        let none = Stretch::NONE;
        match &self.choice.law {
            Law::Flow { flow } => match (self.choice.shape.surface::<D>("/shape"), flow.flow::<D>()) {
                (Ok(surface), Ok(flow)) => flow
                    .typical_stretch()
                    .unwrap_or_else(|| stretch(surface.as_ref(), flow.as_ref(), self.choice.end_time)),
                _ => none,
            },
            Law::Normal { speed } if *speed > 0.0 => {
                let parts = self.choice.shape.parts::<D>("/shape").unwrap_or_default();
                let growth =
                    |(low, high): (Vector<D>, Vector<D>)| 1.0 + 2.0 * speed * self.choice.end_time / (high - low).max();
                let most = parts.iter().map(|part| growth(part.bounding_box())).fold(1.0, f64::max).powi(D as i32 - 1);
                Stretch { mean: 0.5 * (1.0 + most), most }
            }
            _ => none,
        }
    }

    fn exact(&self) -> Result<ExactFrontMotion<D>, Vec<Violation>> {
        let shape = &self.choice.shape;
        Ok(match &self.choice.law {
            Law::Flow { flow } => {
                let flow = flow.flow::<D>().map_err(|found| vec![found])?;
                ExactFrontMotion::Flow(ExactMotion::new(Some(shape.surface::<D>("/shape")?), flow))
            }
            Law::Normal { speed } => ExactFrontMotion::Offset {
                surfaces: shape.parts::<D>("/shape")?,
                speed: *speed,
                topology: self.chosen.topology,
            },
            Law::MeanCurvature => shape.as_ball::<D>().map_or(ExactFrontMotion::Unknown, ExactFrontMotion::Shrinking),
            Law::GeometricalOptics { .. } => ExactFrontMotion::Unknown,
        })
    }
}

impl<const D: usize, const M: usize> Scene for FrontScene<D, M> {
    fn kind(&self) -> &'static str {
        self.resolved.0
    }

    fn dimension(&self) -> usize {
        D
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.choice.spacing)
    }

    fn resolved(&self) -> Value {
        self.resolved.1.clone()
    }

    fn view(&self) -> View {
        View::Front { normal: "normal", is_plane: D == 2 }
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = vec!["normal", "curvature", "velocity", "grid_point", "level", "segment", "particle_id"];
        if D == 3 {
            names.push("gauss_curvature");
        }
        if self.chosen.segments.parameter.is_some() {
            names.push("parameter");
        }
        names
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        // On the coarsest level; where there are not many, as it is refined.
        let reach = self.chosen.method.tube_radius * self.choice.spacing;
        let about = self
            .choice
            .shape
            .surface::<D>("/shape")
            .map_or(0, |surface| band_particles(surface.as_ref(), reach, self.choice.spacing));
        // Corners without foot-points matter where there are few.
        let counted = if about < COUNTED { self.system(Interrupt::default()).ok() } else { None };
        let at_start = counted.map_or(about, |system| system.particle_count() as u64);
        let most = (at_start as f64 * self.stretch().most) as u64;
        Estimate {
            particles: at_start,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.choice.end_time,
            memory_bytes: most.saturating_mul(if self.chosen.method.levels() > 1 { REFINED_BYTES } else { BYTES }),
        }
    }

    fn family(&self) -> String {
        let law = match &self.choice.law {
            Law::Normal { .. } => "normal",
            Law::MeanCurvature => "mean_curvature",
            Law::Flow { .. } => "flow",
            Law::GeometricalOptics { .. } => "optics",
        };
        let refined = if self.chosen.method.levels() > 1 { "/refined" } else { "" };
        format!("front/{D}/{law}/{}{refined}", self.chosen.method.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let number = particles as f64 * self.stretch().mean * steps as f64;
        let exact = match (&self.choice.law, self.choice.shape.surface::<D>("/shape")) {
            (Law::Flow { flow }, Ok(surface)) => flow.flow::<D>().map_or(0.0, |flow| {
                let finest = Grid { spacing: self.choice.spacing }.spacing_at(self.chosen.method.levels() - 1);
                let beside = if D == 3 { PATHS_IN_SPACE * particles as f64 } else { 0.0 };
                error_units(Some(surface.as_ref()), flow.as_ref(), finest, particles as f64, end_time)
                    + path_units(flow.as_ref(), beside, end_time)
            }),
            _ => particles as f64,
        };
        // Of a fit, for each of its particles.
        let rows = if self.chosen.method.normal_weight > 0.0 { 1 + M } else { 1 };
        let mut work = vec![
            PhaseWork::every_step("front/motion", number),
            PhaseWork::every_step("front/resampling", number * (self.chosen.method.neighbors * rows) as f64),
            PhaseWork::every_step("front/topology", number),
            PhaseWork::at_moments("errors", exact),
        ];
        work.extend(work_estimate::around(particles as f64, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let system = self.system(context.interrupt)?;
        if system.particle_count() == 0 {
            let detail = "no grid point of this spacing has a foot-point on the shape";
            return Err(vec![Violation::new("/spacing", "range", detail, self.choice.spacing, Value::Null)]);
        }
        let said = labels(&self.chosen, self.fixed, self.law()?.particles_in_bends());
        let ball = self.choice.shape.as_ball::<D>();
        Ok(Box::new(GridBasedParticles::new(system, self.exact()?, ball, self.fixed, context.cpu_clock, said)))
    }
}
