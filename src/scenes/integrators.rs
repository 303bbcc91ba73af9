//! Integrators of the paths of particles as parameters, shared by the scenes of moving fronts.

use crate::spec::Interval;
use crate::time::PathIntegrator;

/// Tolerances that double precision can keep.
const TOLERANCE: Interval = Interval::at_least(1e-15).and_at_most(1.0);

crate::choice! {
    /// An integrator of the paths of particles.
    pub enum IntegratorChoice {
        /// the classical Runge–Kutta method of order 4
        Rk4 = "rk4",
        /// the TVD Runge–Kutta method of order 2
        TvdRk2 = "tvd_rk2",
        /// Dormand–Prince 5(4) with error control inside each step
        Dopri5 = "dopri5" {
            /// error of an inner step
            tolerance: f64 = 1e-9, in TOLERANCE;
        }
    }
}

impl IntegratorChoice {
    /// The path integrator of the choice.
    #[must_use]
    pub fn path_integrator(&self) -> PathIntegrator {
        match *self {
            Self::Rk4 => PathIntegrator::Rk4,
            Self::TvdRk2 => PathIntegrator::TvdRk2,
            Self::Dopri5 { tolerance } => PathIntegrator::Dopri5 { tolerance },
        }
    }
}
