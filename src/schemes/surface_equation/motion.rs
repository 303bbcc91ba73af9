//! How the points of a moving surface move.

use crate::geometry::{Flow, Vector};
use crate::time::PathIntegrator;
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};

/// The motion of a surface.
pub enum Motion<const D: usize> {
    /// Along the normals of the surface.
    Normal {
        /// Speed, outward.
        speed: f64,
    },
    /// v = a (x − c).
    Expansion {
        /// a.
        rate: f64,
        /// c.
        center: Vector<D>,
    },
    /// With a flow.
    Flow(Box<dyn Flow<D>>),
}

/// Points of a parallel task.
const POINTS: usize = 256;

impl<const D: usize> Motion<D> {
    /// Where points are after a step, where that does not depend on the surface; else where they are.
    #[must_use]
    pub fn moved(&self, points: &[Vector<D>], time: f64, step: f64) -> Vec<Vector<D>> {
        match self {
            Self::Normal { .. } => points.to_vec(),
            Self::Expansion { rate, center } => {
                let factor = (rate * step).exp();
                points.iter().map(|x| center + (x - center) * factor).collect()
            }
            Self::Flow(flow) => points
                .par_iter()
                .with_min_len(POINTS)
                .map(|x| PathIntegrator::Rk4.advance(flow.as_ref(), x, time, step))
                .collect(),
        }
    }

    /// What it is, for reports.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Normal { speed } => format!("along normals at speed {speed}"),
            Self::Expansion { rate, .. } => format!("expansion at rate {rate}"),
            Self::Flow(_) => "with a flow".to_owned(),
        }
    }
}
