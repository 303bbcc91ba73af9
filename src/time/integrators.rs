//! Integration of paths dx/dt = u(x, t) in a prescribed flow, one file per scheme.

pub mod dopri5;
pub mod rk4;
pub mod tvd_rk2;

use crate::geometry::{Flow, Vector};
use crate::parallel::{Interrupt, Interrupted};
use std::sync::{Mutex, PoisonError};

/// An integration scheme for paths.
///
/// ```
/// use meniscus::geometry::{Vector, flows::Translation};
/// use meniscus::time::PathIntegrator;
///
/// let flow = Translation { velocity: Vector::<2>::new(1.0, 0.0) };
/// let x = PathIntegrator::Rk4.advance(&flow, &Vector::<2>::zeros(), 0.0, 0.5);
/// assert_eq!(x, Vector::<2>::new(0.5, 0.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PathIntegrator {
    /// The classical fourth-order Runge–Kutta scheme.
    Rk4,
    /// The second-order total-variation-diminishing Runge–Kutta scheme.
    TvdRk2,
    /// The embedded pair of order 5(4) of Dormand 1980, with error control inside each step.
    Dopri5 {
        /// Largest error of one inner step, an absolute length.
        tolerance: f64,
    },
}

/// Points whose paths are integrated together.
pub const PATHS: usize = 64;

/// Why points could not be carried along.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The run was asked to drop the step.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// The flow has no velocity at a place, which the text names.
    #[error("{0}")]
    Undefined(String),
}

/// The longer of two ways, or the first error: a reduction that keeps the order of its terms.
///
/// # Errors
/// Those of the ways.
pub fn longer(a: Result<f64, PathError>, b: Result<f64, PathError>) -> Result<f64, PathError> {
    Ok(a?.max(b?))
}

impl PathIntegrator {
    /// The position at `time + step` of the point that is at `x` at `time`. A negative `step` goes back in time.
    #[must_use]
    pub fn advance<const D: usize>(self, flow: &dyn Flow<D>, x: &Vector<D>, time: f64, step: f64) -> Vector<D> {
        let mut point = [*x];
        self.block::<D, 1>(flow, &mut point, time, step);
        point[0]
    }

    /// Moves any number of points from `time` to `time + step`. Each ends where [`Self::advance`] takes it, to the last bit.
    pub fn advance_all<const D: usize>(self, flow: &dyn Flow<D>, points: &mut [Vector<D>], time: f64, step: f64) {
        for block in points.chunks_mut(PATHS) {
            self.block::<D, PATHS>(flow, block, time, step);
        }
    }

    /// Moves up to [`PATHS`] points and returns the longest of their ways.
    ///
    /// # Errors
    /// A raised interrupt, and a path that meets a place without a velocity. Without an explanation the end of a path may be not
    /// finite.
    pub fn carry<const D: usize>(
        self,
        flow: &dyn Flow<D>,
        points: &mut [Vector<D>],
        time: f64,
        step: f64,
        interrupt: &Interrupt,
    ) -> Result<f64, PathError> {
        interrupt.check()?;
        let mut starts = [Vector::<D>::zeros(); PATHS];
        let starts = &mut starts[..points.len()];
        starts.copy_from_slice(points);
        self.advance_all(flow, points, time, step);
        let mut longest = 0.0_f64;
        for (start, end) in starts.iter().zip(points) {
            let way = (*end - *start).norm_squared();
            if !way.is_finite()
                && let Some(reason) = self.explain(flow, start, time, step)
            {
                return Err(PathError::Undefined(reason));
            }
            longest = longest.max(way);
        }
        Ok(longest.sqrt())
    }

    fn block<const D: usize, const N: usize>(self, flow: &dyn Flow<D>, points: &mut [Vector<D>], time: f64, step: f64) {
        match self {
            Self::Rk4 => rk4::advance::<D, N>(flow, points, time, step),
            Self::TvdRk2 => tvd_rk2::advance::<D, N>(flow, points, time, step),
            Self::Dopri5 { tolerance } => dopri5::advance::<D, N>(flow, points, time, step, tolerance),
        }
    }

    /// Why a path does not end at a finite place, where the flow knows it: the first place on it without a velocity.
    #[must_use]
    pub fn explain<const D: usize>(self, flow: &dyn Flow<D>, x: &Vector<D>, time: f64, step: f64) -> Option<String> {
        let recorder = Recorder { flow, first: Mutex::new(None) };
        let _ = self.advance(&recorder, x, time, step);
        let (place, time) = recorder.first.into_inner().unwrap_or_else(PoisonError::into_inner)?;
        flow.fault(&place, time)
    }
}

