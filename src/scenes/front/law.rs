//! From the law as a parameter to the law that moves a front.

use super::spec::Law;
use crate::scenes::gbpm_spec::Motion;
use crate::schemes::grid_based_particle::FrontLaw;
use crate::schemes::grid_based_particle::laws::{MeanCurvature, NormalSpeed, PrescribedFlow};
use crate::spec::Violation;
use serde_json::{Value, json};
use std::sync::Arc;

impl Law {
    /// The speed of the rays, where the front is a wave front: a curve in (x, y, θ) instead of a surface.
    pub fn ray_speed(&self) -> Option<f64> {
        match self {
            Self::GeometricalOptics { speed } => Some(*speed),
            Self::Normal { .. } | Self::MeanCurvature | Self::Flow { .. } => None,
        }
    }

    /// What the default parameters of the method depend on.
    pub fn motion(&self) -> Motion {
        match self {
            Self::Flow { .. } => Motion::Flow,
            Self::MeanCurvature => Motion::Curvature,
            Self::Normal { .. } | Self::GeometricalOptics { .. } => Motion::Speed,
        }
    }

    /// The law that moves a surface.
    ///
    /// # Errors
    /// Where the law does not exist in this dimension.
    pub fn for_surface<const D: usize, const M: usize>(&self) -> Result<Arc<dyn FrontLaw<D, M>>, Violation> {
        Ok(match self {
            Self::Normal { speed } => Arc::new(NormalSpeed { speed: *speed }),
            Self::MeanCurvature => Arc::new(MeanCurvature),
            Self::Flow { flow } => Arc::new(PrescribedFlow::<D>::new(flow.flow::<D>()?.into())),
            Self::GeometricalOptics { .. } => {
                let detail = "a wave front is a curve, not a surface of this dimension";
                let allowed = json!(["normal", "mean_curvature", "flow"]);
                return Err(Violation::new("/law/type", "conflict", detail, Value::Null, allowed));
            }
        })
    }
}
