//! Fronts for the tests of this room.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use super::grid::Grid;
use super::laws::FrontLaw;
use super::method::FrontMethod;
use super::placement::Placement;
use super::refinement::Refinement;
use super::segments::Segments;
use super::topology::Topology;
use crate::geometry::Surface;
use crate::geometry::surfaces::Ball;
use crate::geometry::{Flow, Vector};
use crate::parallel::Interrupt;
use crate::time::PathIntegrator;
use std::sync::Arc;

/// h of the fixtures.
pub const SPACING: f64 = 0.02;

/// A front with the parameters of the paper, moved by a law.
pub fn config<const D: usize, const M: usize>(law: impl FrontLaw<D, M> + 'static) -> FrontConfig<D, M> {
    let method = FrontMethod {
        degree: 2,
        neighbors: if D == 2 { 6 } else { 16 },
        weight: 0.0,
        normal_weight: 0.0,
        tube_radius: 1.1,
        min_separation: 0.0,
        cosine: 0.2,
        adaptivity: None,
    };
    FrontConfig {
        grid: Grid { spacing: SPACING },
        method,
        law: Arc::new(law),
        integrator: PathIntegrator::Rk4,
        topology: Topology::Merge,
        segments: Segments { by_part: false, parameter: None },
        interrupt: Interrupt::default(),
    }
}

/// A ball of twenty spacings that lies beside the grid points.
pub fn ball<const D: usize>() -> Ball<D> {
    Ball { center: Vector::<D>::from_fn(|d, _| 0.503 + 0.004 * d as f64), radius: 0.4 }
}

/// The foot points of a surface.
pub fn feet<const D: usize, const M: usize>(
    surface: impl Surface<D> + 'static,
    config: &FrontConfig<D, M>,
) -> FootPoints<D> {
    let surfaces: [Box<dyn Surface<D>>; 1] = [Box::new(surface)];
    let mut feet = FootPoints::default();
    Placement { surfaces: &surfaces, config, refinement: &Refinement::default() }.place(&mut feet);
    feet
}

/// A flow that is at rest.
pub struct Rest;

impl<const D: usize> Flow<D> for Rest {
    fn velocity(&self, _x: &Vector<D>, _time: f64) -> Vector<D> {
        Vector::<D>::zeros()
    }

    fn top_speed(&self, _low: &Vector<D>, _high: &Vector<D>) -> f64 {
        0.0
    }
}
