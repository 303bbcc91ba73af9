//! Strays: particles that are left without a neighbor of their own species when a neck has parted. Fits take them for droplets
//! of a spacing's size that never vanish. Where the fluids are the same but for the interface between them, such particles
//! take the species of their neighbors.
//!
//! Threads of several particles are left alone, since tension draws them in (measured: to absorb rows as well costs up to a
//! third of a drop at h = 1/32).

use super::species::Species;
use crate::geometry::Domain;
use crate::neighbors::{CellList, NeighborSearch};
use crate::particles::{Particles, ScalarKey};

/// Distance in h up to which another particle is a neighbor here: on a lattice the eight next particles in the plane.
const NEIGHBORHOOD_H: f64 = 1.5;

/// Storage for finding strays.
#[derive(Debug)]
pub(super) struct Strays<const D: usize> {
    cells: CellList<D>,
    found: Vec<usize>,
    /// Particles that have changed their species up to now.
    pub absorbed: u64,
    /// Particles that the fluid inside has lost by that, less those that it gained.
    pub lost: i64,
    /// The most particles that the fluid inside may lose or gain; further strays wait for their balance.
    allowance: i64,
    /// Strays that waited when neighbors were last listed.
    pub waiting: u64,
}

impl<const D: usize> Strays<D> {
    pub fn new(domain: Domain<D>, allowance: i64) -> Self {
        Self { cells: CellList::new(domain), found: Vec::new(), absorbed: 0, lost: 0, allowance, waiting: 0 }
    }

    /// Replaces the domain.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        self.cells.set_domain(domain);
    }

    /// Changes species and levels (signed distance and carried level) of the particles among `near` that have no neighbor of
    /// their own species, as far as the allowance lets them. All particles are
    /// judged by the species before the change.
    pub fn absorb(
        &mut self,
        particles: &mut Particles<D>,
        levels: [ScalarKey; 2],
        near: &[usize],
        spacing: f64,
        species: &mut [Species],
    ) {
        let (positions, level) = (particles.positions(), particles.scalar(levels[0]));
        let cutoff = NEIGHBORHOOD_H * spacing;
        self.cells.rebuild(near.iter().map(|i| positions[*i]), cutoff);
        self.found.clear();
        for (k, i) in near.iter().enumerate().filter(|(_, i)| level[**i].abs() < spacing) {
            let mut is_alone = true;
            self.cells.for_each_within(&positions[*i], cutoff, |other, _, _| {
                is_alone &= other == k || species[near[other]] != species[*i];
            });
            if is_alone {
                self.found.push(*i);
            }
        }
        self.waiting = 0;
        for i in &self.found {
            let lost = self.lost + if species[*i] == Species::Inside { 1 } else { -1 };
            if lost.abs() > self.allowance {
                self.waiting += 1;
                continue;
            }
            self.lost = lost;
            self.absorbed += 1;
            species[*i] = species[*i].across_interface();
            let side = -species[*i].color() + 0.5;
            for key in levels {
                let level = &mut particles.scalar_mut(key)[*i];
                *level = level.copysign(side);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Species, Strays};
    use crate::geometry::{Domain, Vector};
    use crate::particles::Particles;

    #[test]
    fn a_particle_alone_changes_its_species_and_a_row_does_not() {
        let positions: Vec<Vector<2>> =
            (0..400).map(|k| Vector::<2>::new(f64::from(k % 20) - 10.0, f64::from(k / 20) - 10.0)).collect();
        let all: Vec<usize> = (0..positions.len()).collect();
        let at = |x: &Vector<2>, place: [f64; 2]| (x - Vector::<2>::from(place)).norm() < 0.1;
        // The lower half, a row in the upper half, and one particle alone in each half.
        let stays = |x: &Vector<2>| x[1] < 0.0 || (x[1] - 5.0).abs() < 0.1;
        let is_inside = |x: &Vector<2>| stays(x) != (at(x, [2.0, 2.0]) || at(x, [3.0, -4.0]));
        let by_side = |inside| if inside { Species::Inside } else { Species::Outside };
        let mut species: Vec<Species> = positions.iter().map(|x| by_side(is_inside(x))).collect();
        let mut particles = Particles::new(positions);
        let phi = particles.add_scalar("phi", 0.5);
        for (level, species) in particles.scalar_mut(phi).iter_mut().zip(&species) {
            *level -= species.color();
        }
        let mut strays = Strays::new(Domain::unbounded(), i64::MAX);
        strays.absorb(&mut particles, [phi, phi], &all, 1.0, &mut species);
        for (x, (species, level)) in particles.positions().iter().zip(species.iter().zip(particles.scalar(phi))) {
            assert_eq!(*species, by_side(stays(x)), "{x}");
            assert_eq!(*species, Species::from_level(*level));
        }
        assert_eq!((strays.absorbed, strays.lost), (2, 0));
        let mut none = Strays::new(Domain::unbounded(), 0);
        // One more inside in the upper half is not absorbed without a balance.
        let alone = particles.positions().iter().position(|x| at(x, [-6.0, 8.0])).unwrap();
        species[alone] = Species::Inside;
        particles.scalar_mut(phi)[alone] = -0.5;
        none.absorb(&mut particles, [phi, phi], &all, 1.0, &mut species);
        assert_eq!((none.absorbed, none.waiting, species[alone]), (0, 1, Species::Inside));
    }
}
