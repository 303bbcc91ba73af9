//! Cell list: points sorted by the cell of a Cartesian grid that they lie in, x running fastest, so that the cells
//! of a row are one contiguous range of points.
//!
//! Along periodic axes the grid divides the period into whole cells and rows wrap round; along the others it covers
//! the bounding box of the points. Rebuilding reuses all storage.

use super::NeighborSearch;
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};

/// Points in cells of an edge of at least the one asked for.
#[derive(Debug, Clone)]
pub struct CellList<const D: usize> {
    domain: Domain<D>,
    /// Lower corner of the grid.
    low: Vector<D>,
    /// Cell edges.
    edge: Vector<D>,
    counts: [usize; D],
    /// First sorted place of each cell, and one more for the end.
    starts: Vec<usize>,
    /// Index of the point at each sorted place.
    order: Vec<usize>,
    /// Positions in sorted order (wrapped into the domain).
    sorted: Vec<Vector<D>>,
    cell_of: Vec<usize>,
}

impl<const D: usize> CellList<D> {
    /// An empty list over a domain.
    #[must_use]
    pub fn new(domain: Domain<D>) -> Self {
        Self {
            domain,
            low: Vector::<D>::zeros(),
            edge: Vector::<D>::repeat(1.0),
            counts: [1; D],
            starts: vec![0, 0],
            order: Vec::new(),
            sorted: Vec::new(),
            cell_of: Vec::new(),
        }
    }

    /// Sorts the points anew into cells of an edge of at least `edge`.
    ///
    /// When points spread over so much space that cells would outnumber points four to one, cells grow.
    pub fn rebuild(&mut self, points: impl ExactSizeIterator<Item = Vector<D>> + Clone, edge: f64) {
        let n = points.len();
        let mut low = Vector::<D>::repeat(f64::INFINITY);
        let mut high = Vector::<D>::repeat(f64::NEG_INFINITY);
        for x in points.clone() {
            low = low.inf(&x);
            high = high.sup(&x);
        }
        if n == 0 {
            low = Vector::<D>::zeros();
            high = Vector::<D>::zeros();
        }
        let most = 4 * n + 64;
        let mut wanted = edge;
        loop {
            let mut cells = 1.0;
            for d in 0..D {
                let (start, length) = match self.domain.axes()[d] {
                    Axis::Unbounded => (low[d], high[d] - low[d]),
                    Axis::Periodic { start, length } => (start, length),
                };
                self.low[d] = start;
                let along = match self.domain.axes()[d] {
                    // One more cell, so that the highest point has a cell of its own.
                    Axis::Unbounded => (length / wanted).floor() + 1.0,
                    Axis::Periodic { .. } => (length / wanted).floor().max(1.0),
                };
                self.edge[d] = match self.domain.axes()[d] {
                    Axis::Unbounded => wanted,
                    Axis::Periodic { .. } => length / along,
                };
                cells *= along;
                self.counts[d] = along.min(1e9) as usize;
            }
            if cells <= most as f64 {
                break;
            }
            wanted *= 1.5;
        }
        self.sort(points);
    }

    fn sort(&mut self, points: impl ExactSizeIterator<Item = Vector<D>> + Clone) {
        let cells: usize = self.counts.iter().product();
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.cell_of.clear();
        for x in points.clone() {
            let cell = self.flat(&self.cell(&self.domain.wrap(x)));
            self.cell_of.push(cell);
            self.starts[cell + 1] += 1;
        }
        for c in 0..cells {
            self.starts[c + 1] += self.starts[c];
        }
        let n = self.cell_of.len();
        self.order.resize(n, 0);
        self.sorted.resize(n, Vector::<D>::zeros());
        // A stable counting sort; filling from the starts and shifting them back keeps one array.
        for (i, x) in points.enumerate() {
            let cell = self.cell_of[i];
            let place = self.starts[cell];
            self.order[place] = i;
            self.sorted[place] = self.domain.wrap(x);
            self.starts[cell] += 1;
        }
        for c in (1..=cells).rev() {
            self.starts[c] = self.starts[c - 1];
        }
        self.starts[0] = 0;
    }

