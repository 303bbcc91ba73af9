//! From parameters to particles in a flow.

use super::parameters::{Field, Redistance, Written};
use crate::closest_point::PcpMethod;
use crate::geometry::Flow;
use crate::geometry::lattice::Lattice;
use crate::scene::check;
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::flow_work::{error_units, stretch};
use crate::scenes::flows::{self, flow};
use crate::scenes::front::{FrontChoice, Law, understand_choice};
use crate::scenes::particle_estimate::{band_particles, check_extent, memory_bytes};
use crate::scenes::{pcp_parameters, shapes, work_estimate};
use crate::schemes::advected_level_set::{
    AdvectedLevelSet, AdvectedParts, AdvectedSystem, FieldChoice, RedistanceWhen, Start,
};
use crate::schemes::exact_motion::ExactMotion;
use crate::simulation::{OutputPlan, Simulation};
use crate::time::{FixedStep, PathIntegrator};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

struct VortexScene<const D: usize> {
    resolved: Value,
    shape: Value,
    flow: flows::Flow,
    lattice: Lattice,
    method: PcpMethod,
    chosen: BTreeMap<&'static str, String>,
    half_band: f64,
    fixed: FixedStep,
    end_time: f64,
    integrator: PathIntegrator,
    field: FieldChoice,
    when: RedistanceWhen,
    clouds: Vec<CloudReference>,
}

/// Degree and neighbours of fits in initial positions, for a dual field: of the choices tried the least error at T/2
/// (README beside).
const AUTO_DUAL: (u64, u64) = (4, 24);
/// Degree and neighbours of fits in space that stay stable when the distance is overwritten every few steps.
const AUTO_OVERWRITE: (u64, u64) = (3, 50);
/// Steps between redistancings of an overwritten field: each one costs accuracy, too few let neighbourhoods go astray.
const AUTO_EVERY: u64 = 2;

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    if written.method["type"] == "gbpm" {
        return front(&written, parameters.clone());
    }
    match written.dimension.or_else(|| shapes::implied_dimension(&written.shape)).unwrap_or(2) {
        3 => scene::<3>(&written, parameters.clone()),
        _ => scene::<2>(&written, parameters.clone()),
    }
}

/// The same as a front of grid-based particles, which knows no band, no field and no redistancing.
fn front(written: &Written, resolved: Value) -> Understood {
    let mut violations = Vec::new();
    let mut refuse = |name: &str, is_default: bool| {
        if !is_default {
            let detail = "grid-based particles are the front itself: this is for closest-point level sets";
            let at = format!("/{name}");
            violations.push(Violation::new(at, "conflict", detail, &resolved[name], json!(["the default"])));
        }
    };
    refuse("jitter", written.jitter == 0.0);
    refuse("seed", written.seed == 1);
    refuse("band_h", written.band_h == 40.0);
    refuse("redistance", matches!(written.redistance, Redistance::Auto));
    refuse("field", written.field == Field::Dual);
    if !violations.is_empty() {
        return Err(violations);
    }
    let choice = FrontChoice {
        law: Law::Flow { flow: written.flow.clone() },
        shape: written.shape.clone(),
        spacing: written.spacing,
        end_time: written.end_time,
        time_step: written.time_step,
        steps: written.steps,
        integrator: written.integrator.path(),
        pointer: "/method",
    };
    understand_choice(choice, written.dimension, resolved)
}

