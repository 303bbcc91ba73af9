//! Droplets: connected components of the inner fluid, and the curvature that each would have as a ball.

use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use std::f64::consts::PI;

/// Particles of the inner fluid not farther apart than so many h are of one droplet.
const LINK_H: f64 = 1.5;
/// The most droplets that are told apart; smaller ones beyond are fragments.
const MOST: usize = 250;
/// The droplet of nobody: fragments, and particles far from any droplet.
pub(super) const FRAGMENT: u8 = u8::MAX;

/// Particles that make a droplet and not a fragment.
const fn fewest(dimension: usize) -> usize {
    if dimension == 2 { 12 } else { 40 }
}

/// Storage for finding them.
#[derive(Debug)]
pub(super) struct Components<const D: usize> {
    cells: CellList<D>,
    inside: Vec<usize>,
    label: Vec<usize>,
    stack: Vec<usize>,
    sizes: Vec<usize>,
    ranks: Vec<usize>,
}

impl<const D: usize> Components<D> {
    pub fn new(domain: Domain<D>) -> Self {
        Self {
            cells: CellList::new(domain),
            inside: Vec::new(),
            label: Vec::new(),
            stack: Vec::new(),
            sizes: Vec::new(),
            ranks: Vec::new(),
        }
    }

    /// Labels the particles of the inner fluid and, of the others, those within `reach` of one. Droplets count from 0 by their
    /// least particle. Returns the number of particles of each.
    pub fn find(
        &mut self,
        positions: &[Vector<D>],
        is_inside: &[u8],
        asked: impl Iterator<Item = usize>,
        spacing: f64,
        reach: f64,
        droplet: &mut [u8],
    ) -> &[usize] {
        self.inside.clear();
        self.inside.extend((0..positions.len()).filter(|i| is_inside[*i] == 1));
        let link = LINK_H * spacing;
        self.cells.rebuild(self.inside.iter().map(|i| positions[*i]), link);
        self.label.clear();
        self.label.resize(self.inside.len(), usize::MAX);
        self.sizes.clear();
        for seed in 0..self.inside.len() {
            if self.label[seed] != usize::MAX {
                continue;
            }
            let name = self.sizes.len();
            let mut size = 0;
            self.label[seed] = name;
            self.stack.push(seed);
            while let Some(k) = self.stack.pop() {
                size += 1;
                let (label, stack) = (&mut self.label, &mut self.stack);
                self.cells.for_each_within(&positions[self.inside[k]], link, |other, _, _| {
                    if label[other] == usize::MAX {
                        label[other] = name;
                        stack.push(other);
                    }
                });
            }
            self.sizes.push(size);
        }
        // Fragments have no name of their own.
        self.ranks.clear();
        let mut droplets = 0;
        for size in &self.sizes {
            let is_droplet = *size >= fewest(D) && droplets < MOST;
            self.ranks.push(if is_droplet { droplets } else { usize::from(FRAGMENT) });
            droplets += usize::from(is_droplet);
        }
        droplet.fill(FRAGMENT);
        for (k, i) in self.inside.iter().enumerate() {
            droplet[*i] = self.ranks[self.label[k]] as u8;
        }
        if droplets > 1 {
            for i in asked.filter(|i| is_inside[*i] == 0) {
                if let Some((k, _)) = self.cells.nearest(&positions[i], reach) {
                    droplet[i] = self.ranks[self.label[k]] as u8;
                }
            }
        }
        let ranks = &self.ranks;
        let mut rank = ranks.iter();
        self.sizes.retain(|_| rank.next().is_some_and(|rank| *rank != usize::from(FRAGMENT)));
        &self.sizes
    }
}

/// κ₀ of a ball of the given measure: √(π/A), 2 (4π/3V)^⅓.
#[must_use]
pub(super) fn ball_curvature<const D: usize>(measure: f64) -> f64 {
    if D == 2 { (PI / measure).sqrt() } else { 2.0 * (4.0 * PI / (3.0 * measure)).cbrt() }
}

#[cfg(test)]
mod tests {
    use super::{Components, Domain, FRAGMENT, Vector, ball_curvature};
    use crate::geometry::domain::Axis;

    #[test]
    fn droplets_across_the_edge_are_one_and_crumbs_are_none() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 20.0 }; 2]);
        let positions: Vec<Vector<2>> =
            (0..400).map(|k| Vector::<2>::new(f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5)).collect();
        let near = |x: &Vector<2>, c: [f64; 2], r: f64| domain.displacement(&Vector::<2>::from(c), x).norm() < r;
        let inside: Vec<u8> = positions
            .iter()
            .map(|x| u8::from(near(x, [0.0, 10.0], 4.0) || near(x, [10.0, 10.0], 3.0) || near(x, [10.5, 2.5], 0.9)))
            .collect();
        let mut components = Components::new(domain);
        let mut droplet = vec![0; 400];
        let sizes = components.find(&positions, &inside, 0..400, 1.0, 3.0, &mut droplet).to_vec();
        assert_eq!(sizes.len(), 2);
        let at = |x: usize, y: usize| droplet[x + 20 * y];
        assert_eq!(at(0, 10), at(19, 10));
        assert_ne!(at(0, 10), at(10, 10));
        assert_eq!(at(10, 2), FRAGMENT);
        assert_eq!(at(13, 10), at(10, 10));
    }

    #[test]
    fn balls_have_their_curvature() {
        assert!((ball_curvature::<2>(std::f64::consts::PI * 0.25) - 2.0).abs() < 1e-14);
        assert!((ball_curvature::<3>(4.0 / 3.0 * std::f64::consts::PI * 0.125) - 4.0).abs() < 1e-14);
    }
}