/// A flow that remembers the first place where it has no velocity.
struct Recorder<'a, const D: usize> {
    flow: &'a dyn Flow<D>,
    first: Mutex<Option<(Vector<D>, f64)>>,
}

impl<const D: usize> Flow<D> for Recorder<'_, D> {
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D> {
        let velocity = self.flow.velocity(x, time);
        if velocity.iter().any(|component| !component.is_finite()) {
            self.first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert((*x, time));
        }
        velocity
    }

    fn top_speed(&self, low: &Vector<D>, high: &Vector<D>) -> f64 {
        self.flow.top_speed(low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::PathIntegrator;
    use crate::geometry::flows::{Rotation, SingleVortex};
    use crate::geometry::{Flow, Vector};
    use std::sync::atomic::{AtomicU64, Ordering};

    fn end(integrator: PathIntegrator, flow: &dyn Flow<2>, steps: u32) -> Vector<2> {
        let mut x = Vector::<2>::new(0.5, 0.9);
        let dt = 1.0 / f64::from(steps);
        for n in 0..steps {
            x = integrator.advance(flow, &x, f64::from(n) * dt, dt);
        }
        x
    }

    #[test]
    fn orders_by_fitted_slope() {
        let flow = Rotation { center: Vector::<2>::new(0.5, 0.5), angular_velocity: 1.0 };
        let exact = Vector::<2>::new(0.5 - 0.4 * 1.0_f64.sin(), 0.5 + 0.4 * 1.0_f64.cos());
        for (integrator, order) in [(PathIntegrator::Rk4, 4.0), (PathIntegrator::TvdRk2, 2.0)] {
            let error = |steps| (end(integrator, &flow, steps) - exact).norm().log2();
            let slope = (error(8) - error(64)) / 3.0;
            assert!((slope - order).abs() < 0.1, "{integrator:?}: order {slope}");
        }
    }

    #[test]
    fn many_points_end_where_single_ones_do() {
        let flow = SingleVortex { period: Some(8.0) };
        let starts: Vec<Vector<2>> =
            (0..150).map(|k| Vector::<2>::new(0.1 + 0.005 * f64::from(k), 0.9 - 0.003 * f64::from(k))).collect();
        for integrator in [PathIntegrator::Rk4, PathIntegrator::TvdRk2, PathIntegrator::Dopri5 { tolerance: 1e-9 }] {
            let mut ends = starts.clone();
            integrator.advance_all(&flow, &mut ends, 0.5, 1.5);
            for (start, end) in starts.iter().zip(&ends) {
                assert_eq!(integrator.advance(&flow, start, 0.5, 1.5), *end, "{integrator:?}");
            }
        }
    }

    /// A flow that stops before a wall, beyond which there is no velocity.
    struct Walled {
        speed: fn(f64) -> f64,
        calls: AtomicU64,
    }

    impl Flow<2> for Walled {
        fn velocity(&self, x: &Vector<2>, _: f64) -> Vector<2> {
            self.calls.fetch_add(1, Ordering::Relaxed);
            if x[0] < 1.0 { Vector::<2>::new((self.speed)(x[0]), 0.0) } else { Vector::<2>::repeat(f64::NAN) }
        }

        fn top_speed(&self, _: &Vector<2>, _: &Vector<2>) -> f64 {
            1.0
        }
    }

    #[test]
    fn stages_beyond_the_end_of_a_flow_shorten_the_step_and_paths_into_it_end_soon() {
        let integrator = PathIntegrator::Dopri5 { tolerance: 1e-8 };
        let moved = |speed: fn(f64) -> f64| {
            let flow = Walled { speed, calls: AtomicU64::new(0) };
            let end = integrator.advance(&flow, &Vector::<2>::zeros(), 0.0, 5.0);
            (end, flow.calls.into_inner())
        };
        let (near, calls) = moved(|x| 1.0 - x);
        assert!((near[0] - (1.0 - (-5.0_f64).exp())).abs() < 1e-6 && calls < 2000, "{near:?} {calls}");
        let (beyond, calls) = moved(|_| 1.0);
        assert!(beyond[0].is_nan() && calls < 2000, "{beyond:?} {calls}");
    }

    #[test]
    fn adaptive_scheme_keeps_its_tolerance_and_runs_backwards() {
        let flow = SingleVortex { period: Some(8.0) };
        let integrator = PathIntegrator::Dopri5 { tolerance: 1e-11 };
        let x = Vector::<2>::new(0.45, 0.7);
        let there = integrator.advance(&flow, &x, 0.0, 4.0);
        assert!((there - x).norm() > 0.05);
        assert!((integrator.advance(&flow, &there, 4.0, -4.0) - x).norm() < 1e-8);
        assert!((integrator.advance(&flow, &there, 4.0, 4.0) - x).norm() < 1e-8);
    }
}
