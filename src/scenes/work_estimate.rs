//! What redistancing, output and the rest of a run cost, in units of about one inner loop's turn.

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::polynomials::Solver;
use crate::polynomials::multi_index::term_count;
use crate::scene::work::{Course, PhaseWork};
use crate::simulation::OutputPlan;

/// Everything that is not booked to a phase: reading, building the particles, writing the report and the picture.
pub const REST: &str = "rest";

/// What of a method decides what a unit of its work costs.
#[must_use]
pub fn method_name(method: &PcpMethod) -> String {
    let neighborhood = match method.neighborhood {
        NeighborhoodChoice::Radius { .. } => "radius",
        NeighborhoodChoice::Nearest { .. } => "nearest",
        NeighborhoodChoice::Material { .. } => "material",
    };
    let solver = if method.solver == Solver::Moments { "moments" } else { "orthogonal" };
    format!("{neighborhood}/{solver}")
}

/// Redistancings of `particles` in a band of half width `reach_h` spacings, `times` over, of a surface that a flow has made
/// longer by `stretch` on the average.
#[must_use]
pub fn redistancing<const D: usize>(
    method: &PcpMethod,
    particles: f64,
    reach_h: f64,
    stretch: f64,
    times: f64,
    course: Course,
) -> Vec<PhaseWork> {
    let terms = term_count::<D>(method.degree) as f64;
    let moments = term_count::<D>(2 * method.degree) as f64;
    let samples = particles * (stretch * method.sample_threshold_h / reach_h).min(1.0);
    let ball = if D == 2 { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
    let neighbors = ball * method.even_cutoff_h::<D>().powi(D as i32);
    // Material fits are of the level and of every coordinate.
    let fields = if let NeighborhoodChoice::Material { .. } = method.neighborhood { 1.0 + D as f64 } else { 1.0 };
    // By the neighbor: gathering, moments and right-hand sides in vector lanes; the factorization; or Householder's
    // reflections. A unit is about a nanosecond, as measured over degrees 3 to 6 in two and three dimensions.
    let fit = match method.solver {
        Solver::Moments => neighbors * (40.0 + 0.3 * moments + 0.5 * fields * terms) + 0.02 * terms.powi(3),
        Solver::Orthogonal => (if D == 2 { 1.7 } else { 0.9 }) * neighbors * terms.powi(2),
    };
    // The search for the nearest sample, and a few Newton steps with gradient and Hessian.
    let query = 300.0 + 5.0 * fields * terms;
    let phase = |phase: &'static str, units: f64| PhaseWork { phase, units: units * times, course };
    vec![
        phase("redistancing/detection", particles),
        phase("redistancing/regression", samples * fit),
        phase("redistancing/query", particles * query),
        phase("redistancing/store", particles),
    ]
}

/// Frames of a run, the first and the last included.
#[must_use]
pub fn frames(steps: u64, end_time: f64, plan: &OutputPlan) -> f64 {
    let every = plan.every_time.unwrap_or(f64::INFINITY);
    let between = (end_time / every - 1e-9).floor().min(steps as f64 - 1.0);
    between.max(0.0) + 2.0
}

/// Frames, one checkpoint and everything else that is done once, for a run of so many particles and steps.
#[must_use]
pub fn around(particles: f64, steps: u64, end_time: f64, plan: &OutputPlan) -> [PhaseWork; 3] {
    let frames = frames(steps, end_time, plan);
    [
        PhaseWork::at_milestones("output", frames * (particles + FRAME_OVERHEAD)),
        PhaseWork::at_milestones("checkpoint", particles + FRAME_OVERHEAD),
        PhaseWork::at_milestones(REST, particles + FRAME_OVERHEAD),
    ]
}

/// Particles whose writing takes as long as a file's opening and closing.
const FRAME_OVERHEAD: f64 = 6000.0;
