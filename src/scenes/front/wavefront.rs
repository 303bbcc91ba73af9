//! A wave front of geometrical optics: a curve in (x, y, θ).

use super::choice::{Completed, FrontChoice, FrontPlan, Resolved};
use super::method::{BYTES, FrontQuestion, is_within_grid, labels, plan_method};
use crate::parallel::Interrupt;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Planned, Scene, View};
use crate::scenes::particle_estimate::check_extent;
use crate::scenes::shapes::{PlainShape, Shape};
use crate::scenes::work_estimate;
use crate::schemes::grid_based_particle;
use crate::schemes::grid_based_particle::laws::GeometricalOptics;
use crate::schemes::grid_based_particle::{
    EllipticalWavefront, FrontConfig, FrontLaw, FrontSystem, Grid, GridBasedParticles,
};
use crate::simulation::{OutputPlan, Quantity, Simulation};
use crate::spec::{Choice, Coordinates, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

/// The longest wave front, in spacings.
const MOST_CURVE: f64 = 1e6;

struct WavefrontScene {
    choice: FrontChoice,
    front: EllipticalWavefront,
    law: Arc<GeometricalOptics>,
    plan: FrontPlan,
}

/// A wave front that starts on a shape of D dimensions.
pub(super) fn plan<const D: usize>(
    choice: FrontChoice,
    speed: f64,
    complete: impl FnOnce(Completed) -> Resolved,
) -> Planned {
    let mut errors = Vec::new();
    match choice.shape.surface::<D>("/shape") {
        Ok(surface) => errors.extend(check_extent(surface.whole.as_ref(), 4.0 * choice.spacing, choice.spacing)),
        Err(found) => errors.extend(found),
    }
    let front = from_shape(&choice.shape, speed);
    errors.extend(front.as_ref().err().cloned());
    let law = GeometricalOptics::new(speed);
    let is_within_grid = |levels: u32| {
        front.as_ref().map_or(true, |front| {
            let is_short = front.length() < MOST_CURVE * choice.spacing;
            is_short && is_within_grid(front.bounding_box(choice.end_time), choice.spacing, levels)
        })
    };
    let question = FrontQuestion { law: Some(&law), extent: None, dimension: D, is_within_grid: &is_within_grid };
    let plan = plan_method(&choice, &question, complete, errors)?;
    let front = front.map_err(|found| vec![found])?;
    Ok(Box::new(WavefrontScene { choice, front, law: Arc::new(law), plan }))
}

/// The wave front that starts on a circle or an ellipse.
fn from_shape(shape: &Shape, speed: f64) -> Result<EllipticalWavefront, Violation> {
    let pair = |numbers: &Coordinates| numbers.first().zip(numbers.get(1)).map(|(x, y)| [*x, *y]);
    let found = match shape.as_plain() {
        Some(PlainShape::Circle { center, radius }) => Some((center, [*radius; 2])),
        Some(PlainShape::Ellipse { center, semi_axes }) => pair(semi_axes).map(|axes| (center, axes)),
        _ => None,
    };
    let Some((center, semi_axes)) = found else {
        let detail = "geometrical_optics starts from a shape whose directions are known, in the plane";
        let allowed = json!(["circle", "ellipse"]);
        return Err(Violation::new("/shape/type", "conflict", detail, shape.name(), allowed));
    };
    let center = center.as_ref().and_then(pair).unwrap_or_default();
    Ok(EllipticalWavefront { center, semi_axes, speed })
}

impl WavefrontScene {
    fn system(&self, interrupt: Interrupt) -> FrontSystem<3, 1> {
        let chosen = &self.plan.chosen;
        let config = FrontConfig {
            grid: Grid { spacing: self.choice.spacing },
            method: chosen.method,
            law: Arc::<GeometricalOptics>::clone(&self.law),
            integrator: self.choice.integrator,
            topology: chosen.topology,
            segments: chosen.segments,
            interrupt,
        };
        FrontSystem::new(self.front.foot_points(&config.grid, &config.method), config)
    }
}

impl Scene for WavefrontScene {
    fn kind(&self) -> &'static str {
        self.plan.resolved.0
    }

    fn dimension(&self) -> usize {
        2
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.choice.spacing)
    }

    /// A curve in (x, y, θ) is drawn in the plane: rays keep their direction.
    fn view(&self) -> View {
        View::Front { normal: "normal", is_plane: true }
    }

    fn resolved(&self) -> Value {
        self.plan.resolved.1.clone()
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        grid_based_particle::frame_fields::shown(3, true, &self.plan.chosen.segments)
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        let particles = self.system(Interrupt::default()).particle_count() as u64;
        Estimate {
            particles,
            steps: self.plan.fixed.steps,
            time_step: self.plan.fixed.time_step,
            end_time: self.choice.end_time,
            memory_bytes: particles.saturating_mul(2 * BYTES),
        }
    }

    fn family(&self) -> String {
        format!("front/{}/{}", self.law.name(), self.plan.chosen.method.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let number = particles as f64 * steps as f64;
        let mut work = vec![
            PhaseWork::every_step("front/motion", number),
            PhaseWork::every_step("front/resampling", number * self.plan.chosen.method.neighbors as f64),
            PhaseWork::at_milestones("errors", particles as f64),
        ];
        work.extend(work_estimate::around(particles as f64, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let system = self.system(context.interrupt);
        if system.particle_count() <= 2 {
            let detail = "no grid point of this spacing has a foot-point on the curve";
            return Err(vec![Violation::new("/spacing", "range", detail, self.choice.spacing, Value::Null)]);
        }
        let FrontPlan { chosen, fixed, .. } = &self.plan;
        let labels = labels(chosen, *fixed, self.law.particles_in_bends());
        let exact = Box::new(self.front);
        Ok(Box::new(GridBasedParticles::new(system, exact, None, *fixed, context.cpu_clock, labels)))
    }
}
