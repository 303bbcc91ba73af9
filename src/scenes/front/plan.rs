//! From the spec of a `front` scene to a front and the law that moves it.

use super::choice::{Completed, FrontChoice, FrontPlan, Resolved};
use super::method::{
    BYTES, FrontQuestion, REFINED_BYTES, check_stability, is_within_grid, labels, plan_method, step_plan,
};
use super::spec::{Front, Law};
use super::wavefront;
use crate::geometry::flows::{GridData, Stretch};
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupt;
use crate::scene::cloud::{CloudReference, CloudSizes, Clouds};
use crate::scene::work::PhaseWork;
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::flow_data;
use crate::scenes::flow_return::check_return;
use crate::scenes::flow_work::{error_units, path_units};
use crate::scenes::particle_estimate::{check_extent, shape_particles};
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::scenes::work_estimate;
use crate::schemes::grid_based_particle;
use crate::schemes::grid_based_particle::laws::FrontAtStart;
use crate::schemes::grid_based_particle::{FrontConfig, FrontLaw, FrontSystem, Grid, GridBasedParticles};
use crate::simulation::{OutputPlan, Quantity, Simulation};
use crate::spec::Violation;
use serde_json::{Value, json};
use std::sync::Arc;

/// Cost of an error in space, in tight paths for each particle beyond one: three paths, and those of samples.
const PATHS_IN_SPACE: f64 = 8.0;
/// Reach of the grid beyond the front at the start, in h.
const BAND_H: f64 = 4.0;
/// Largest number of foot points that an estimate counts one by one.
const COUNTED: u64 = 20_000;

struct FrontScene<const D: usize, const M: usize> {
    choice: FrontChoice,
    /// The surface of the shape; none where a mesh from outside tells it.
    surface: Option<ShapeSurface<D>>,
    clouds: Vec<CloudReference>,
    law: Arc<dyn FrontLaw<D, M>>,
    plan: FrontPlan,
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
    if let Shape::Points { .. } = choice.shape {
        let detail = "a front starts from a shape that is known exactly";
        let allowed = json!(["circle", "sphere", "ellipse", "box", "union", "…"]);
        return Err(vec![Violation::new("/shape/type", "conflict", detail, "points", allowed)]);
    }
    let dimension = dimension.or_else(|| choice.shape.dimension()).unwrap_or(2);
    match (choice.law.ray_speed(), dimension) {
        (Some(speed), 3) => wavefront::plan::<3>(choice, speed, complete),
        (Some(speed), _) => wavefront::plan::<2>(choice, speed, complete),
        (None, 3) => plan::<3, 2>(choice, complete),
        (None, _) => plan::<2, 1>(choice, complete),
    }
}

/// 1. Shape. 2. Law. 3. Method, grid and time step.
fn plan<const D: usize, const M: usize>(choice: FrontChoice, complete: impl FnOnce(Completed) -> Resolved) -> Planned {
    let mut errors = Vec::new();
    let mut clouds: Vec<CloudReference> = choice.shape.points_reference("/shape", &mut errors).into_iter().collect();
    if let Law::Flow { flow } = &choice.law {
        clouds.extend(flow_data::reference(flow, choice.flow_pointer(), &mut errors));
    }
    let mut surface = None;
    if !choice.shape.is_from_outside() {
        surface = choice.shape.surface::<D>("/shape").map_err(|found| errors.extend(found)).ok();
    }
    let whole = surface.as_ref().map(|surface| surface.whole.as_ref());
    errors.extend(whole.and_then(|whole| check_extent(whole, BAND_H * choice.spacing, choice.spacing)));
    let extent = whole.map(Surface::bounding_box);
    let law = law_about::<D, M>(&choice, whole, None);
    errors.extend(law.as_ref().err().into_iter().flatten().cloned());
    let question = FrontQuestion {
        law: law.as_deref().ok(),
        extent,
        dimension: D,
        is_within_grid: &|levels| extent.is_none_or(|extent| is_within_grid(extent, choice.spacing, levels)),
    };
    let plan = plan_method(&choice, &question, complete, errors)?;
    let law = law?;
    Ok(Box::new(FrontScene { choice, surface, clouds, law, plan }))
}

