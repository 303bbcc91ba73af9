//! Particles that have nobody of their own fluid next to them, of either fluid: what is left of a neck that has parted. Fits take
//! them for droplets of a spacing's size that never come back. Where the fluids are one and the same but for the interface
//! between them, such particles take the side of their neighbours. Threads of several particles are left alone: tension draws
//! them in (measured: to absorb rows as well costs up to a third of a drop at h = 1/32).

use crate::geometry::Domain;
use crate::neighbors::{CellList, NeighborSearch};
use crate::particles::{Particles, ScalarKey};

/// Who is next to a particle, in h: on a lattice eight are in the plane.
const REACH_H: f64 = 1.5;

/// Storage for finding them.
#[derive(Debug)]
pub(super) struct Strays<const D: usize> {
    cells: CellList<D>,
    found: Vec<usize>,
    /// Particles that have changed side up to now.
    pub absorbed: u64,
}

impl<const D: usize> Strays<D> {
    pub fn new(domain: Domain<D>) -> Self {
        Self { cells: CellList::new(domain), found: Vec::new(), absorbed: 0 }
    }

    /// Turns those who stand alone among `near`, all of them judged by what was before.
    pub fn absorb(
        &mut self,
        particles: &mut Particles<D>,
        phi: ScalarKey,
        near: &[usize],
        spacing: f64,
        phase: &mut [u8],
    ) {
        let (positions, level) = (particles.positions(), particles.scalar(phi));
        let reach = REACH_H * spacing;
        self.cells.rebuild(near.iter().map(|i| positions[*i]), reach);
        self.found.clear();
        for (k, i) in near.iter().enumerate().filter(|(_, i)| level[**i].abs() < spacing) {
            let mut is_alone = true;
            self.cells.for_each_within(&positions[*i], reach, |other, _, _| {
                is_alone &= other == k || phase[near[other]] != phase[*i];
            });
            if is_alone {
                self.found.push(*i);
            }
        }
        let level = particles.scalar_mut(phi);
        for i in &self.found {
            phase[*i] = 1 - phase[*i];
            level[*i] = -level[*i];
        }
        self.absorbed += self.found.len() as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::Strays;
    use crate::geometry::{Domain, Vector};
    use crate::particles::Particles;

    #[test]
    fn who_stands_alone_changes_side_and_a_row_does_not() {
        let positions: Vec<Vector<2>> =
            (0..400).map(|k| Vector::<2>::new(f64::from(k % 20) - 10.0, f64::from(k / 20) - 10.0)).collect();
        let everybody: Vec<usize> = (0..positions.len()).collect();
        let at = |x: &Vector<2>, place: [f64; 2]| (x - Vector::<2>::from(place)).norm() < 0.1;
        // The lower half, a row in the upper one, one that stands alone in each.
        let stays = |x: &Vector<2>| x[1] < 0.0 || (x[1] - 5.0).abs() < 0.1;
        let is_inside = |x: &Vector<2>| stays(x) != (at(x, [2.0, 2.0]) || at(x, [3.0, -4.0]));
        let mut phase: Vec<u8> = positions.iter().map(|x| u8::from(is_inside(x))).collect();
        let mut particles = Particles::new(positions);
        let phi = particles.add_scalar("phi", 0.5);
        for (level, phase) in particles.scalar_mut(phi).iter_mut().zip(&phase) {
            *level -= f64::from(*phase);
        }
        let mut strays = Strays::new(Domain::unbounded());
        strays.absorb(&mut particles, phi, &everybody, 1.0, &mut phase);
        for (x, (phase, level)) in particles.positions().iter().zip(phase.iter().zip(particles.scalar(phi))) {
            assert_eq!(*phase == 1, stays(x), "{x}");
            assert_eq!(*level < 0.0, *phase == 1);
        }
        assert_eq!(strays.absorbed, 2);
    }
}
