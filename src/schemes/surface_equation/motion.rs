//! How the points of a moving surface move.

use crate::geometry::{Flow, Vector};
use crate::parallel::Interrupt;
use crate::time::PathIntegrator;
use crate::time::integrators::{PATHS, PathError, longer};
use rayon::prelude::{ParallelIterator, ParallelSliceMut};

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

impl<const D: usize> Motion<D> {
    /// Where points are after a step, where that does not depend on the surface; else where they are.
    ///
    /// # Errors
    /// A raised interrupt, and a path that meets a place without a velocity.
    pub fn moved(
        &self,
        points: &[Vector<D>],
        time: f64,
        step: f64,
        interrupt: &Interrupt,
    ) -> Result<Vec<Vector<D>>, PathError> {
        let mut moved = points.to_vec();
        match self {
            Self::Normal { .. } => {}
            Self::Expansion { rate, center } => {
                let factor = (rate * step).exp();
                moved.iter_mut().for_each(|x| *x = center + (*x - center) * factor);
            }
            Self::Flow(flow) => {
                moved
                    .par_chunks_mut(PATHS)
                    .map(|block| PathIntegrator::Rk4.carry(flow.as_ref(), block, time, step, interrupt))
                    .reduce(|| Ok(0.0), longer)?;
            }
        }
        Ok(moved)
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