fn scene<const D: usize>(written: &Written, mut resolved: Value) -> Understood {
    let mut violations = Vec::new();
    let of_points = cloud::named(&written.shape, "/shape", &mut violations);
    let surface =
        if written.shape["type"] == "points" { None } else { Some(shapes::surface::<D>(&written.shape, "/shape")) };
    match surface {
        None => {}
        Some(Ok(surface)) => {
            let half_band = 0.5 * written.band_h * written.spacing;
            violations.extend(check_extent(surface.as_ref(), half_band, written.spacing));
        }
        Some(Err(found)) => violations.extend(found),
    }
    if let Err(found) = flow::<D>(&written.flow) {
        violations.push(found);
    }
    let mut chosen = BTreeMap::new();
    let mut method_json = written.method.clone();
    if method_json["type"] == "auto" {
        let ((degree, count), neighborhood, why) = match written.field {
            Field::Dual => {
                (AUTO_DUAL, "material", "particles keep their level, so fits in initial positions stay sound")
            }
            Field::Overwrite => (
                AUTO_OVERWRITE,
                "nearest",
                "several neighbours a coefficient, on the same branch: fewer are unstable when overwritten",
            ),
        };
        // In space a fit of the same degree needs proportionally more neighbours.
        let count = if D == 2 { count } else { 2 * count };
        let weight = if written.field == Field::Overwrite { 3 } else { 2 };
        let choice = json!({
            "degree": degree, "weight": weight, "neighborhood": {"type": neighborhood, "count": count}, "tolerance": 1e-12,
            "max_iterations": 100
        });
        let mut method =
            check(pcp_parameters::PARAMETERS, choice.as_object().unwrap_or(&Map::new()), "/method", &mut violations);
        method.shift_insert(0, "type".into(), json!("pcp"));
        method.insert("chosen".into(), format!("pcp, degree {degree}, {neighborhood} {count}: {why}").into());
        method_json = Value::Object(method);
    }
    let why = method_json["chosen"].as_str().unwrap_or("pcp, as given").to_owned();
    chosen.insert("method", why);
    let default_ratio = if written.field == Field::Overwrite { 2.0 } else { 1.5 };
    let method = match pcp_parameters::understand(&method_json, "/method", D, default_ratio) {
        Ok((method, full)) => {
            resolved["method"] = full;
            if written.field == Field::Overwrite {
                let detail = "material fits need particles that keep their level: field dual";
                violations.extend(pcp_parameters::refuse_material(&method, detail));
            }
            Some(method)
        }
        Err(found) => {
            violations.extend(found);
            None
        }
    };
    if let (Redistance::ForOutput { .. }, Field::Overwrite) = (&written.redistance, written.field) {
        let detail = "overwriting when output asks would make output part of the physics; give a schedule";
        violations.push(Violation::new(
            "/redistance/type",
            "conflict",
            detail,
            &json!("for_output"),
            json!(["auto", "every"]),
        ));
    }
    if let (Some(step), Some(_)) = (written.time_step, written.steps) {
        let detail = "steps are given instead of a time step; give one of them";
        violations.push(Violation::new("/time_step", "conflict", detail, &json!(step), Value::Null));
    }
    let fixed = match (written.time_step, written.steps) {
        (Some(step), _) => FixedStep::from_time_step(written.end_time, step),
        (None, steps) => FixedStep::from_steps(written.end_time, steps.unwrap_or(240)),
    };
    if !fixed.time_step.is_normal() {
        let detail = "so short an end in so many steps leaves no time step that is a number";
        violations.push(Violation::new("/end_time", "range", detail, &json!(written.end_time), Value::Null));
    }
    if fixed.steps > 1_000_000_000 || fixed.steps == 0 {
        let allowed = json!(format!("a number from {} to {}", written.end_time * 1e-9, written.end_time));
        violations.push(Violation::new(
            "/time_step",
            "range",
            "the run would have too many steps or none",
            &json!(written.time_step),
            allowed,
        ));
    }
    let Some(method) = method.filter(|_| violations.is_empty()) else {
        return Err(violations);
    };
    let field = match written.field {
        Field::Dual => FieldChoice::Dual,
        Field::Overwrite => FieldChoice::Overwrite,
    };
    let (when, why) = match (&written.redistance, written.field) {
        (Redistance::Every { steps, chosen }, _) => (RedistanceWhen::Every(*steps), chosen.clone()),
        (Redistance::ForOutput { chosen }, _) => (RedistanceWhen::ForOutput, chosen.clone()),
        (Redistance::Auto, Field::Dual) => {
            let why = "for_output: a dual field needs no distance in between".to_owned();
            resolved["redistance"] = json!({"type": "for_output", "chosen": why});
            (RedistanceWhen::ForOutput, Some(why))
        }
        (Redistance::Auto, Field::Overwrite) => {
            let why = "an overwritten level must stay a distance, and every overwriting costs accuracy";
            let why = format!("every {AUTO_EVERY} steps: {why}");
            resolved["redistance"] = json!({"type": "every", "steps": AUTO_EVERY, "chosen": why});
            (RedistanceWhen::Every(AUTO_EVERY), Some(why))
        }
    };
    chosen.extend(why.map(|why| ("redistance", why)));
    resolved["dimension"] = json!(D);
    resolved["time_step"] = json!(fixed.time_step);
    if let Some(map) = resolved.as_object_mut() {
        map.shift_remove("steps");
    }
    Ok(Box::new(VortexScene::<D> {
        resolved,
        shape: written.shape.clone(),
        flow: written.flow.clone(),
        lattice: Lattice { spacing: written.spacing, offset: 0.5, jitter: written.jitter, seed: written.seed },
        method,
        chosen,
        half_band: 0.5 * written.band_h * written.spacing,
        fixed,
        end_time: written.end_time,
        integrator: written.integrator.path(),
        field,
        when,
        clouds: of_points.into_iter().collect(),
    }))
}

impl<const D: usize> VortexScene<D> {
    /// How far from the surface particles are made: over the band, and beyond a thin one what fits need.
    fn reach(&self) -> f64 {
        self.half_band.max(self.method.even_fit_band_h::<D>() * self.lattice.spacing)
    }
}

