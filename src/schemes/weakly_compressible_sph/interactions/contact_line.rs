//! The force of walls on contact lines, where an interface meets a wall.
//!
//! Per length of the line, surface tension draws along the wall with τ (cos θ_e − cos θ): towards the angle of equilibrium θ_e from the
//! present angle θ, both measured in the fluid inside (Young). The sums of −τ (κ − κ₀) n δ have no such part, since they end at the
//! wall. As a force by volume it is
//!
//! f = τ (cos θ_e − cos θ) n_t δ(φ) δ_w(s)
//!
//! with the part n_t of the normal n along the wall, the δ of surface tension, and a δ_w of the distance s from the wall, twice the
//! smoothed δ since there is fluid on one side only. |n_t| δ(φ) integrates to 1 along the wall, whatever the angle.
//!
//! The angle is that of the wall, not of the height at which a particle looks at the interface: −n·m changes by κ s between them, for
//! the direction m into the wall and the curvature κ of the drop as a cap. With the curvature at the particle itself a bend next to
//! the wall would tell of an angle that it does not have, and grow (measured: the line of 120° runs away from a start at 90°).

use super::Moment;
use super::surface_tension::SurfaceTension;
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::smoothed_delta::smoothed_delta;
use crate::schemes::weakly_compressible_sph::walls::Container;

/// The force on contact lines.
#[derive(Debug, Clone)]
pub struct ContactLines<const D: usize> {
    container: Container<D>,
    tension: SurfaceTension,
    coefficient: f64,
    /// Width of δ_w.
    width: f64,
}

/// A particle next to a contact line.
#[derive(Debug, Clone, Copy)]
pub struct AtLine<const D: usize> {
    pub particle: usize,
    /// Cosine of the angle between interface and wall.
    pub cosine: f64,
    /// Cosine of the angle that the wall asks for.
    pub target: f64,
    /// n_t δ δ_w.
    pub along: Vector<D>,
    /// Distance of its closest point from the wall.
    pub height: f64,
}

impl<const D: usize> ContactLines<D> {
    /// The force of the walls of a container for a tension with a coefficient; δ_w has a width.
    #[must_use]
    pub fn new(container: Container<D>, tension: SurfaceTension, coefficient: f64, width: f64) -> Self {
        Self { container, tension, coefficient, width }
    }

    /// δ_w at a distance from a wall.
    pub fn wall_profile(&self, distance: f64) -> f64 {
        2.0 * smoothed_delta(distance.max(0.0), self.width)
    }

    /// Finds the accelerations of the particles next to contact lines.
    pub fn find_forces(&self, forces: &mut Vec<(usize, Vector<D>)>, moment: &Moment<'_, D>) {
        forces.clear();
        forces.extend(self.particles(moment).map(|at| {
            let strength = self.coefficient * (at.target - at.cosine) / moment.flow.density[at.particle];
            (at.particle, at.along * strength)
        }));
    }

    /// The particles next to contact lines, of droplets that touch a wall.
    pub fn particles<'a>(&'a self, moment: &'a Moment<'_, D>) -> impl Iterator<Item = AtLine<D>> + 'a {
        let candidates = moment.interface.candidates();
        let (particles, columns) = (moment.particles, moment.columns);
        let band = particles.flag(columns.in_band);
        let is_next = move |i: &usize| band[*i] == 1 && moment.droplets.is_at_wall(*i);
        candidates.iter().copied().filter(is_next).filter_map(move |i| {
            let x = particles.positions()[i];
            let beside = self.container.beside(&x)?;
            let wall_delta = self.wall_profile(beside.distance);
            let delta = self.tension.profile(particles.scalar(columns.phi)[i]);
            if wall_delta <= 0.0 || delta <= 0.0 {
                return None;
            }
            let normal = particles.vector(columns.normal)[i];
            let across = normal.dot(&beside.normal);
            // The closest point is x − φ n; as a column it may lie in another period.
            let height = beside.distance + particles.scalar(columns.phi)[i] * across;
            let curvature = moment.droplets.ball_curvature(i) / (D - 1) as f64;
            let cosine = (-across - height * curvature).clamp(-1.0, 1.0);
            let target = self.container.wall(beside.wall).contact.target(cosine);
            let along = (normal - beside.normal * across) * (delta * wall_delta);
            Some(AtLine { particle: i, cosine, target, along, height })
        })
    }
}
