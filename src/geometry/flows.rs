//! Prescribed velocity fields u(x, t). One file a flow.

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

/// A velocity field known everywhere at every time.
pub trait Flow<const D: usize>: Send + Sync {
    /// u(x, t).
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D>;

    /// Where a rigid motion carries `x` during `duration`, by its formula; None where the motion is not rigid.
    fn rigid_path(&self, _x: &Vector<D>, _duration: f64) -> Option<Vector<D>> {
        None
    }

    /// Whether the motion keeps all distances.
    fn is_rigid(&self) -> bool {
        self.rigid_path(&Vector::<D>::zeros(), 0.0).is_some()
    }

    /// The time at which the flow has brought every point back to its start, if it does.
    fn return_time(&self) -> Option<f64>;

    /// Whether the flow has brought every point back to its start.
    fn is_back(&self, time: f64) -> bool {
        self.return_time().is_some_and(|period| {
            let turns = time / period;
            (turns - turns.round()).abs() < 1e-9
        })
    }
}
