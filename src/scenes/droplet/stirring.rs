//! Scenes in which a force, a moving wall or a shear deforms the fluids for long.

use super::room::Room;
use super::spec::Droplet;
use crate::geometry::Vector;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::{BodyForce, SphConfig};
use crate::simulation::Finding;

/// Displacement of a shift by ε² ∇C, the paper's.
pub(super) const SHIFTING: f64 = 0.05;
/// The same between walls. Shifts slow a flow: with the paper's rate the drop of Hysing et al. rises 1 % less far (measured;
/// docs/results/wall-notes.md).
pub(super) const SHIFTING_BETWEEN_WALLS: f64 = 0.015;

/// Whether a force, a moving wall or a shear deforms for long what starts between walls or in shear. Flat layers are at rest or slide along
/// themselves.
pub(super) fn is_stirred<const D: usize>(spec: &Droplet, force: Option<&BodyForce<D>>, room: &Room<D>) -> bool {
    if room.container.is_none() && room.mean_shear.is_none() {
        return false;
    }
    let is_flat = matches!(spec.shape, Some(Shape::Layer { amplitude: 0.0, .. }));
    let is_sheared = room.mean_shear.is_some_and(|shear| shear.rate != 0.0);
    (!is_flat || !room.obstacles.is_empty()) && (force.is_some() || is_sheared || room.wall_speed() > 0.0)
}

/// A warning where the pressure of the whole weight of fluids that move holds them back: pressure acts as an elasticity of the lattice of
/// particles. A growing wave is 10 to 14 % behind (measured; docs/results/wall-notes.md).
pub(super) fn held_back<const D: usize>(config: &SphConfig<D>, room: &Room<D>) -> Option<Finding> {
    let Some(BodyForce::Constant(gravity)) = config.body_force else { return None };
    let across = Vector::<D>::from_fn(|d, _| if room.is_bounded(d) { gravity[d] } else { 0.0 });
    if across == Vector::<D>::zeros() || config.starts_in_layers || config.fluids.have_one_mass() {
        return None;
    }
    let message =
        "the pressure of the whole weight acts as an elasticity of the lattice of particles and holds back what moves";
    let advice = "\"balance\": \"mean\" takes the pressure of the mean weight out, which changes nothing else";
    Some(Finding::warning("held_back_by_weight", message.to_owned(), (0, 0.0)).with_advice(advice))
}
