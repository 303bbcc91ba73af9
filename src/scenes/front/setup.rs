//! From parameters to a front and what moves it.

use super::parameters::{Law, Written};
use crate::parallel::Interrupt;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::flows::{Flow, flow, top_speed};
use crate::scenes::gbpm_parameters::{self, Chosen};
use crate::scenes::particle_estimate::{band_particles, check_extent};
use crate::scenes::{shapes, work_estimate};
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::grid_based_particle::{
    self as gbpm, ExactFrontMotion, FrontParts, FrontSystem, Grid, GridBasedParticles,
};
use crate::simulation::{OutputPlan, Simulation};
use crate::time::{FixedStep, PathIntegrator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// dt · max speed/h in a flow, and with a given speed.
const FLOW_CFL: f64 = 10.0;
const SPEED_CFL: f64 = 0.75;
/// dt/h² under motion by curvature: more blows up slowly.
const CURVATURE_STEP: f64 = 0.5;
/// How much longer a vortex makes a front, about.
const DRAWN_OUT: u64 = 4;
/// Resident bytes a foot-point: its columns twice, its outcome, cells, a frame and a checkpoint in the making.
const BYTES: u64 = 1200;
/// Foot-points up to which an estimate counts them.
const COUNTED: u64 = 20_000;
/// Steps at most.
const MOST_STEPS: u64 = 1_000_000_000;

/// What a front is given by, of whatever kind of scene.
pub(in crate::scenes) struct FrontChoice {
    pub law: Law,
    pub shape: Value,
    pub spacing: f64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub steps: Option<u64>,
    pub integrator: PathIntegrator,
    /// Where the parameters of the method are.
    pub pointer: &'static str,
}

struct FrontScene<const D: usize, const M: usize> {
    resolved: Value,
    choice: FrontChoice,
    chosen: Chosen,
    fixed: FixedStep,
}

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    let choice = FrontChoice {
        law: written.law,
        shape: written.shape,
        spacing: written.spacing,
        end_time: written.end_time,
        time_step: written.time_step,
        steps: None,
        integrator: written.integrator.path(),
        pointer: "",
    };
    understand_choice(choice, written.dimension, parameters.clone())
}

/// A front from its choices; `resolved` has the parameters of the method at the pointer.
pub(in crate::scenes) fn understand_choice(
    choice: FrontChoice,
    dimension: Option<usize>,
    resolved: Value,
) -> Understood {
    match dimension.or_else(|| shapes::implied_dimension(&choice.shape)).unwrap_or(2) {
        3 => scene::<3, 2>(choice, resolved),
        _ => scene::<2, 1>(choice, resolved),
    }
}

