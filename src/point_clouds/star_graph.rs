//! The graph of stars: two points are neighbors where the cell of either has a facet of the other.

use super::stars::{Facet, Stars};

/// The symmetric graph of a cloud, with the conductance ℓ_ij = (V_ij + V_ji)/2 of each edge, where V_ij is the length of the
/// facet of j in the cell of i by their distance.
#[derive(Debug, Clone, Default)]
pub struct StarGraph {
    /// First entry of each point, and their number at the end.
    starts: Vec<usize>,
    neighbors: Vec<u32>,
    conductances: Vec<f64>,
    /// Middle of the facet between two points from the middle of the way, along n × (x_j − x_i); antisymmetric.
    offsets: Vec<f64>,
    /// Area of the cell of each point, or its length on a curve.
    pub areas: Vec<f64>,
    /// Part of each point: the connected components are numbered by their smallest index.
    pub parts: Vec<u32>,
    /// Number of parts.
    pub part_count: usize,
    /// Whether the cell of each point is open, as at an edge.
    is_open: Vec<bool>,
}

impl StarGraph {
    /// The graph of the stars of a cloud.
    #[must_use]
    pub fn new(stars: &Stars) -> Self {
        let count = stars.len();
        let half = |facet: &Facet| 0.5 * facet.conductance;
        let mut lists: Vec<Vec<(u32, f64, f64)>> = (0..count)
            .map(|i| stars.facets(i).iter().map(|facet| (facet.neighbor, half(facet), facet.offset)).collect())
            .collect();
        for i in 0..count {
            for facet in stars.facets(i) {
                // Seen from the other side it lies clockwise.
                lists[facet.neighbor as usize].push((i as u32, half(facet), -facet.offset));
            }
        }
        let mut graph = Self { starts: vec![0], areas: stars.areas.clone(), ..Self::default() };
        for list in &mut lists {
            // A pair has two halves at most, so the order of their sum has no effect.
            list.sort_by_key(|(j, ..)| *j);
            for pair in list.chunk_by(|a, b| a.0 == b.0) {
                let conductance: f64 = pair.iter().map(|(_, half, _)| half).sum();
                let moment: f64 = pair.iter().map(|(_, half, offset)| half * offset).sum();
                graph.neighbors.push(pair[0].0);
                graph.conductances.push(conductance);
                graph.offsets.push(if conductance > 0.0 { moment / conductance } else { 0.0 });
            }
            graph.starts.push(graph.neighbors.len());
        }
        graph.is_open.clone_from(&stars.is_open);
        graph.find_parts();
        graph
    }

    /// The graph of the first `own` points, where neighbors that are copies stand for the points that they are copies of (`source`).
    /// Conductances are the mean of both sides, so that they are symmetric to the last bit.
    #[must_use]
    pub fn folded(&self, own: usize, source: &[u32]) -> Self {
        let mut lists: Vec<Vec<(u32, f64, f64)>> = Vec::with_capacity(own);
        for i in 0..own {
            let entries = self.neighbors(i).iter().zip(self.conductances(i)).zip(self.offsets(i));
            let mut list: Vec<_> =
                entries.map(|((j, conductance), offset)| (source[*j as usize], *conductance, *offset)).collect();
            list.retain(|(j, ..)| *j as usize != i);
            // Equal neighbors are copies of one point; their order has no effect on the sum of two.
            list.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            let merged = list.chunk_by(|a, b| a.0 == b.0).map(|same| {
                let conductance: f64 = same.iter().map(|entry| entry.1).sum();
                let moment: f64 = same.iter().map(|entry| entry.1 * entry.2).sum();
                (same[0].0, conductance, if conductance > 0.0 { moment / conductance } else { 0.0 })
            });
            lists.push(merged.collect());
        }
        let back = |i: usize, j: u32| {
            let list = &lists[j as usize];
            list.binary_search_by_key(&(i as u32), |entry| entry.0).map_or(0.0, |place| list[place].1)
        };
        let mut graph = Self { starts: vec![0], areas: self.areas[..own].to_vec(), ..Self::default() };
        for (i, list) in lists.iter().enumerate() {
            for (j, conductance, offset) in list {
                let other = back(i, *j);
                graph.neighbors.push(*j);
                graph.conductances.push(0.5 * conductance.min(other) + 0.5 * conductance.max(other));
                graph.offsets.push(*offset);
            }
            graph.starts.push(graph.neighbors.len());
        }
        graph.is_open = self.is_open[..own].to_vec();
        graph.find_parts();
        graph
    }

