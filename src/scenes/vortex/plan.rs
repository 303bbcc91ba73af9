//! From the spec of a `vortex` scene to particles in a flow.

use super::spec::{Field, Method, Redistancing, Vortex};
use crate::closest_point::PcpMethod;
use crate::geometry::Flow;
use crate::geometry::flows::GridData;
use crate::geometry::lattice::Lattice;
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::flow_data;
use crate::scenes::flow_return::check_return;
use crate::scenes::flow_work::error_units;
use crate::scenes::front::{FrontChoice, Law, plan_front};
use crate::scenes::particle_estimate::{check_extent, half_extent, memory_bytes, shape_particles};
use crate::scenes::pcp_spec::{Neighborhood, PcpContext, PcpSpec};
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::scenes::work_estimate;
use crate::schemes::advected_level_set;
use crate::schemes::advected_level_set::{
    AdvectedLevelSet, AdvectedParts, AdvectedSystem, FieldChoice, RedistanceWhen, Start,
};
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::front_stretch::front_stretch;
use crate::simulation::{OutputPlan, Quantity, Simulation};
use crate::spec::{Parameter, Violation};
use crate::time::{FixedStep, PathIntegrator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

struct VortexScene<const D: usize> {
    spec: Vortex,
    /// The surface of the shape; none where points from outside tell it.
    surface: Option<ShapeSurface<D>>,
    lattice: Lattice,
    method: PcpMethod,
    chosen: BTreeMap<&'static str, String>,
    half_band: f64,
    fixed: FixedStep,
    integrator: PathIntegrator,
    field: FieldChoice,
    when: RedistanceWhen,
    clouds: Vec<CloudReference>,
}

/// Degree and number of neighbors of fits in initial positions, for a dual field: of the choices tried, these had the least
/// error at T/2 (README beside).
const AUTO_DUAL: (usize, usize) = (4, 24);
/// Degree and number of neighbors of fits in space that stay stable when the distance is overwritten every few steps.
const AUTO_OVERWRITE: (usize, usize) = (3, 50);
/// Steps between redistancings of an overwritten field: each redistancing costs accuracy; with too few of them the
/// neighborhoods degrade.
const AUTO_EVERY: u64 = 2;
/// Steps of a run whose step is not given.
const DEFAULT_STEPS: u64 = 240;
/// Steps of a run at most.
const MOST_STEPS: u64 = 1_000_000_000;

impl SceneSpec for Vortex {
    fn plan(self) -> Planned {
        if let Method::Gbpm { .. } = self.method {
            return plan_as_front(self);
        }
        match self.dimension.or_else(|| self.shape.dimension()).unwrap_or(2) {
            3 => plan::<3>(self),
            _ => plan::<2>(self),
        }
    }
}

/// The same motion as a front of grid-based particles, which has no band, no level-set function and no redistancing.
fn plan_as_front(spec: Vortex) -> Planned {
    let mut errors = Vec::new();
    let mut refuse = |name: &str, is_default: bool, got: Value| {
        if !is_default {
            let detail = "grid-based particles are the front itself: this is for closest-point level sets";
            errors.push(Violation::new(format!("/{name}"), "conflict", detail, got, json!(["the default"])));
        }
    };
    refuse("jitter", spec.jitter == 0.0, spec.jitter.to_json());
    refuse("seed", spec.seed == 1, spec.seed.to_json());
    refuse("band_h", spec.band_h == 40.0, spec.band_h.to_json());
    refuse("redistance", spec.redistance == Redistancing::Auto, spec.redistance.to_json());
    refuse("field", spec.field == Field::Dual, spec.field.to_json());
    let Method::Gbpm { method } = spec.method.clone() else { return Err(errors) };
    if !errors.is_empty() {
        return Err(errors);
    }
    let choice = FrontChoice {
        law: Law::Flow { flow: spec.flow.clone() },
        shape: spec.shape.clone(),
        spacing: spec.spacing,
        end_time: spec.end_time,
        time_step: spec.time_step,
        steps: spec.steps,
        integrator: spec.integrator.path_integrator(),
        method,
        topology: None,
        pointer: "/method",
    };
    plan_front(choice, spec.dimension, |completed| {
        let full = Vortex {
            dimension: Some(completed.dimension),
            time_step: Some(completed.time_step),
            steps: None,
            method: Method::Gbpm { method: completed.method },
            ..spec
        };
        (super::KIND.kind, scene::resolved(super::KIND.kind, &full))
    })
}

/// 1. Shape, points and flow. 2. Method, chosen where it is `auto`. 3. Time step. 4. Schedule of redistancings.
fn plan<const D: usize>(mut spec: Vortex) -> Planned {
    let mut errors = Vec::new();
    let points = spec.shape.points_reference("/shape", &mut errors);
    let velocities = flow_data::reference(&spec.flow, "/flow", &mut errors);
    let surface = surface_of::<D>(&spec, &mut errors);
    let flow = flow::<D>(&spec, None).map_err(|found| errors.extend(found)).ok();
    if let (Some(flow), Some(surface)) = (&flow, &surface) {
        errors.extend(check_return(flow.as_ref(), surface.whole.as_ref(), "/flow"));
    }
    let method = method(&mut spec, D, &mut errors);
    if let (Redistancing::ForOutput { .. }, Field::Overwrite) = (&spec.redistance, spec.field) {
        let detail = "overwriting when output asks would make output part of the physics; give a schedule";
        let allowed = json!(["auto", "every"]);
        errors.push(Violation::new("/redistance/type", "conflict", detail, "for_output", allowed));
    }
    let fixed = fixed_step(&spec, &mut errors);
    let Some((method, why_method)) = method.filter(|_| errors.is_empty()) else {
        return Err(errors);
    };
    let (when, why_then) = schedule(&mut spec);
    let mut chosen = BTreeMap::from([("method", why_method)]);
    chosen.extend(why_then.map(|why| ("redistance", why)));
    spec.dimension = Some(D);
    spec.time_step = Some(fixed.time_step);
    spec.steps = None;
    Ok(Box::new(VortexScene::<D> {
        lattice: Lattice { spacing: spec.spacing, offset: 0.5, jitter: spec.jitter, seed: spec.seed },
        method,
        chosen,
        half_band: 0.5 * spec.band_h * spec.spacing,
        fixed,
        integrator: spec.integrator.path_integrator(),
        field: match spec.field {
            Field::Dual => FieldChoice::Dual,
            Field::Overwrite => FieldChoice::Overwrite,
        },
        when,
        clouds: points.into_iter().chain(velocities).collect(),
        surface,
        spec,
    }))
}

/// The flow of a scene; one from data rests before these are read.
fn flow<const D: usize>(spec: &Vortex, data: Option<GridData<'_>>) -> Result<Box<dyn Flow<D>>, Vec<Violation>> {
    spec.flow.flow::<D>(spec.end_time, "/flow", data)
}

/// The surface of the shape, where that is known before the run.
fn surface_of<const D: usize>(spec: &Vortex, errors: &mut Vec<Violation>) -> Option<ShapeSurface<D>> {
    if spec.shape.is_from_outside() {
        return None;
    }
    let surface = spec.shape.surface::<D>("/shape").map_err(|found| errors.extend(found)).ok()?;
    let half_band = 0.5 * spec.band_h * spec.spacing;
    errors.extend(check_extent(surface.whole.as_ref(), half_band, spec.spacing));
    Some(surface)
}

/// The parameters that `auto` stands for: what was measured best for the choice of field.
fn automatic(field: Field, dimension: usize) -> PcpSpec {
    let ((degree, count), weight) = match field {
        Field::Dual => (AUTO_DUAL, 2.0),
        Field::Overwrite => (AUTO_OVERWRITE, 3.0),
    };
    // In space a fit of the same degree needs proportionally more neighbors.
    let count = if dimension == 2 { count } else { 2 * count };
    let (neighborhood, name, why) = match field {
        Field::Dual => {
            let why = "particles keep their level, so fits in initial positions stay sound";
            (Neighborhood::Material { count }, "material", why)
        }
        Field::Overwrite => {
            let why = "several neighbors a coefficient, on the same branch: fewer are unstable when overwritten";
            (Neighborhood::Nearest { count }, "nearest", why)
        }
    };
    PcpSpec {
        degree,
        weight,
        neighborhood: Some(neighborhood),
        tolerance: 1e-12,
        max_iterations: 100,
        chosen: Some(format!("pcp, degree {degree}, {name} {count}: {why}")),
        ..PcpSpec::default()
    }
}

/// The method and why it was chosen; the spec gets what was left open.
fn method(spec: &mut Vortex, dimension: usize, errors: &mut Vec<Violation>) -> Option<(PcpMethod, String)> {
    let given = match &spec.method {
        Method::Pcp { method } => method.clone(),
        Method::Auto | Method::Gbpm { .. } => automatic(spec.field, dimension),
    };
    let why = given.chosen.clone().unwrap_or_else(|| "pcp, as given".to_owned());
    let default_ratio = if spec.field == Field::Overwrite { 2.0 } else { 1.5 };
    let context = PcpContext { pointer: "/method", dimension, default_ratio };
    let (method, full) = given.plan(context).map_err(|error| errors.push(error)).ok()?;
    if spec.field == Field::Overwrite {
        let detail = "material fits need particles that keep their level: field dual";
        errors.extend(full.refuse_material("/method", detail));
    }
    spec.method = Method::Pcp { method: full };
    Some((method, why))
}

fn fixed_step(spec: &Vortex, errors: &mut Vec<Violation>) -> FixedStep {
    let end_time = spec.end_time;
    if let (Some(step), Some(_)) = (spec.time_step, spec.steps) {
        let detail = "steps are given instead of a time step; give one of them";
        errors.push(Violation::new("/time_step", "conflict", detail, step, Value::Null));
    }
    let fixed = match (spec.time_step, spec.steps) {
        (Some(step), _) => FixedStep::from_time_step(end_time, step),
        (None, steps) => FixedStep::from_steps(end_time, steps.unwrap_or(DEFAULT_STEPS)),
    };
    if !fixed.time_step.is_normal() {
        let detail = "the time step of so many steps to so early an end is too small for a number";
        errors.push(Violation::new("/end_time", "range", detail, end_time, Value::Null));
    }
    if fixed.steps > MOST_STEPS || fixed.steps == 0 {
        let detail = "the run would have too many steps or none";
        let allowed = format!("a number from {} to {end_time}", end_time * 1e-9);
        errors.push(Violation::new("/time_step", "range", detail, json!(spec.time_step), allowed));
    }
    fixed
}

/// When to redistance, and why where `auto` chose it; the spec gets the choice.
fn schedule(spec: &mut Vortex) -> (RedistanceWhen, Option<String>) {
    if spec.redistance == Redistancing::Auto {
        spec.redistance = match spec.field {
            Field::Dual => {
                let why = "for_output: a dual field needs no distance in between";
                Redistancing::ForOutput { chosen: Some(why.to_owned()) }
            }
            Field::Overwrite => {
                let why = "an overwritten level must stay a distance, and every overwriting costs accuracy";
                Redistancing::Every { steps: AUTO_EVERY, chosen: Some(format!("every {AUTO_EVERY} steps: {why}")) }
            }
        };
    }
    match &spec.redistance {
        Redistancing::Every { steps, chosen } => (RedistanceWhen::Every(*steps), chosen.clone()),
        Redistancing::ForOutput { chosen } => (RedistanceWhen::ForOutput, chosen.clone()),
        Redistancing::Auto => (RedistanceWhen::ForOutput, None),
    }
}

impl<const D: usize> VortexScene<D> {
    /// How far from the surface particles are made: over the band, and beyond a thin one what fits need.
    fn reach(&self) -> f64 {
        self.half_band.max(self.method.even_fit_band_h::<D>() * self.lattice.spacing)
    }
}

impl<const D: usize> Scene for VortexScene<D> {
    fn kind(&self) -> &'static str {
        super::KIND.kind
    }

    fn dimension(&self) -> usize {
        D
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.spec.spacing)
    }

    fn size(&self) -> Option<f64> {
        self.surface.as_ref().map(|surface| half_extent(surface.whole.as_ref()))
    }

    fn view(&self) -> View {
        View::DISTANCE
    }

    fn resolved(&self) -> Value {
        scene::resolved(super::KIND.kind, &self.spec)
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        advected_level_set::frame_fields::shown(self.field)
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let surface = self.surface.as_ref().map(|surface| surface.whole.as_ref());
        let particles = shape_particles(surface, sizes.get("/shape"), self.reach(), self.lattice.spacing);
        Estimate {
            particles,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.spec.end_time,
            memory_bytes: memory_bytes::<D>(particles, &self.method),
        }
    }

    fn family(&self) -> String {
        // A rigid motion is known without sines of every place.
        let motion = if flow::<D>(&self.spec, None).is_ok_and(|flow| flow.is_rigid()) { "/rigid" } else { "" };
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
        let flow = flow::<D>(&self.spec, None).ok();
        let cost = flow.as_ref().map_or(1.0, |flow| flow.relative_cost());
        let turn = flow.as_ref().and_then(|flow| flow.return_time());
        let halfway = turn.map(|turn| 0.5 * turn).filter(|half| *half <= end_time);
        let (times, course) = match self.when {
            RedistanceWhen::Every(every) => ((steps / every.max(1)) as f64, Course::EveryStep),
            RedistanceWhen::ForOutput => {
                let frames = work_estimate::frames(steps, end_time, plan) - 1.0;
                (frames + f64::from(u8::from(halfway.is_some())), Course::Milestones)
            }
        };
        let reach_h = self.reach() / self.lattice.spacing;
        // At a few moments of output the surface is as often short as long.
        let surface = self.surface.as_ref().map(|surface| surface.whole.as_ref());
        let stretch = match (surface, &flow) {
            (Some(surface), Some(flow)) if course == Course::EveryStep => {
                front_stretch(surface, flow.as_ref(), end_time).mean
            }
            _ => 1.0,
        };
        let mut work = work_estimate::redistancing::<D>(&self.method, particles, reach_h, stretch, times, course);
        work.push(PhaseWork::every_step("advection", particles * steps as f64 * stages * cost));
        work.push(PhaseWork { phase: "measure", units: particles * times, course });
        let errors = |flow: &dyn Flow<D>| error_units(surface, flow, self.lattice.spacing, particles, end_time);
        work.push(PhaseWork::at_milestones("errors", flow.as_deref().map_or(particles, errors)));
        work.extend(work_estimate::around(particles, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let flow = flow::<D>(&self.spec, flow_data::data(&context.clouds, "/flow"))?;
        let parts = AdvectedParts {
            spacing: self.lattice.spacing,
            half_band: self.half_band,
            integrator: self.integrator,
            field: self.field,
            when: self.when,
            method: self.method.clone(),
        };
        let room = (self.reach(), parts.spacing);
        let surface = self.spec.shape.surface_at_build(self.surface.as_ref(), &context.clouds, room)?;
        let is_read_now = matches!(self.spec.shape, Shape::Mesh { .. }) || self.spec.flow.is_from_outside();
        if let Some(surface) = surface.as_ref().filter(|_| is_read_now)
            && let Some(violation) = check_return(flow.as_ref(), surface.whole.as_ref(), "/flow")
        {
            return Err(vec![violation]);
        }
        let (start, surface) = if let Some(surface) = &surface {
            let start = Start::about(surface.whole.as_ref(), &self.lattice, self.reach(), &context.interrupt);
            (start, Some(surface.boxed()))
        } else {
            let (positions, level) =
                cloud::points_with_levels::<D>(&context.clouds, "/shape").map_err(|found| vec![found])?;
            if let Some(found) = cloud::check_spacing(&positions, parts.spacing) {
                return Err(vec![found]);
            }
            (Start { positions, level }, None)
        };
        let beyond = flow_data::check_places(flow.as_ref(), &start.positions, "/flow");
        if let Some(violation) = beyond.filter(|_| self.spec.flow.is_from_outside()) {
            return Err(vec![violation]);
        }
        let system = AdvectedSystem::new(ExactMotion::new(surface, flow.into()), start, parts, context.interrupt);
        Ok(Box::new(AdvectedLevelSet::new(system, self.fixed, context.plan, context.cpu_clock, self.chosen.clone())))
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{CloudSizes, parse};
    use crate::scenes::SCENES;
    use crate::simulation::OutputPlan;
    use serde_json::{Value, json};

    /// Work of the fits for a scene with everything else equal.
    fn fits(flow: &Value) -> f64 {
        let given = json!({"kind": "vortex", "flow": flow, "end_time": 8, "redistance": {"type": "every", "steps": 1}});
        let scene = parse(&given, SCENES).unwrap_or_else(|found| panic!("{found:?}"));
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
