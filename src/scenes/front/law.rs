//! From the law as a parameter to the law that moves a front.

use super::spec::Law;
use crate::formulas::FormulaText;
use crate::geometry::Vector;
use crate::geometry::flows::GridData;
use crate::scenes::gbpm_spec::Motion;
use crate::schemes::grid_based_particle::FrontLaw;
use crate::schemes::grid_based_particle::laws::{FormulaSpeed, MeanCurvature, NormalSpeed, PrescribedFlow};
use crate::spec::Violation;
use serde_json::{Value, json};
use std::sync::Arc;

impl Law {
    /// Whether the speed depends on where the front is.
    pub fn depends_on_place(&self) -> bool {
        matches!(self, Self::Flow { .. } | Self::Formula { .. })
    }

    /// The speed of the rays, where the front is a wave front: a curve in (x, y, θ) instead of a surface.
    pub fn ray_speed(&self) -> Option<f64> {
        match self {
            Self::GeometricalOptics { speed } => Some(*speed),
            Self::Normal { .. } | Self::MeanCurvature | Self::Flow { .. } | Self::Formula { .. } => None,
        }
    }

    /// What the default parameters of the method depend on.
    pub fn motion(&self) -> Motion {
        match self {
            Self::Flow { .. } => Motion::Flow,
            Self::MeanCurvature => Motion::Curvature,
            // A parameter k cannot be told from the curvature before names are looked up; it is refused as a name.
            Self::Formula { speed, .. } if mentions_curvature(speed) => Motion::Curvature,
            Self::Normal { .. } | Self::GeometricalOptics { .. } | Self::Formula { .. } => Motion::Speed,
        }
    }

    /// Whether it takes data that are read when a run begins.
    pub fn is_from_outside(&self) -> bool {
        matches!(self, Self::Flow { flow } if flow.is_from_outside())
    }

    /// The law that moves a surface; a flow from data rests before these are read.
    ///
    /// # Errors
    /// Where the law does not exist in this dimension.
    pub fn for_surface<const D: usize, const M: usize>(
        &self,
        end_time: f64,
        flow_pointer: &str,
        extent: (Vector<D>, Vector<D>),
        data: Option<GridData<'_>>,
    ) -> Result<Arc<dyn FrontLaw<D, M>>, Vec<Violation>> {
        Ok(match self {
            Self::Normal { speed } => Arc::new(NormalSpeed { speed: *speed }),
            Self::MeanCurvature => Arc::new(MeanCurvature),
            Self::Formula { speed, parameters } => {
                Arc::new(FormulaSpeed::<D>::new(speed, parameters, extent, end_time, "/law")?)
            }
            Self::Flow { flow } => {
                Arc::new(PrescribedFlow::<D>::new(flow.flow::<D>(end_time, flow_pointer, data)?.into()))
            }
            Self::GeometricalOptics { .. } => {
                let detail = "a wave front is a curve, not a surface of this dimension";
                let allowed = json!(["normal", "mean_curvature", "flow", "formula"]);
                return Err(vec![Violation::new("/law/type", "conflict", detail, Value::Null, allowed)]);
            }
        })
    }
}

/// Whether a formula names the curvature.
fn mentions_curvature(speed: &FormulaText) -> bool {
    speed.0.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).any(|word| word == "k")
}
