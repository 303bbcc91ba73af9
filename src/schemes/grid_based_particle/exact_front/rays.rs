//! Exact wave fronts of geometrical optics.

use super::{Comparison, ExactFrontMotion, Moment, POINTS_PER_SPACING};
use crate::parallel::Interrupted;
use crate::schemes::grid_based_particle::wavefront::EllipticalWavefront;

impl ExactFrontMotion<3> for EllipticalWavefront {
    fn front_dimension(&self) -> i32 {
        1
    }

    fn compare(&self, moment: &Moment<'_, 3>) -> Result<Option<Comparison<3>>, Interrupted> {
        let chains = vec![self.points(moment.spacing() / POINTS_PER_SPACING, moment.time)];
        let distances = moment.feet.positions.iter().map(|x| self.distance(x, moment.time)).collect();
        Ok(Some(Comparison { distances, chains, samples: Vec::new() }))
    }
}