/// The law that moves a front about a surface; about the unit box where that is not known yet.
fn law_about<const D: usize, const M: usize>(
    choice: &FrontChoice,
    surface: Option<&dyn Surface<D>>,
    data: Option<GridData<'_>>,
) -> Result<Arc<dyn FrontLaw<D, M>>, Vec<Violation>> {
    let flow_pointer = choice.flow_pointer();
    let about = surface.map_or((Vector::<D>::zeros(), Vector::<D>::repeat(1.0)), Surface::bounding_box);
    let law = choice.law.for_surface::<D, M>(choice.end_time, flow_pointer, about, data)?;
    match surface.and_then(|surface| check_return(law.flow()?, surface, flow_pointer)) {
        Some(violation) => Err(vec![violation]),
        None => Ok(law),
    }
}

impl<const D: usize, const M: usize> FrontScene<D, M> {
    /// The law at the start of a run: that about a mesh, and that by data, are known only then.
    fn law_at_build(
        &self,
        surface: &ShapeSurface<D>,
        clouds: &Clouds,
    ) -> Result<Arc<dyn FrontLaw<D, M>>, Vec<Violation>> {
        if self.surface.is_some() && !self.choice.law.is_from_outside() {
            return Ok(Arc::clone(&self.law));
        }
        let data = flow_data::data(clouds, self.choice.flow_pointer());
        let law = law_about::<D, M>(&self.choice, Some(surface.whole.as_ref()), data)?;
        let steps = step_plan(&self.choice, D, Some(surface.whole.bounding_box()));
        match check_stability(&self.choice, Some(law.as_ref()), self.plan.fixed, &steps) {
            Some(violation) => Err(vec![violation]),
            None => Ok(law),
        }
    }

    /// The front at the start.
    fn system(
        &self,
        law: &Arc<dyn FrontLaw<D, M>>,
        surface: &ShapeSurface<D>,
        interrupt: Interrupt,
    ) -> FrontSystem<D, M> {
        let chosen = &self.plan.chosen;
        let config = FrontConfig {
            grid: Grid { spacing: self.choice.spacing },
            method: chosen.method,
            law: Arc::clone(law),
            integrator: self.choice.integrator,
            topology: chosen.topology,
            segments: chosen.segments,
            interrupt,
        };
        FrontSystem::from_surfaces(&surface.boxed_parts(), config)
    }

    /// The shape of the front at the start.
    fn start(&self, surface: &ShapeSurface<D>) -> FrontAtStart<D> {
        FrontAtStart {
            surface: surface.boxed(),
            parts: surface.boxed_parts(),
            ball: self.choice.shape.as_ball::<D>(),
            topology: self.plan.chosen.topology,
        }
    }

    /// How many times larger the front becomes; no larger where its shape is not known.
    fn stretch(&self, surface: Option<&ShapeSurface<D>>) -> Stretch {
        surface.map_or(Stretch::NONE, |surface| self.law.stretch(&self.start(surface), self.choice.end_time))
    }
}

