//! What a system starts with: walls, its interface, velocities, the mean of a force, and how many particles drops may lose.

use super::config::{Geometry, SphConfig};
use super::interactions::{BodyForce, TensionForce};
use super::interface::level_set::LevelSetConfig;
use super::interface::{ColorField, Interface, LevelSet};
use super::species::{Fluids, Species};
use super::walls::Walls;
use crate::closest_point::SurfaceColumns;
use crate::geometry::{Domain, Vector};
use crate::particles::Particles;

/// The velocities of the particles at the start.
pub(super) fn start_velocities<const D: usize>(
    config: &SphConfig<D>,
    own: &Option<Vec<Vector<D>>>,
    count: usize,
) -> Vec<Vector<D>> {
    match own {
        Some(own) => own.iter().map(|velocity| velocity + config.start_velocity).collect(),
        None => vec![config.start_velocity; count],
    }
}

/// The most particles that drops may lose to strays: half of what ends a run. The forces of version 0.1 and of the paper set none.
pub(super) fn stray_allowance<const D: usize>(config: &SphConfig<D>, level: &[f64]) -> i64 {
    let inside = level.iter().filter(|level| Species::from_level(**level) == Species::Inside).count();
    match config.tension_force {
        TensionForce::Balanced => inside as i64 / 200,
        TensionForce::BalancedUncorrected | TensionForce::Csf => i64::MAX,
    }
}

/// The body force with its mean taken out, where it asks for that.
pub(super) fn balance<const D: usize>(force: BodyForce<D>, fluids: &Fluids, level: &[f64]) -> BodyForce<D> {
    let densities = level.iter().map(|level| fluids[Species::from_level(*level)].density);
    let mean = densities.sum::<f64>() / level.len() as f64;
    force.without_mean(mean, fluids)
}

/// The walls of a configuration, with points behind them.
pub(super) fn new_walls<const D: usize>(
    config: &SphConfig<D>,
    domain: &Domain<D>,
    behind: &[Vector<D>],
    cell: f64,
) -> Option<Walls<D>> {
    let radius = config.kernel.support() * config.smoothing_length;
    let container = config.container.clone()?;
    Some(Walls::new(container, behind, domain, (radius, config.skin()), cell))
}

/// The interface of a configuration, which adds its columns to the particles.
pub(super) fn new_interface<const D: usize>(
    config: &SphConfig<D>,
    domain: &Domain<D>,
    particles: &mut Particles<D>,
    columns: &SurfaceColumns,
) -> Interface<D> {
    if !config.has_tension() {
        return Interface::Absent;
    }
    match &config.geometry {
        Geometry::Pcp { method, half_band, level_update, curvature_filter } => {
            let level_set = LevelSetConfig {
                spacing: config.spacing,
                half_band: *half_band,
                update: *level_update,
                curvature_filter: *curvature_filter,
                repair_time: config.repair_time(),
            };
            Interface::LevelSet(Box::new(LevelSet::new(method.clone(), domain, level_set, particles, columns)))
        }
        Geometry::ColorField => Interface::ColorField(ColorField::new(particles.len())),
    }
}
