//! What a system starts with: forces, velocities, and how many particles drops may lose.

use super::config::SphConfig;
use super::interactions::contact_line::ContactLines;
use super::interactions::surface_tension::SurfaceTension;
use super::interactions::{BodyForce, ParticleForce, TensionForce};
use super::species::{Fluids, Species};
use crate::geometry::Vector;

/// The forces on particles, in the order in which they are added.
pub(super) fn forces_on_particles<const D: usize>(
    tension: Option<&SurfaceTension>,
    body: Option<&BodyForce<D>>,
    lines: Option<&ContactLines<D>>,
) -> Vec<Box<dyn ParticleForce<D>>> {
    fn boxed<const D: usize, F: ParticleForce<D> + Clone + 'static>(
        force: Option<&F>,
    ) -> Option<Box<dyn ParticleForce<D>>> {
        force.map(|force| Box::new(force.clone()) as Box<dyn ParticleForce<D>>)
    }
    [boxed(tension), boxed(body), boxed(lines)].into_iter().flatten().collect()
}

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
