//! Prescribed velocity fields u(x, t), one file per flow.

pub mod rays;
pub mod rotation;
pub mod single_vortex;
pub mod translation;
pub mod vortex_3d;

pub use rays::Rays;
pub use rotation::Rotation;
pub use single_vortex::SingleVortex;
pub use translation::Translation;
pub use vortex_3d::Vortex3d;

use super::Vector;

/// How many times longer (or larger) a flow makes a front, relative to the front at time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Mean over the time of the run.
    pub mean: f64,
    /// Maximum over the time of the run.
    pub most: f64,
}

impl Stretch {
    /// The stretch of a front that keeps its size.
    pub const NONE: Self = Self { mean: 1.0, most: 1.0 };
}

/// A velocity field known everywhere at every time.
///
/// A flow answers all questions about itself, so no other code needs to know which flow it is. Methods with a default
/// state what holds for most flows.
pub trait Flow<const D: usize>: Send + Sync {
    /// Velocity u(x, t).
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D>;

    /// An upper bound of |u| at all times over the points that start in the box from `low` to `high`. It limits time
    /// steps.
    fn top_speed(&self, low: &Vector<D>, high: &Vector<D>) -> f64;

    /// Position that a rigid motion gives `x` after `duration`, by its formula; None where the motion is not rigid.
    fn rigid_path(&self, _x: &Vector<D>, _duration: f64) -> Option<Vector<D>> {
        None
    }

    /// Whether the motion keeps all distances.
    fn is_rigid(&self) -> bool {
        self.rigid_path(&Vector::<D>::zeros(), 0.0).is_some()
    }

    /// The period after which the flow has brought every point back to its start; None for a flow that never does.
    fn return_time(&self) -> Option<f64> {
        None
    }

    /// Whether the flow has brought every point back to its start at `time`.
    fn is_back(&self, time: f64) -> bool {
        self.return_time().is_some_and(|period| {
            let turns = time / period;
            (turns - turns.round()).abs() < 1e-9
        })
    }

    /// The stretch of a typical front, for estimates of cost where carrying an outline along cannot measure it.
    fn typical_stretch(&self) -> Option<Stretch> {
        None
    }
}

/// Support for the tests of flows.
#[cfg(test)]
mod sampling {
    use super::Flow;
    use crate::geometry::Vector;
    use crate::geometry::random::CounterRandom;

    /// Particles that start in the box and the instants at which the speed of each is looked at.
    const PATHS: i64 = 400;
    const INSTANTS: i64 = 40;

    /// The largest speed along the paths of random particles that start in a box, until `end_time`.
    pub fn top_speed<const D: usize>(flow: &dyn Flow<D>, low: &Vector<D>, high: &Vector<D>, end_time: f64) -> f64 {
        let random = CounterRandom::new(7);
        let step = end_time / INSTANTS as f64;
        let mut largest = 0.0_f64;
        for path in 0..PATHS {
            let mut x = Vector::<D>::from_fn(|d, _| {
                let share = 0.5 + 0.5 * random.symmetric(&[path, d as i64]);
                low[d] + share * (high[d] - low[d])
            });
            for instant in 0..INSTANTS {
                let time = instant as f64 * step;
                largest = largest.max(flow.velocity(&x, time).norm());
                let middle = x + flow.velocity(&x, time) * (0.5 * step);
                x += flow.velocity(&middle, time + 0.5 * step) * step;
            }
        }
        largest
    }
}
