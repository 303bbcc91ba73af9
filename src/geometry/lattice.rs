//! Points of a Cartesian lattice, regular or jittered (PCP eqs. 19 and 20).

use super::Vector;
use super::random::CounterRandom;
use crate::parallel::Interrupt;

/// The lattice `x_m = (m + offset) h + α h μ_m` with random numbers `μ_m ~ U[−1, 1]^D` that depend on the seed and m
/// alone.
///
/// ```
/// use meniscus::{geometry::{Vector, lattice::Lattice}, parallel::Interrupt};
///
/// let lattice = Lattice { spacing: 0.25, offset: 0.0, jitter: 0.2, seed: 1 };
/// let corner = Vector::<2>::repeat(1.0);
/// let circle = |x: &Vector<2>| x.norm() - 0.5;
/// let band = lattice.points_near(&-corner, &corner, 0.3, circle, &Interrupt::default());
/// assert!(band.iter().all(|x| circle(x).abs() <= 0.3));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Lattice {
    /// Spacing h > 0.
    pub spacing: f64,
    /// Offset of the nodes in multiples of h: 0 for multiples of h, ½ for centers of cells.
    pub offset: f64,
    /// Jitter α in `[0, 0.5)`, in multiples of h. At a half two points could coincide.
    pub jitter: f64,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Lattice {
    /// All lattice points within `cutoff` of the surface with the given `distance`, x running fastest.
    ///
    /// The box from `low` to `high` must contain every node that can belong to the band. A distance function changes by
    /// no more than the distance between two points, so nodes far from the band are skipped. An interrupt ends the
    /// search early, with the points found so far.
    #[must_use]
    pub fn points_near<const D: usize>(
        &self,
        low: &Vector<D>,
        high: &Vector<D>,
        cutoff: f64,
        distance: impl Fn(&Vector<D>) -> f64,
        interrupt: &Interrupt,
    ) -> Vec<Vector<D>> {
        let random = CounterRandom::new(self.seed);
        let h = self.spacing;
        let first: [i64; D] = std::array::from_fn(|d| (low[d] / h - self.offset).ceil() as i64);
        let last: [i64; D] = std::array::from_fn(|d| (high[d] / h - self.offset).floor() as i64);
        let mut points = Vec::new();
        if (0..D).any(|d| first[d] > last[d]) {
            return points;
        }
        // Jitter moves this node and the next one.
        let slack = 2.0 * self.jitter * (D as f64).sqrt() + 1e-6;
        let mut node = first;
        loop {
            while node[0] <= last[0] {
                let x = self.point(&random, &node);
                let beyond = (distance(&x).abs() - cutoff) / h;
                if beyond <= 0.0 {
                    points.push(x);
                }
                node[0] += ((beyond - slack).floor() as i64).clamp(1, last[0] - first[0] + 1);
            }
            node[0] = first[0];
            let mut d = 1;
            loop {
                if d == D || interrupt.is_raised() {
                    return points;
                }
                node[d] += 1;
                if node[d] <= last[d] {
                    break;
                }
                node[d] = first[d];
                d += 1;
            }
        }
    }

    /// Position of a node, jitter included.
    fn point<const D: usize>(&self, random: &CounterRandom, node: &[i64; D]) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| {
            let regular = (node[d] as f64 + self.offset) * self.spacing;
            if self.jitter > 0.0 { regular + self.jitter * self.spacing * self.draw(random, node, d) } else { regular }
        })
    }

    /// Random number μ in [−1, 1) for one axis of a node.
    fn draw<const D: usize>(&self, random: &CounterRandom, node: &[i64; D], axis: usize) -> f64 {
        let mut counters = [0_i64; 4];
        counters[..D].copy_from_slice(node);
        counters[3] = axis as i64;
        random.symmetric(&counters)
    }
}

#[cfg(test)]
mod tests {
    use super::{Interrupt, Lattice, Vector};

    fn all<const D: usize>(lattice: &Lattice, half: f64) -> Vec<Vector<D>> {
        let corner = Vector::<D>::repeat(half);
        lattice.points_near(&-corner, &corner, 1.0, |_| 0.0, &Interrupt::default())
    }

    #[test]
    fn box_of_nodes_is_complete_and_jitter_is_bounded() {
        let lattice = Lattice { spacing: 0.25, offset: 0.0, jitter: 0.3, seed: 7 };
        let points = all::<3>(&lattice, 0.5);
        assert_eq!(points.len(), 125);
        for p in &points {
            for d in 0..3 {
                let node = (p[d] / 0.25).round() * 0.25;
                assert!((p[d] - node).abs() <= 0.3 * 0.25);
            }
        }
    }

    #[test]
    fn a_point_does_not_depend_on_the_box_it_was_made_in() {
        let lattice = Lattice { spacing: 0.1, offset: 0.5, jitter: 0.4, seed: 1 };
        let (small, large) = (all::<2>(&lattice, 0.3), all::<2>(&lattice, 1.0));
        assert!(small.iter().all(|p| large.contains(p)));
    }

    #[test]
    fn stepping_over_loses_no_point_of_a_band() {
        for jitter in [0.0, 0.2, 0.49] {
            let lattice = Lattice { spacing: 0.03, offset: 0.0, jitter, seed: 3 };
            let distance = |x: &Vector<3>| x.norm() - 0.6;
            let corner = Vector::<3>::repeat(1.0);
            let near = lattice.points_near(&-corner, &corner, 0.07, distance, &Interrupt::default());
            let kept: Vec<Vector<3>> =
                all::<3>(&lattice, 1.0).into_iter().filter(|x| distance(x).abs() <= 0.07).collect();
            assert_eq!(near, kept);
        }
    }
}