    /// How many points are in the list.
    #[must_use]
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    fn cell(&self, x: &Vector<D>) -> [usize; D] {
        std::array::from_fn(|d| {
            let index = ((x[d] - self.low[d]) / self.edge[d]).floor();
            (index.max(0.0) as usize).min(self.counts[d] - 1)
        })
    }

    fn flat(&self, cell: &[usize; D]) -> usize {
        (0..D).rev().fold(0, |flat, d| flat * self.counts[d] + cell[d])
    }

    fn is_periodic(&self, d: usize) -> bool {
        matches!(self.domain.axes()[d], Axis::Periodic { .. })
    }

    /// Range of (unwrapped) cell indices along axis d that can hold points within `radius` of `x`.
    fn span(&self, x: &Vector<D>, radius: f64, d: usize) -> (i64, i64) {
        // The padding covers rounding of the divisions for points exactly `radius` away.
        let pad = 1e-9 * (1.0 + (x[d] - self.low[d]).abs() / self.edge[d]);
        let first = ((x[d] - radius - self.low[d]) / self.edge[d] - pad).floor();
        let last = ((x[d] + radius - self.low[d]) / self.edge[d] + pad).floor();
        let count = self.counts[d] as f64;
        if self.is_periodic(d) {
            if last - first + 1.0 >= count { (0, self.counts[d] as i64 - 1) } else { (first as i64, last as i64) }
        } else {
            (first.max(0.0) as i64, last.min(count - 1.0) as i64)
        }
    }

    /// Calls `visit` with each range of sorted places that the given spans of cells cover.
    fn for_each_range(&self, spans: &[(i64, i64); D], mut visit: impl FnMut(usize, usize)) {
        if spans.iter().any(|(first, last)| first > last) {
            return;
        }
        let wrap = |index: i64, d: usize| index.rem_euclid(self.counts[d] as i64) as usize;
        let mut row: [i64; D] = std::array::from_fn(|d| spans[d].0);
        loop {
            let mut base = 0;
            for d in (1..D).rev() {
                base = (base + wrap(row[d], d)) * self.counts[d - 1];
            }
            let (first, last) = (wrap(spans[0].0, 0), wrap(spans[0].1, 0));
            if first <= last {
                visit(self.starts[base + first], self.starts[base + last + 1]);
            } else {
                visit(self.starts[base + first], self.starts[base + self.counts[0]]);
                visit(self.starts[base], self.starts[base + last + 1]);
            }
            let mut d = 1;
            loop {
                if d == D {
                    return;
                }
                row[d] += 1;
                if row[d] <= spans[d].1 {
                    break;
                }
                row[d] = spans[d].0;
                d += 1;
            }
        }
    }

    fn spans(&self, x: &Vector<D>, radius: f64) -> [(i64, i64); D] {
        std::array::from_fn(|d| self.span(x, radius, d))
    }
}

impl<const D: usize> NeighborSearch<D> for CellList<D> {
    #[inline]
    fn for_each_within(&self, x: &Vector<D>, radius: f64, mut visit: impl FnMut(usize, &Vector<D>, f64)) {
        let x = self.domain.wrap(*x);
        let limit = radius * radius;
        self.for_each_range(&self.spans(&x, radius), |from, to| {
            for place in from..to {
                let dx = self.domain.displacement(&x, &self.sorted[place]);
                let r2 = dx.norm_squared();
                if r2 <= limit {
                    visit(self.order[place], &dx, r2);
                }
            }
        });
    }

    fn nearest(&self, x: &Vector<D>, reach: f64) -> Option<(usize, f64)> {
        if self.is_empty() {
            return None;
        }
        // Search balls of doubling radius until one holds a point: the nearest point of that ball is the nearest.
        let edge = self.edge.max();
        let widest = self.farthest(x);
        let mut radius = edge.min(reach);
        loop {
            let mut best = (usize::MAX, f64::INFINITY);
            self.for_each_within(x, radius, |j, _, r2| {
                if r2 < best.1 || r2 <= best.1 && j < best.0 {
                    best = (j, r2);
                }
            });
            if best.0 != usize::MAX {
                return Some((best.0, best.1.sqrt()));
            }
            if radius >= reach || radius > widest {
                return None;
            }
            radius = (2.0 * radius).min(reach);
        }
    }
}

