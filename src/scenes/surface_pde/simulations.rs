//! The simulation of a planned problem on a cloud.

use super::motions;
use super::problems::{ProblemChoice, start_values};
use super::surfaces::Shape;
use crate::parallel::Interrupt;
use crate::scene::cloud::Clouds;
use crate::scenes::flow_data;
use crate::schemes::surface_equation::{Method, Motion, MovingSurface, SurfaceCloud, SurfaceEquation};
use crate::simulation::{CpuClock, Diagnostic, Finding, Mark, Simulation};
use crate::spec::Violation;
use crate::time::FixedStep;

/// How a run goes.
pub(super) struct Run {
    pub seed: u64,
    pub fixed: FixedStep,
    pub interrupt: Interrupt,
    pub cpu_clock: CpuClock,
    /// What came from outside.
    pub clouds: Clouds,
}

/// What was found about points from outside.
pub(super) struct Outside {
    /// A sentence about them for the report.
    pub origin: String,
    pub findings: Vec<Finding>,
    pub marks: Vec<Mark>,
    pub counted: Vec<Diagnostic>,
}

/// The simulation of a problem on a cloud in D dimensions, M = D − 1.
///
/// # Errors
/// What is wrong with the values at the start.
pub(super) fn build<const D: usize, const M: usize>(
    problem: &ProblemChoice,
    (shape, mut cloud, method): (&Shape, SurfaceCloud<D>, Method),
    Run { seed, fixed, interrupt, cpu_clock, clouds }: Run,
    outside: Option<Outside>,
) -> Result<Box<dyn Simulation>, Vec<Violation>> {
    if let ProblemChoice::Moving { initial, motion, diffusivity, .. } = problem {
        let values = start_values(initial, &cloud)?;
        let velocities = flow_data::data(&clouds, motions::POINTER);
        let parts = motion.parts::<D>(initial, *diffusivity, shape, &values, velocities)?;
        if let Motion::Flow(flow) = &parts.motion
            && let Some(violation) = flow_data::check_places(flow.as_ref(), &cloud.points, motions::POINTER)
        {
            return Err(vec![violation]);
        }
        let moving = MovingSurface::new(cloud, values, parts, fixed, interrupt, cpu_clock);
        return Ok(Box::new(match outside {
            Some(Outside { origin, findings, marks, counted }) => moving.on_points(origin, (findings, marks), counted),
            None => moving,
        }));
    }
    let problem = problem.build(shape, &cloud, seed, fixed.time_step)?;
    // The problem has taken what it needs of them.
    cloud.data.clear();
    let equation = SurfaceEquation::<D, M>::new(cloud, method, problem, fixed, interrupt, cpu_clock);
    Ok(Box::new(match outside {
        Some(Outside { origin, findings, marks, counted }) => {
            equation.on_points(origin, findings, marks).with_preparation(counted)
        }
        None => equation,
    }))
}