    /// Numbers the connected components.
    fn find_parts(&mut self) {
        const NONE: u32 = u32::MAX;
        self.parts = vec![NONE; self.len()];
        let mut open = Vec::new();
        for start in 0..self.len() {
            if self.parts[start] != NONE {
                continue;
            }
            let part = self.part_count as u32;
            self.part_count += 1;
            self.parts[start] = part;
            open.push(start as u32);
            while let Some(i) = open.pop() {
                for k in self.starts[i as usize]..self.starts[i as usize + 1] {
                    let j = self.neighbors[k];
                    if self.parts[j as usize] == NONE {
                        self.parts[j as usize] = part;
                        open.push(j);
                    }
                }
            }
        }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.areas.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty()
    }

    /// Whether the cell of point i is open.
    #[must_use]
    pub fn is_open(&self, i: usize) -> bool {
        self.is_open[i]
    }

    /// Number of points with an open cell.
    #[must_use]
    pub fn open_count(&self) -> usize {
        self.is_open.iter().filter(|open| **open).count()
    }

    /// Neighbors of point i, ascending.
    #[must_use]
    pub fn neighbors(&self, i: usize) -> &[u32] {
        &self.neighbors[self.starts[i]..self.starts[i + 1]]
    }

    /// Conductances ℓ_ij of the edges of point i, in the order of [`Self::neighbors`].
    #[must_use]
    pub fn conductances(&self, i: usize) -> &[f64] {
        &self.conductances[self.starts[i]..self.starts[i + 1]]
    }

    /// The middle of each facet of point i from the middle of the way to the neighbor, along n × (x_j − x_i), a length.
    #[must_use]
    pub fn offsets(&self, i: usize) -> &[f64] {
        &self.offsets[self.starts[i]..self.starts[i + 1]]
    }

    /// Numbers of points by part.
    #[must_use]
    pub fn part_sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.part_count];
        self.parts.iter().for_each(|part| sizes[*part as usize] += 1);
        sizes
    }
}

#[cfg(test)]
mod tests {
    use super::{StarGraph, Stars};
    use crate::geometry::{Vector, fibonacci};
    use crate::point_clouds::local_spacing::{Nearest, at_each_point, smoothed};

    #[test]
    fn two_spheres_are_two_parts_and_edges_are_symmetric() {
        let ball = fibonacci::sphere(400);
        let points: Vec<Vector<3>> =
            ball.iter().copied().chain(ball.iter().map(|x| x * 0.5 + Vector::<3>::x() * 2.0)).collect();
        let normals: Vec<Vector<3>> = ball.iter().chain(&ball).copied().collect();
        let nearest = Nearest::new(&points, 30);
        let spacing = smoothed::<3>(&at_each_point(&points, &nearest), &nearest);
        let graph = StarGraph::new(&Stars::new(&points, &nearest, &normals, &spacing));
        assert_eq!((graph.part_count, graph.open_count(), graph.part_sizes()), (2, 0, vec![400, 400]));
        assert!(graph.parts[..400].iter().all(|part| *part == 0) && graph.parts[400..].iter().all(|part| *part == 1));
        for i in 0..800 {
            for (j, conductance) in graph.neighbors(i).iter().zip(graph.conductances(i)) {
                let back = graph.neighbors(*j as usize).binary_search(&(i as u32)).unwrap();
                assert_eq!(graph.conductances(*j as usize)[back], *conductance);
            }
        }
    }
}
