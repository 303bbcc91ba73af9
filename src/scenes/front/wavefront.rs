//! A wave front of geometrical optics: a curve in (x, y, θ).

use super::setup::{BYTES, FrontChoice, labels};
use crate::geometry::flows::Rays;
use crate::parallel::Interrupt;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Scene, Violation};
use crate::scenes::gbpm_parameters::Chosen;
use crate::scenes::work_estimate;
use crate::schemes::grid_based_particle::{
    EllipticalWavefront, ExactFrontMotion, FrontParts, FrontSystem, Grid, GridBasedParticles, Law,
};
use crate::simulation::{OutputPlan, Simulation};
use crate::time::FixedStep;
use serde_json::{Value, json};

pub(super) struct WavefrontScene {
    pub resolved: Value,
    pub choice: FrontChoice,
    pub chosen: Chosen,
    pub fixed: FixedStep,
    pub front: EllipticalWavefront,
}

/// The wave front that starts on a checked circle or ellipse.
pub(super) fn of_shape(shape: &Value, speed: f64) -> Result<EllipticalWavefront, Violation> {
    let pair = |name: &str| {
        let numbers = shape.get(name).and_then(Value::as_array);
        numbers.and_then(|numbers| Some([numbers.first()?.as_f64()?, numbers.get(1)?.as_f64()?]))
    };
    let radius = || shape.get("radius").and_then(Value::as_f64).map(|radius| [radius; 2]);
    let is_known = shape["type"] == "circle" || shape["type"] == "ellipse";
    match pair("semi_axes").or_else(radius).filter(|_| is_known) {
        Some(semi_axes) => Ok(EllipticalWavefront { center: pair("center").unwrap_or_default(), semi_axes, speed }),
        None => {
            let detail = "geometrical_optics starts from a shape whose directions are known, in the plane";
            Err(Violation::new("/shape/type", "conflict", detail, &shape["type"], json!(["circle", "ellipse"])))
        }
    }
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
    fn resolved(&self) -> Value {
        self.resolved.clone()
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
            return Err(vec![Violation::new("/spacing", "range", detail, &json!(self.choice.spacing), Value::Null)]);
        }
        let said = labels(&self.chosen, self.fixed, None);
        let exact = ExactFrontMotion::Rays(self.front);
        Ok(Box::new(GridBasedParticles::new(system, exact, None, self.fixed, context.cpu_clock, said)))
    }
}