fn scene<const D: usize, const M: usize>(choice: FrontChoice, mut resolved: Value) -> Understood {
    let mut violations = Vec::new();
    if choice.shape["type"] == "points" {
        let detail = "a front starts from a shape that is known exactly";
        let allowed = json!(["circle", "sphere", "ellipse", "box", "union", "…"]);
        return Err(vec![Violation::new("/shape/type", "conflict", detail, &json!("points"), allowed)]);
    }
    let surface = shapes::surface::<D>(&choice.shape, "/shape");
    let top = match (&surface, &choice.law) {
        (Ok(surface), Law::Flow { flow: of }) => {
            violations.extend(flow::<D>(of).err().map(|found| at_law(found, choice.pointer)));
            top_speed::<D>(of, surface.bounding_box())
        }
        (_, Law::Normal { speed }) => speed.abs(),
        _ => 0.0,
    };
    match &surface {
        Ok(surface) => violations.extend(check_extent(surface.as_ref(), 4.0 * choice.spacing, choice.spacing)),
        Err(found) => violations.extend(found.iter().cloned()),
    }
    let is_by_curvature = matches!(choice.law, Law::MeanCurvature);
    if is_by_curvature && let PathIntegrator::Dopri5 { .. } = choice.integrator {
        let detail = "error control is for prescribed flows";
        let allowed = json!(["rk4", "tvd_rk2"]);
        violations.push(Violation::new("/integrator/type", "conflict", detail, &json!("dopri5"), allowed));
    }
    let method_json = resolved.pointer(choice.pointer).cloned().unwrap_or_default();
    let written: gbpm_parameters::Written = serde_json::from_value(method_json.clone())
        .map_err(|error| vec![Violation::new(choice.pointer, "type", error.to_string(), &method_json, Value::Null)])?;
    let understood = gbpm_parameters::understand(&written, &method_json, choice.pointer, D, is_by_curvature);
    let given = [written.cfl.is_some(), choice.time_step.is_some(), choice.steps.is_some()];
    if given.iter().filter(|is_given| **is_given).count() > 1 {
        let detail = "a step is given in more than one way; give one of cfl, time_step and steps";
        let at = if written.cfl.is_some() { format!("{}/cfl", choice.pointer) } else { "/time_step".to_owned() };
        let got = if written.cfl.is_some() { json!(written.cfl) } else { json!(choice.time_step) };
        violations.push(Violation::new(at, "conflict", detail, &got, Value::Null));
    }
    if is_by_curvature && written.cfl.is_some() {
        let detail = "motion by curvature has no speed to measure a step by; give time_step";
        violations.push(Violation::new("/cfl", "conflict", detail, &json!(written.cfl), Value::Null));
    }
    let finest = choice.spacing / f64::from(1_u32 << (written.levels() - 1));
    let limit = match &choice.law {
        Law::MeanCurvature => CURVATURE_STEP * finest * finest,
        Law::Flow { .. } => written.cfl.unwrap_or(FLOW_CFL) * finest / top,
        Law::Normal { .. } => written.cfl.unwrap_or(SPEED_CFL) * finest / top,
    };
    let fixed = match (choice.time_step, choice.steps) {
        (Some(step), _) => FixedStep::from_time_step(choice.end_time, step),
        (None, Some(steps)) => FixedStep::from_steps(choice.end_time, steps),
        (None, None) => FixedStep::from_limit(choice.end_time, limit),
    };
    if !fixed.time_step.is_normal() || fixed.steps == 0 || fixed.steps > MOST_STEPS {
        let allowed = json!(format!("a number from {} to {}", choice.end_time * 1e-9, choice.end_time));
        let detail = "the run would have too many steps or none";
        violations.push(Violation::new("/time_step", "range", detail, &json!(fixed.time_step), allowed));
    }
    let (chosen, full) = match understood {
        Ok(understood) if violations.is_empty() => understood,
        Ok(_) => return Err(violations),
        Err(found) => {
            violations.push(found);
            return Err(violations);
        }
    };
    if let Some(place) = resolved.pointer_mut(choice.pointer) {
        *place = full;
        if let Some(map) = place.as_object_mut() {
            map.shift_remove("cfl");
        }
    }
    resolved["dimension"] = json!(D);
    resolved["time_step"] = json!(fixed.time_step);
    if let Some(map) = resolved.as_object_mut() {
        map.shift_remove("steps");
    }
    Ok(Box::new(FrontScene::<D, M> { resolved, choice, chosen, fixed }))
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
            Law::Flow { flow: of } => gbpm::Law::Flow(flow::<D>(of).map_err(|found| vec![found])?),
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
            by_part: self.chosen.by_part,
            interrupt,
        };
        let surfaces = shapes::parts::<D>(&self.choice.shape, "/shape")?;
        Ok(FrontSystem::about(&surfaces, parts))
    }

    fn exact(&self) -> Result<ExactFrontMotion<D>, Vec<Violation>> {
        let shape = &self.choice.shape;
        Ok(match &self.choice.law {
            Law::Flow { flow: of } => {
                let flow = flow::<D>(of).map_err(|found| vec![found])?;
                ExactFrontMotion::Flow(ExactMotion::new(Some(shapes::surface::<D>(shape, "/shape")?), flow))
            }
            Law::Normal { speed } => ExactFrontMotion::Offset {
                surfaces: shapes::parts::<D>(shape, "/shape")?,
                speed: *speed,
                topology: self.chosen.topology,
            },
            Law::MeanCurvature => {
                shapes::ball::<D>(shape).map_or(ExactFrontMotion::Unknown, ExactFrontMotion::Shrinking)
            }
        })
    }
}

impl<const D: usize, const M: usize> Scene for FrontScene<D, M> {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = vec!["normal", "curvature", "velocity", "grid_point", "segment", "particle_id"];
        if D == 3 {
            names.push("gauss_curvature");
        }
        names
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        // As if it were refined everywhere; what is, is counted.
        let finest = self.choice.spacing / f64::from(1_u32 << (self.chosen.method.levels() - 1));
        let reach = self.chosen.method.tube_radius * finest;
        let about = shapes::surface::<D>(&self.choice.shape, "/shape")
            .map_or(0, |surface| band_particles(surface.as_ref(), reach, finest));
        // Corners without foot-points matter where there are few.
        let counted = if about < COUNTED { self.system(Interrupt::default()).ok() } else { None };
        let at_start = counted.map_or(about, |system| system.particle_count() as u64);
        let is_drawn_out =
            matches!(self.choice.law, Law::Flow { flow: Flow::SingleVortex { .. } | Flow::Vortex3d { .. } });
        let most = if is_drawn_out { DRAWN_OUT * at_start } else { at_start };
        Estimate {
            particles: at_start,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.choice.end_time,
            memory_bytes: most.saturating_mul(BYTES),
        }
    }

    fn family(&self) -> String {
        let law = match &self.choice.law {
            Law::Normal { .. } => "normal",
            Law::MeanCurvature => "mean_curvature",
            Law::Flow { .. } => "flow",
        };
        format!("front/{D}/{law}/{}", self.chosen.method.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let number = particles as f64 * steps as f64;
        let mut work = vec![
            PhaseWork::every_step("front/motion", number),
            PhaseWork::every_step("front/resampling", number * self.chosen.method.neighbors as f64),
            PhaseWork::every_step("front/topology", number),
            PhaseWork::at_moments("errors", particles as f64),
        ];
        work.extend(work_estimate::around(particles as f64, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let system = self.system(context.interrupt)?;
        let method = &self.chosen.method;
        let chosen = format!(
            "degree {}, {} particles, weight {}, normals to {}",
            method.degree, method.neighbors, method.weight, method.cosine
        );
        let said = BTreeMap::from([("reconstruction", chosen), ("time_step", format!("{}", self.fixed.time_step))]);
        let ball = shapes::ball::<D>(&self.choice.shape);
        Ok(Box::new(GridBasedParticles::new(system, self.exact()?, ball, self.fixed, context.cpu_clock, said)))
    }
}