impl<const D: usize, const M: usize> Scene for FrontScene<D, M> {
    fn kind(&self) -> &'static str {
        self.plan.resolved.0
    }

    fn dimension(&self) -> usize {
        D
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.choice.spacing)
    }

    fn view(&self) -> View {
        View::Front { normal: "normal", is_plane: D == 2 }
    }

    fn resolved(&self) -> Value {
        self.plan.resolved.1.clone()
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        grid_based_particle::frame_fields::shown(D, false, &self.plan.chosen.segments)
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        // On the coarsest level; where there are not many, as the grid is refined.
        let reach = self.plan.chosen.method.tube_radius * self.choice.spacing;
        let known = self.surface.as_ref();
        let whole = known.map(|surface| surface.whole.as_ref());
        let about = shape_particles(whole, sizes.get("/shape"), reach, self.choice.spacing);
        // Corners without foot points matter where there are few.
        let counted =
            known.filter(|_| about < COUNTED).map(|surface| self.system(&self.law, surface, Interrupt::default()));
        let at_start = counted.map_or(about, |system| system.particle_count() as u64);
        let most = (at_start as f64 * self.stretch(known).most) as u64;
        Estimate {
            particles: at_start,
            steps: self.plan.fixed.steps,
            time_step: self.plan.fixed.time_step,
            end_time: self.choice.end_time,
            memory_bytes: most.saturating_mul(if self.plan.chosen.method.levels() > 1 { REFINED_BYTES } else { BYTES }),
        }
    }

    fn family(&self) -> String {
        let refined = if self.plan.chosen.method.levels() > 1 { "/refined" } else { "" };
        format!("front/{D}/{}/{}{refined}", self.law.name(), self.plan.chosen.method.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let number = particles as f64 * self.stretch(self.surface.as_ref()).mean * steps as f64;
        let exact = match self.law.flow() {
            Some(flow) => {
                let finest = Grid { spacing: self.choice.spacing }.spacing_at(self.plan.chosen.method.levels() - 1);
                let beside = if D == 3 { PATHS_IN_SPACE * particles as f64 } else { 0.0 };
                error_units(
                    self.surface.as_ref().map(|surface| surface.whole.as_ref()),
                    flow,
                    finest,
                    particles as f64,
                    end_time,
                ) + path_units(flow, beside, end_time)
            }
            None => particles as f64,
        };
        // Rows of a fit for each of its particles.
        let rows = if self.plan.chosen.method.normal_weight > 0.0 { 1 + M } else { 1 };
        let mut work = vec![
            PhaseWork::every_step("front/motion", number),
            PhaseWork::every_step("front/resampling", number * (self.plan.chosen.method.neighbors * rows) as f64),
            PhaseWork::every_step("front/topology", number),
            PhaseWork::at_milestones("errors", exact),
        ];
        work.extend(work_estimate::around(particles as f64, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let room = (BAND_H * self.choice.spacing, self.choice.spacing);
        let surface = self.choice.shape.surface_at_build(self.surface.as_ref(), &context.clouds, room)?;
        let Some(surface) = surface else {
            let detail = "a front starts from a shape with a surface";
            return Err(vec![Violation::new("/shape", "conflict", detail, Value::Null, Value::Null)]);
        };
        let law = self.law_at_build(&surface, &context.clouds)?;
        let system = self.system(&law, &surface, context.interrupt);
        if system.particle_count() == 0 {
            let detail = "no grid point of this spacing has a foot-point on the shape";
            return Err(vec![Violation::new("/spacing", "range", detail, self.choice.spacing, Value::Null)]);
        }
        let FrontPlan { chosen, fixed, .. } = &self.plan;
        let labels = labels(chosen, *fixed, law.particles_in_bends());
        let start = self.start(&surface);
        let ball = start.ball.clone();
        let exact = law.exact_motion(start);
        let simulation = GridBasedParticles::new(system, exact, ball, *fixed, context.cpu_clock, labels);
        Ok(Box::new(simulation.with_stretch(self.stretch(Some(&surface)).most)))
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{CloudSizes, Scene, parse};
    use crate::scenes::SCENES;
    use serde_json::{Value, json};

    fn scene(more: &Value) -> Box<dyn Scene> {
        let mut body = json!({"kind": "front"});
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        parse(&body, SCENES).unwrap_or_else(|found| panic!("{body}: {found:?}"))
    }

    /// Calibrations of costs are kept under these names.
    #[test]
    fn families_are_those_of_the_laws() {
        let ellipse = json!({"type": "ellipse", "center": [0, 0], "semi_axes": [2, 1]});
        let optics = json!({"law": "geometrical_optics", "shape": ellipse, "spacing": 0.1});
        let sphere = json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.25});
        let refined = json!({"law": "flow", "adaptivity": {"levels": 2}, "spacing": 0.02});
        for (more, family) in [
            (json!({}), "front/2/normal/4"),
            (json!({"law": "mean_curvature", "end_time": 0.001}), "front/2/mean_curvature/4"),
            (refined, "front/2/flow/4/refined"),
            (json!({"shape": sphere, "spacing": 0.05}), "front/3/normal/2"),
            (optics, "front/optics/4"),
        ] {
            assert_eq!(scene(&more).family(), family, "{more}");
        }
    }

    #[test]
    fn default_steps_are_those_of_the_laws() {
        let step = |more: &Value| scene(more).estimate(&CloudSizes::new()).time_step;
        let spacing = 1.0 / 128.0;
        // Steps are rounded down to a whole number of them.
        let is_about = |found: f64, limit: f64| found <= limit * (1.0 + 1e-9) && found > 0.8 * limit;
        assert!(is_about(step(&json!({})), 0.75 * spacing));
        assert!(is_about(step(&json!({"law": "mean_curvature"})), 0.5 * spacing * spacing));
        assert!(is_about(step(&json!({"law": "flow", "end_time": 8})), 10.0 * spacing));
        assert!((step(&json!({"time_step": 0.01})) - 0.01).abs() < 1e-15);
    }

    #[test]
    fn a_flow_of_space_in_the_plane_is_refused_with_what_exists_there() {
        let law = json!({"type": "flow", "flow": "vortex_3d"});
        let found = parse(&json!({"kind": "front", "law": law}), SCENES).err().unwrap();
        assert_eq!(found[0].pointer, "/law/flow/type");
    }
}