impl<const D: usize> Scene for VortexScene<D> {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = vec!["phi", "closest_point", "normal", "curvature", "velocity", "particle_id"];
        if self.field == FieldChoice::Dual {
            names.push("psi");
        }
        names
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let particles = sizes.get("/shape").copied().unwrap_or_else(|| {
            shapes::surface::<D>(&self.shape, "/shape")
                .map_or(0, |surface| band_particles(surface.as_ref(), self.reach(), self.lattice.spacing))
        });
        Estimate {
            particles,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.end_time,
            memory_bytes: memory_bytes::<D>(particles, &self.method),
        }
    }

    fn family(&self) -> String {
        // A rigid motion is known without sines of every place.
        let motion = if flow::<D>(&self.flow).is_ok_and(|flow| flow.is_rigid()) { "/rigid" } else { "" };
        format!("vortex/{D}/{}{motion}", work_estimate::method_name(&self.method))
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let particles = particles as f64;
        let stages = match self.integrator {
            PathIntegrator::Rk4 => 4.0,
            PathIntegrator::TvdRk2 => 2.0,
            PathIntegrator::Dopri5 { .. } => 14.0,
        };
        let flow = flow::<D>(&self.flow).ok();
        let turn = flow.as_ref().and_then(|flow| flow.return_time());
        let halfway = turn.map(|turn| 0.5 * turn).filter(|half| *half <= end_time);
        let (times, course) = match self.when {
            RedistanceWhen::Every(every) => ((steps / every.max(1)) as f64, Course::EveryStep),
            RedistanceWhen::ForOutput => {
                let frames = work_estimate::frames(steps, end_time, plan) - 1.0;
                (frames + f64::from(u8::from(halfway.is_some())), Course::Moments)
            }
        };
        let reach_h = self.reach() / self.lattice.spacing;
        // At a few moments of output the surface is as often short as long.
        let surface = shapes::surface::<D>(&self.shape, "/shape").ok();
        let stretch = match (&surface, &flow) {
            (Some(surface), Some(flow)) if course == Course::EveryStep => {
                stretch(surface.as_ref(), flow.as_ref(), end_time).mean
            }
            _ => 1.0,
        };
        let mut work = work_estimate::redistancing::<D>(&self.method, particles, reach_h, stretch, times, course);
        work.push(PhaseWork::every_step("advection", particles * steps as f64 * stages));
        work.push(PhaseWork { phase: "measure", units: particles * times, course });
        let errors =
            |flow: &dyn Flow<D>| error_units(surface.as_deref(), flow, self.lattice.spacing, particles, end_time);
        work.push(PhaseWork::at_moments("errors", flow.as_deref().map_or(particles, errors)));
        work.extend(work_estimate::around(particles, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let flow = flow::<D>(&self.flow).map_err(|violation| vec![violation])?;
        let parts = AdvectedParts {
            spacing: self.lattice.spacing,
            half_band: self.half_band,
            integrator: self.integrator,
            field: self.field,
            when: self.when,
            method: self.method.clone(),
        };
        let (start, surface) = if self.clouds.is_empty() {
            let surface = shapes::surface::<D>(&self.shape, "/shape")?;
            let start = Start::about(surface.as_ref(), &self.lattice, self.reach(), &context.interrupt);
            (start, Some(surface))
        } else {
            let (positions, level) =
                cloud::points_with_levels::<D>(&context.clouds, "/shape").map_err(|found| vec![found])?;
            if let Some(found) = cloud::check_spacing(&positions, parts.spacing) {
                return Err(vec![found]);
            }
            (Start { positions, level }, None)
        };
        let system = AdvectedSystem::new(ExactMotion::new(surface, flow), start, parts, context.interrupt);
        Ok(Box::new(AdvectedLevelSet::new(system, self.fixed, context.plan, context.cpu_clock, self.chosen.clone())))
    }
}

#[cfg(test)]
mod tests {
    use super::understand;
    use crate::scene::{CloudSizes, check};
    use crate::simulation::OutputPlan;
    use serde_json::{Value, json};

    /// Work of the fits for a scene with everything else equal.
    fn fits(flow: &Value) -> f64 {
        let given = json!({"flow": flow, "end_time": 8, "redistance": {"type": "every", "steps": 1}});
        let parameters = super::super::parameters::PARAMETERS;
        let mut found = Vec::new();
        let mut whole = check(parameters, given.as_object().unwrap(), "", &mut found);
        whole.insert("kind".into(), "vortex".into());
        let scene = understand(&Value::Object(whole)).unwrap_or_else(|found| panic!("{found:?}"));
        let plan = OutputPlan { every_time: None, series_every_steps: 10 };
        let work = scene.work(&scene.estimate(&CloudSizes::new()), &plan);
        work.iter().find(|w| w.phase == "redistancing/regression").unwrap().units
    }

    #[test]
    fn a_front_that_a_flow_draws_out_is_more_work() {
        let rotation = json!({"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 1});
        let ratio = fits(&json!({"type": "single_vortex", "period": 8})) / fits(&rotation);
        assert!((1.5..6.0).contains(&ratio), "{ratio}");
    }
}
