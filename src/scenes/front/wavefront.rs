//! A wave front of geometrical optics: a curve in (x, y, θ).

use super::plan::{BYTES, FrontChoice, labels};
use crate::geometry::flows::Rays;
use crate::parallel::Interrupt;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Scene, View};
use crate::scenes::gbpm_spec::GbpmPlan;
use crate::scenes::shapes::{PlainShape, Shape};
use crate::scenes::work_estimate;
use crate::schemes::grid_based_particle::{
    EllipticalWavefront, ExactFrontMotion, FrontParts, FrontSystem, Grid, GridBasedParticles, Law,
};
use crate::simulation::{OutputPlan, Simulation};
use crate::spec::{Choice, Coordinates, Violation};
use crate::time::FixedStep;
use serde_json::{Value, json};

pub(super) struct WavefrontScene {
    /// The kind and the resolved parameters.
    pub resolved: (&'static str, Value),
    pub choice: FrontChoice,
    pub chosen: GbpmPlan,
    pub fixed: FixedStep,
    pub front: EllipticalWavefront,
}

/// The wave front that starts on a circle or an ellipse.
pub(super) fn from_shape(shape: &Shape, speed: f64) -> Result<EllipticalWavefront, Violation> {
    let pair = |numbers: &Coordinates| numbers.first().zip(numbers.get(1)).map(|(x, y)| [*x, *y]);
    let found = match shape {
        Shape::Plain(PlainShape::Circle { center, radius }) => Some((center, [*radius; 2])),
        Shape::Plain(PlainShape::Ellipse { center, semi_axes }) => pair(semi_axes).map(|axes| (center, axes)),
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
        let parts = FrontParts {
            grid: Grid { spacing: self.choice.spacing },
            method: self.chosen.method,
            law: Law::Flow(Box::new(Rays { speed: self.front.speed })),
            integrator: self.choice.integrator,
            topology: self.chosen.topology,
            segments: self.chosen.segments,
            interrupt,
        };
        FrontSystem::of(self.front.foot_points(&parts.grid, &parts.method), parts)
    }
}

impl Scene for WavefrontScene {
    fn kind(&self) -> &'static str {
        self.resolved.0
    }

    fn dimension(&self) -> usize {
        2
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.choice.spacing)
    }

    fn resolved(&self) -> Value {
        self.resolved.1.clone()
    }

    /// A curve in (x, y, θ) is drawn in the plane: rays keep their direction.
    fn view(&self) -> View {
        View::Front { normal: "normal", is_plane: true }
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = vec!["normal", "curvature", "velocity", "grid_point", "level", "segment", "particle_id"];
        if self.chosen.segments.parameter.is_some() {
            names.push("parameter");
        }
        names
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        let particles = self.system(Interrupt::default()).particle_count() as u64;
        Estimate {
            particles,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.choice.end_time,
            memory_bytes: particles.saturating_mul(2 * BYTES),
        }
    }

    fn family(&self) -> String {
        format!("front/optics/{}", self.chosen.method.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let number = particles as f64 * steps as f64;
        let mut work = vec![
            PhaseWork::every_step("front/motion", number),
            PhaseWork::every_step("front/resampling", number * self.chosen.method.neighbors as f64),
            PhaseWork::at_moments("errors", particles as f64),
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
        let said = labels(&self.chosen, self.fixed, None);
        let exact = ExactFrontMotion::Rays(self.front);
        Ok(Box::new(GridBasedParticles::new(system, exact, None, self.fixed, context.cpu_clock, said)))
    }
}
