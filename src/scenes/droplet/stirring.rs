//! Shifts of particles between walls: whether they are wanted, and how large they are.

use super::room::Room;
use super::spec::Droplet;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::BodyForce;

/// Displacement of a shift by ε² ∇C, the paper's.
pub(super) const SHIFTING: f64 = 0.05;
/// The same between walls, where a drop rises for long: with more, flows lose speed (a third of it costs the rising drop of Hysing et al. 1 % of
/// its way less; docs/results/wall-notes.md).
pub(super) const SHIFTING_BETWEEN_WALLS: f64 = 0.015;

/// Whether walls or a force deform what starts between walls for long: all but flat layers, which are at rest or slide along themselves.
pub(super) fn is_stirred<const D: usize>(spec: &Droplet, force: Option<&BodyForce<D>>, room: &Room<D>) -> bool {
    let is_flat = matches!(spec.shape, Some(Shape::Layer { amplitude: 0.0, .. }));
    (!is_flat || !room.obstacles.is_empty()) && (force.is_some() || room.wall_speed() > 0.0)
}
