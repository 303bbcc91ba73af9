//! Integration of the path dx/dt = u(x, t) of one point in a prescribed flow, one file per scheme.

pub mod dopri5;
pub mod rk4;
pub mod tvd_rk2;

use crate::geometry::{Flow, Vector};

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

impl PathIntegrator {
    /// The position at `time + step` of the point that is at `x` at `time`. A negative `step` goes back in time.
    #[must_use]
    pub fn advance<const D: usize>(self, flow: &dyn Flow<D>, x: &Vector<D>, time: f64, step: f64) -> Vector<D> {
        match self {
            Self::Rk4 => rk4::advance(flow, x, time, step),
            Self::TvdRk2 => tvd_rk2::advance(flow, x, time, step),
            Self::Dopri5 { tolerance } => dopri5::advance(flow, x, time, step, tolerance),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::PathIntegrator;
    use crate::geometry::flows::{Rotation, SingleVortex};
    use crate::geometry::{Flow, Vector};

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
