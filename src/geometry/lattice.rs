//! Points on a Cartesian lattice, regular or jittered (PCP paper, eqs. 19 and 20).

use super::Vector;
use super::random::CounterRandom;

/// A lattice `x_m = (m + offset) h + α h μ_m`, `μ_m ~ U[−1, 1]^D` drawn by the counter `m`.
#[derive(Debug, Clone, Copy)]
pub struct Lattice {
    /// Spacing h > 0.
    pub spacing: f64,
    /// 0 puts points on multiples of h, ½ on the centres of cells.
    pub offset: f64,
    /// α in `[0, 0.5)`: with a half two points could meet.
    pub jitter: f64,
    /// Seed of the draws.
    pub seed: u64,
}

impl Lattice {
    /// All points whose unjittered node lies in the box `[low, high]` and that `keep` accepts, x running fastest.
    #[must_use]
    pub fn points_in<const D: usize>(
        &self,
        low: &Vector<D>,
        high: &Vector<D>,
        mut keep: impl FnMut(&Vector<D>) -> bool,
    ) -> Vec<Vector<D>> {
        let random = CounterRandom::new(self.seed);
        let h = self.spacing;
        let first: [i64; D] = std::array::from_fn(|d| (low[d] / h - self.offset).ceil() as i64);
        let last: [i64; D] = std::array::from_fn(|d| (high[d] / h - self.offset).floor() as i64);
        let mut points = Vec::new();
        if (0..D).any(|d| first[d] > last[d]) {
            return points;
        }
        let mut node = first;
        loop {
            let x = Vector::<D>::from_fn(|d, _| {
                let regular = (node[d] as f64 + self.offset) * h;
                if self.jitter > 0.0 { regular + self.jitter * h * self.draw(&random, &node, d) } else { regular }
            });
            if keep(&x) {
                points.push(x);
            }
            let mut d = 0;
            loop {
                node[d] += 1;
                if node[d] <= last[d] {
                    break;
                }
                node[d] = first[d];
                d += 1;
                if d == D {
                    return points;
                }
            }
        }
    }

    fn draw<const D: usize>(&self, random: &CounterRandom, node: &[i64; D], axis: usize) -> f64 {
        let mut counters = [0_i64; 4];
        counters[..D].copy_from_slice(node);
        counters[3] = axis as i64;
        random.symmetric(&counters)
    }
}

#[cfg(test)]
mod tests {
    use super::{Lattice, Vector};

    #[test]
    fn box_of_nodes_is_complete_and_jitter_is_bounded() {
        let lattice = Lattice { spacing: 0.25, offset: 0.0, jitter: 0.3, seed: 7 };
        let points = lattice.points_in(&Vector::<3>::repeat(-0.5), &Vector::<3>::repeat(0.5), |_| true);
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
        let small = lattice.points_in(&Vector::<2>::new(0.0, 0.0), &Vector::<2>::new(0.3, 0.3), |_| true);
        let large = lattice.points_in(&Vector::<2>::new(-1.0, -1.0), &Vector::<2>::new(1.0, 1.0), |_| true);
        assert!(small.iter().all(|p| large.contains(p)));
    }
}
