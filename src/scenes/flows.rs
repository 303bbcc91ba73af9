//! Velocity fields and path integrators as parameters, shared by the scenes of moving fronts.

use crate::geometry::flows::{Rotation, SingleVortex, Translation, Vortex3d};
use crate::geometry::{Flow, Vector};
use crate::scenes::dimension::in_dimension;
use crate::spec::{Choice, Coordinates, Interval, POSITIVE, Parameter, Violation};
use crate::time::PathIntegrator;
use serde_json::json;

crate::choice! {
    /// A velocity field.
    pub enum FlowChoice {
        /// the spiraling vortex in the unit square (2D)
        SingleVortex = "single_vortex" {
            /// time T after which everything is back; null: the flow never turns
            period: Option<f64> = Some(8.0), in POSITIVE;
        }
        /// the deforming flow in the unit cube (3D)
        Vortex3d = "vortex_3d" {
            /// time T after which everything is back; null: the flow never turns
            period: Option<f64> = Some(2.0), in POSITIVE;
        }
        /// rigid rotation about a point in the x–y plane
        Rotation = "rotation" {
            /// fixed point
            center: Coordinates;
            /// angular velocity, counter-clockwise
            angular_velocity: f64;
        }
        /// uniform motion
        Translation = "translation" {
            /// velocity
            velocity: Coordinates;
        }
    }
}

impl FlowChoice {
    /// The velocity field in `D` dimensions.
    ///
    /// # Errors
    /// Where it does not exist in this dimension.
    pub fn flow<const D: usize>(&self) -> Result<Box<dyn Flow<D>>, Violation> {
        match self {
            Self::SingleVortex { period } => {
                let vortex: Box<dyn Flow<2>> = Box::new(SingleVortex { period: *period });
                in_dimension(vortex).ok_or_else(|| self.exists_elsewhere::<D>("the plane"))
            }
            Self::Vortex3d { period } => {
                let vortex: Box<dyn Flow<3>> = Box::new(Vortex3d { period: *period });
                in_dimension(vortex).ok_or_else(|| self.exists_elsewhere::<D>("space"))
            }
            Self::Rotation { center, angular_velocity } => {
                Ok(Box::new(Rotation { center: vector("center", center)?, angular_velocity: *angular_velocity }))
            }
            Self::Translation { velocity } => Ok(Box::new(Translation { velocity: vector("velocity", velocity)? })),
        }
    }

    fn exists_elsewhere<const D: usize>(&self, place: &str) -> Violation {
        let detail = format!("{} is a flow of {place}, the scene has {D} dimensions", self.name());
        let here = if D == 2 { "single_vortex" } else { "vortex_3d" };
        Violation::new("/flow/type", "conflict", detail, self.name(), json!([here, "rotation", "translation"]))
    }
}

fn vector<const D: usize>(name: &str, numbers: &Coordinates) -> Result<Vector<D>, Violation> {
    if numbers.len() == D {
        return Ok(Vector::<D>::from_column_slice(numbers));
    }
    let (at, detail) = (format!("/flow/{name}"), format!("the scene has {D} dimensions"));
    Err(Violation::new(at, "conflict", detail, numbers.to_json(), json!(format!("{D} numbers"))))
}

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
    /// The integrator.
    #[must_use]
    pub fn path_integrator(&self) -> PathIntegrator {
        match *self {
            Self::Rk4 => PathIntegrator::Rk4,
            Self::TvdRk2 => PathIntegrator::TvdRk2,
            Self::Dopri5 { tolerance } => PathIntegrator::Dopri5 { tolerance },
        }
    }
}