impl<const D: usize> CellList<D> {
    /// A distance that no point of the list exceeds from `x`.
    fn farthest(&self, x: &Vector<D>) -> f64 {
        let high = Vector::<D>::from_fn(|d, _| self.low[d] + self.edge[d] * self.counts[d] as f64);
        (x - self.low).abs().sup(&(x - high).abs()).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::{Axis, CellList, Domain, NeighborSearch, Vector};
    use crate::geometry::random::CounterRandom;
    use crate::neighbors::BruteForce;

    fn domains<const D: usize>() -> Vec<Domain<D>> {
        let periodic = Axis::Periodic { start: -1.0, length: 2.0 };
        let mut mixed = [Axis::Unbounded; D];
        mixed[0] = periodic;
        vec![Domain::unbounded(), Domain::new([periodic; D]), Domain::new(mixed)]
    }

    fn cloud<const D: usize>(n: i64, seed: u64) -> Vec<Vector<D>> {
        let random = CounterRandom::new(seed);
        (0..n).map(|i| Vector::<D>::from_fn(|d, _| random.symmetric(&[i, d as i64]))).collect()
    }

    fn within<const D: usize>(search: &impl NeighborSearch<D>, x: &Vector<D>, radius: f64) -> Vec<(usize, u64)> {
        let mut found = Vec::new();
        search.for_each_within(x, radius, |j, _, r2| found.push((j, r2.to_bits())));
        found.sort_unstable();
        found
    }

    fn compare<const D: usize>(points: &[Vector<D>], queries: &[Vector<D>], radius: f64) {
        for domain in domains::<D>() {
            let wrapped: Vec<Vector<D>> = points.iter().map(|x| domain.wrap(*x)).collect();
            let oracle = BruteForce { domain: &domain, points: &wrapped };
            for edge in [0.05, radius * 0.9999, radius, radius * 1.0001, 0.9, 7.0] {
                let mut cells = CellList::new(domain.clone());
                cells.rebuild(points.iter().copied(), edge);
                for x in queries {
                    let x = domain.wrap(*x);
                    for r in [radius * 0.9999, radius, radius * 1.0001] {
                        assert_eq!(within(&cells, &x, r), within(&oracle, &x, r), "edge {edge}, radius {r}");
                    }
                    let (a, b) = (cells.nearest(&x, 0.3), oracle.nearest(&x, 0.3));
                    assert_eq!(a, b, "edge {edge} at {x:?}");
                    assert_eq!(cells.nearest(&x, 1e9), oracle.nearest(&x, 1e9));
                }
            }
        }
    }

    #[test]
    fn agrees_with_brute_force_in_2d_and_3d() {
        compare::<2>(&cloud(400, 1), &cloud(60, 2), 0.31);
        compare::<3>(&cloud(400, 3), &cloud(40, 4), 0.31);
    }

    #[test]
    fn agrees_for_lattices_whose_neighbours_lie_exactly_on_the_radius() {
        let points: Vec<Vector<2>> =
            (0..256).map(|k| Vector::<2>::new(f64::from(k % 16) / 8.0 - 1.0, f64::from(k / 16) / 8.0 - 1.0)).collect();
        compare::<2>(&points, &points[..64], 0.25);
    }

    #[test]
    fn box_edges_one_ulp_apart_and_far_outliers() {
        let mut points = cloud::<2>(50, 5);
        for edge in [-1.0_f64, 1.0] {
            points.push(Vector::<2>::new(edge, edge));
            points.push(Vector::<2>::new(edge.next_up(), edge.next_down()));
        }
        points.push(Vector::<2>::new(1e6, -1e6));
        compare::<2>(&points, &points.clone(), 0.31);
    }

    #[test]
    fn empty_and_single() {
        let mut cells = CellList::<3>::new(Domain::unbounded());
        cells.rebuild(std::iter::empty(), 0.1);
        assert_eq!(cells.nearest(&Vector::<3>::zeros(), 1e9), None);
        cells.rebuild([Vector::<3>::new(5.0, 5.0, 5.0)].into_iter(), 0.1);
        assert_eq!(cells.nearest(&Vector::<3>::new(5.0, 5.0, 1.0), 1e9), Some((0, 4.0)));
    }
}
