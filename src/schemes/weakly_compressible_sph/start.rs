//! What a system starts with: velocities, the mean of a force, and how many particles drops may lose.

use super::config::SphConfig;
use super::interactions::{BodyForce, TensionForce};
use super::species::{Fluids, Species};
use crate::geometry::Vector;

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
