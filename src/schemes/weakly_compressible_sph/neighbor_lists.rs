//! Neighbor lists with a skin: they hold until a particle has moved by half of the skin. In a box in shear they hold until neighbors have
//! moved by the skin, half of it each about the mean flow and what that moves them past each other.

use super::mean_shear::MeanShear;
use crate::geometry::{Domain, Vector};
use crate::neighbors::Pencils;
use crate::neighbors::pencils::BoxTooSmall;
use crate::parallel::{Interrupt, Interrupted};

/// The lists and the positions that they were made of.
#[derive(Debug)]
pub(super) struct NeighborLists<const D: usize> {
    domain: Domain<D>,
    pub pencils: Pencils<D>,
    skin: f64,
    /// Positions of the particles when the lists were made, then those of points that stay where they are.
    reference: Vec<Vector<D>>,
    /// Number of the particles.
    count: usize,
    sliding: Option<Sliding>,
}

/// How a mean shear moves particles and images since lists were made.
#[derive(Debug)]
struct Sliding {
    shear: MeanShear,
    /// Distance within which particles must find each other.
    reach: f64,
    /// Time at which the lists were made, and how images were displaced then.
    listed: f64,
    offset: f64,
    /// The present time.
    now: f64,
}

impl<const D: usize> NeighborLists<D> {
    /// Empty lists for `count` particles and, numbered behind them, fixed points. The lists cover `cutoff`, which includes the
    /// skin.
    ///
    /// # Errors
    /// [`BoxTooSmall`].
    pub fn new(
        domain: &Domain<D>,
        (cutoff, skin): (f64, f64),
        count: usize,
        fixed: impl Iterator<Item = Vector<D>>,
    ) -> Result<Self, BoxTooSmall> {
        let mut reference = vec![Vector::<D>::zeros(); count];
        reference.extend(fixed);
        let pencils = Pencils::new(domain, cutoff)?;
        Ok(Self { domain: domain.clone(), pencils, skin, reference, count, sliding: None })
    }

    /// The same lists in a mean shear, of particles that must find each other within `reach`.
    pub fn in_shear(mut self, shear: Option<MeanShear>, reach: f64) -> Self {
        self.sliding = shear.map(|shear| Sliding { shear, reach, listed: 0.0, offset: 0.0, now: 0.0 });
        self
    }

    /// Slides the images of a box in shear to where they are at a time.
    pub fn slide_images(&mut self, domain: &Domain<D>, time: f64) {
        let Some(Sliding { shear, listed, offset, now, .. }) = &mut self.sliding else { return };
        self.domain = domain.clone();
        *now = time;
        self.pencils.slide(shear.axis, *offset + shear.offset(time) - shear.offset(*listed));
    }

    /// Time at which the lists of a box in shear were made.
    pub fn listed_at(&self) -> Option<f64> {
        self.sliding.as_ref().map(|sliding| sliding.listed)
    }

    /// Goes back to the time at which lists were made, as a restart does.
    pub fn return_to(&mut self, time: f64) {
        if let Some(Sliding { shear, now, .. }) = &mut self.sliding {
            self.domain = shear.domain(&self.domain, time);
            *now = time;
        }
    }

    /// Where the mean flow has carried a place since the lists were made.
    fn carried(&self, from: &Vector<D>) -> Vector<D> {
        let mut place = *from;
        if let Some(Sliding { shear, listed, now, .. }) = &self.sliding {
            place[0] += shear.speed(from) * (now - listed);
        }
        place
    }

    /// Positions of the particles when the lists were made.
    pub fn reference(&self) -> &[Vector<D>] {
        &self.reference[..self.count]
    }

    /// The same, to be set by a restart.
    pub fn reference_mut(&mut self) -> &mut [Vector<D>] {
        &mut self.reference[..self.count]
    }

    /// Whether the lists may miss a neighbor: there are none, or a particle has moved by half of the skin, in a shear by half of what
    /// the mean flow has left of it.
    pub fn are_stale(&self, positions: &[Vector<D>]) -> bool {
        let strain = |sliding: &Sliding| sliding.shear.rate.abs() * (sliding.now - sliding.listed) * sliding.reach;
        let skin = self.skin - self.sliding.as_ref().map_or(0.0, strain);
        let most = 0.25 * skin * skin;
        let has_moved = |(x, from)| self.domain.displacement(&self.carried(from), x).norm_squared() > most;
        self.pencils.slot_count() == 0 || skin <= 0.0 || positions.iter().zip(self.reference()).any(has_moved)
    }

    /// Makes the lists of new positions.
    pub fn rebuild(&mut self, positions: &[Vector<D>], interrupt: &Interrupt) -> Result<(), Interrupted> {
        self.reference_mut().copy_from_slice(positions);
        self.rebuild_from_reference(interrupt)
    }

    /// Makes the lists of the present reference positions, as a restart does.
    pub fn rebuild_from_reference(&mut self, interrupt: &Interrupt) -> Result<(), Interrupted> {
        if let (Some(sliding), Some(tilt)) = (&mut self.sliding, self.domain.tilt()) {
            (sliding.listed, sliding.offset) = (sliding.now, tilt.offset);
            self.pencils.slide(tilt.axis, tilt.offset);
        }
        self.pencils.rebuild(&self.reference, interrupt)
    }

    /// The position of a particle at the period of its reference position, whatever period it has been wrapped to since; that of
    /// a fixed point.
    pub fn unwrapped(&self, i: usize, positions: &[Vector<D>]) -> Vector<D> {
        let from = &self.reference[i];
        positions.get(i).map_or(*from, |position| {
            let from = self.carried(from);
            from + self.domain.displacement(&from, position)
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::Vector;
    use crate::parallel::Interrupt;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;

    #[test]
    fn lists_become_stale_when_a_particle_has_moved_by_half_of_the_skin() {
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let mut lists = this.lists();
        assert!(lists.are_stale(&this.positions), "there are no lists yet");
        lists.rebuild(&this.positions, &Interrupt::default()).unwrap();
        assert!(!lists.are_stale(&this.positions));
        for (share, is_stale) in [(0.49, false), (0.51, true)] {
            let mut moved = this.positions.clone();
            moved[7] = this.domain.wrap(moved[7] - Vector::<2>::new(share * this.config.skin(), 0.0));
            assert_eq!(lists.are_stale(&moved), is_stale);
            let unwrapped = lists.unwrapped(7, &moved);
            assert!((unwrapped - lists.reference()[7]).norm() < this.config.skin());
        }
    }
}
