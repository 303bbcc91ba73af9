//! Cell list: points sorted by their cell in a Cartesian grid (Quentrec 1973).
//!
//! The index x runs fastest, so that the points of adjacent cells in a row form one contiguous range. Along periodic
//! axes the grid divides the period into whole cells, and rows wrap around. Along the other axes it covers the bounding
//! box of the points. In a sheared box the cells lean with it, so that rows still meet across its ends. A rebuild reuses all
//! memory.

use super::{Neighbor, NeighborSearch};
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};

mod nearest;

/// Points sorted into the cells of a grid.
///
/// ```
/// use meniscus::geometry::{Domain, Vector};
/// use meniscus::neighbors::{CellList, NeighborSearch};
///
/// let points = [Vector::<2>::new(0.0, 0.0), Vector::<2>::new(1.0, 0.0), Vector::<2>::new(5.0, 0.0)];
/// let mut cells = CellList::new(Domain::unbounded());
/// cells.rebuild(points.iter().copied(), 1.5);
/// assert_eq!(cells.nearest(&Vector::<2>::new(4.0, 0.0), 2.0), Some((2, 1.0)));
/// ```
#[derive(Debug, Clone)]
pub struct CellList<const D: usize> {
    domain: Domain<D>,
    /// Lower corner of the grid.
    low: Vector<D>,
    /// Edge lengths of a cell.
    edge: Vector<D>,
    /// 1/edge, since a division costs as much as the rest of a look-up.
    inverse_edge: Vector<D>,
    /// Whether any axis is periodic.
    is_wrapped: bool,
    /// The axis along which cells lean in x, and by how much; 0 in a box that is not sheared.
    lean: (usize, f64),
    /// Number of cells along each axis.
    counts: [usize; D],
    /// First sorted slot of each cell, and the number of points at the end.
    starts: Vec<usize>,
    /// Index of the point in each sorted slot.
    order: Vec<usize>,
    /// Positions in sorted order, wrapped into the domain.
    sorted: Vec<Vector<D>>,
    /// Cell of each point, in the original order.
    cell_of: Vec<usize>,
}

impl<const D: usize> CellList<D> {
    /// An empty list over a domain.
    #[must_use]
    pub fn new(domain: Domain<D>) -> Self {
        Self {
            is_wrapped: domain.axes().iter().any(|axis| matches!(axis, Axis::Periodic { .. })),
            lean: lean(&domain),
            domain,
            low: Vector::<D>::zeros(),
            edge: Vector::<D>::repeat(1.0),
            inverse_edge: Vector::<D>::repeat(1.0),
            counts: [1; D],
            starts: vec![0, 0],
            order: Vec::new(),
            sorted: Vec::new(),
            cell_of: Vec::new(),
        }
    }

    /// Replaces the domain, before the next rebuild.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        self.lean = lean(domain);
        self.domain = domain.clone();
    }

    /// Sorts points into cells with edges of at least `edge`.
    ///
    /// Cells become larger where there would be more than four of them per point.
    pub fn rebuild(&mut self, points: impl ExactSizeIterator<Item = Vector<D>> + Clone, edge: f64) {
        let n = points.len();
        let mut low = Vector::<D>::repeat(f64::INFINITY);
        let mut high = Vector::<D>::repeat(f64::NEG_INFINITY);
        for x in points.clone() {
            low = low.inf(&x);
            high = high.sup(&x);
        }
        // Points with infinite or undefined coordinates share one cell. The scheme that moved them reports them.
        let is_finite = low.iter().chain(high.iter()).all(|c| c.is_finite());
        if n == 0 || !is_finite {
            low = Vector::<D>::zeros();
            high = Vector::<D>::zeros();
        }
        let max_cells = 4 * n + 64;
        let mut wanted = edge;
        loop {
            let mut cells = 1.0;
            for d in 0..D {
                let (start, length) = match self.domain.axes()[d] {
                    Axis::Unbounded => (low[d], high[d] - low[d]),
                    Axis::Periodic { start, length } => (start, length),
                };
                self.low[d] = start;
                // What is within an edge of a cell lies in those next to it, where they lean as well.
                let least = if d == 0 { wanted * self.lean.1.hypot(1.0) } else { wanted };
                let along = match self.domain.axes()[d] {
                    // One more cell for the point with the largest coordinate.
                    Axis::Unbounded => (length / wanted).floor() + 1.0,
                    Axis::Periodic { .. } => (length / least).floor().max(1.0),
                };
                self.edge[d] = match self.domain.axes()[d] {
                    Axis::Unbounded => wanted,
                    Axis::Periodic { .. } => length / along,
                };
                cells *= along;
                self.counts[d] = along.min(1e9) as usize;
            }
            if cells <= max_cells as f64 {
                break;
            }
            wanted *= 1.5;
        }
        self.inverse_edge = self.edge.map(|edge| 1.0 / edge);
        self.sort(points);
    }

    /// A stable counting sort of the points by their cells.
    fn sort(&mut self, points: impl ExactSizeIterator<Item = Vector<D>> + Clone) {
        let cells: usize = self.counts.iter().product();
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.cell_of.clear();
        for x in points.clone() {
            let cell = self.flat(&self.cell(&self.wrap(x)));
            self.cell_of.push(cell);
            self.starts[cell + 1] += 1;
        }
        for c in 0..cells {
            self.starts[c + 1] += self.starts[c];
        }
        let n = self.cell_of.len();
        self.order.resize(n, 0);
        self.sorted.resize(n, Vector::<D>::zeros());
        // Filling advances the starts of the cells; they are shifted back afterwards, which saves a second array.
        for (i, x) in points.enumerate() {
            let cell = self.cell_of[i];
            let slot = self.starts[cell];
            self.order[slot] = i;
            self.sorted[slot] = self.wrap(x);
            self.starts[cell] += 1;
        }
        for c in (1..=cells).rev() {
            self.starts[c] = self.starts[c - 1];
        }
        self.starts[0] = 0;
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// How far a point lies behind the lower end of the grid along axis d, along x behind that of its row.
    #[inline(always)]
    fn along(&self, x: &Vector<D>, d: usize) -> f64 {
        let (axis, slope) = self.lean;
        if d == 0 && axis > 0 { x[0] - self.low[0] - slope * (x[axis] - self.low[axis]) } else { x[d] - self.low[d] }
    }

    /// Grid indices of the cell that contains a wrapped point.
    fn cell(&self, x: &Vector<D>) -> [usize; D] {
        std::array::from_fn(|d| {
            let index = self.along(x, d) * self.inverse_edge[d];
            (index.max(0.0) as usize).min(self.counts[d] - 1)
        })
    }

    /// Number of a cell with the given grid indices.
    fn flat(&self, cell: &[usize; D]) -> usize {
        (0..D).rev().fold(0, |flat, d| flat * self.counts[d] + cell[d])
    }

    /// The image of a point in the grid.
    #[inline(always)]
    fn wrap(&self, x: Vector<D>) -> Vector<D> {
        if !self.is_wrapped {
            return x;
        }
        let mut x = self.domain.wrap(x);
        if self.lean.0 > 0 {
            let length = self.domain.length(0);
            x[0] -= (self.along(&x, 0) / length).floor() * length;
        }
        x
    }

    /// The displacement `to - from`, `wraps` as in [`Self::displacement`].
    #[inline(always)]
    fn nearest_image(&self, from: &Vector<D>, to: &Vector<D>, wraps: bool) -> Vector<D> {
        if wraps { self.displacement::<true>(from, to) } else { self.displacement::<false>(from, to) }
    }

    /// The displacement `to - from`. With `WRAPS` it is the shortest of all images; without it, no image may be nearer
    /// (see [`Self::crosses_border`]), which saves a division along each axis.
    #[inline(always)]
    fn displacement<const WRAPS: bool>(&self, from: &Vector<D>, to: &Vector<D>) -> Vector<D> {
        if WRAPS { self.domain.displacement(from, to) } else { to - from }
    }

    /// Whether a displacement between two points in the given spans of cells may have to be wrapped: a span reaches over
    /// the border of a period, or is as long as half a period.
    #[inline(always)]
    fn crosses_border(&self, spans: &[(i64, i64); D]) -> bool {
        let crosses = |d: usize| {
            let ((first, last), count) = (spans[d], self.counts[d] as i64);
            self.is_periodic(d) && (first < 0 || last >= count || 2 * (last - first + 1) >= count)
        };
        self.is_wrapped && (0..D).any(crosses)
    }

    /// Whether a span of a row contains so few points that narrowing it costs more than it saves.
    #[inline(always)]
    fn is_row_short(&self, base: usize, span: (i64, i64)) -> bool {
        let (first, last) = (self.wrapped(span.0, 0), self.wrapped(span.1, 0));
        first <= last && self.starts[base + last + 1] - self.starts[base + first] < 8
    }

    fn is_periodic(&self, d: usize) -> bool {
        matches!(self.domain.axes()[d], Axis::Periodic { .. })
    }

    /// First and last cell index along axis d, not wrapped, whose cells can contain points within `radius` of `x`.
    fn span(&self, x: &Vector<D>, radius: f64, d: usize) -> (i64, i64) {
        // The padding covers the rounding of the products for points at the distance `radius` itself.
        let reach = if d == 0 && self.lean.0 > 0 { radius * self.lean.1.hypot(1.0) } else { radius };
        let (at, cutoff) = (self.along(x, d) * self.inverse_edge[d], reach * self.inverse_edge[d]);
        let pad = 1e-9 * (1.0 + at.abs());
        let first = (at - cutoff - pad).floor();
        let last = (at + cutoff + pad).floor();
        let count = self.counts[d] as f64;
        if self.is_periodic(d) {
            if last - first + 1.0 >= count { (0, self.counts[d] as i64 - 1) } else { (first as i64, last as i64) }
        } else {
            (first.max(0.0) as i64, last.min(count - 1.0) as i64)
        }
    }

    /// Calls `visit` with each range of sorted slots in the given spans of cells.
    #[inline(always)]
    fn for_each_range(&self, spans: &[(i64, i64); D], mut visit: impl FnMut(usize, usize)) {
        self.for_each_row(spans, |_, base| self.for_each_part(base, spans[0], &mut visit));
    }

    /// Calls `visit` with the indices, not wrapped, and the first cell of each row in the given spans.
    #[inline(always)]
    fn for_each_row(&self, spans: &[(i64, i64); D], mut visit: impl FnMut(&[i64; D], usize)) {
        if spans.iter().any(|(first, last)| first > last) {
            return;
        }
        let mut row: [i64; D] = std::array::from_fn(|d| spans[d].0);
        loop {
            let mut base = 0;
            for d in (1..D).rev() {
                base = (base + self.wrapped(row[d], d)) * self.counts[d - 1];
            }
            visit(&row, base);
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

    /// Calls `visit` with the ranges of sorted slots of a span of cells in a row: one, or two where the span wraps
    /// around.
    #[inline(always)]
    fn for_each_part(&self, base: usize, span: (i64, i64), mut visit: impl FnMut(usize, usize)) {
        if span.0 > span.1 {
            return;
        }
        let (first, last) = (self.wrapped(span.0, 0), self.wrapped(span.1, 0));
        let (mut from, mut to) = (self.starts[base + first], self.starts[base + last + 1]);
        let mut rest = None;
        if first > last {
            (rest, from, to) = (Some((self.starts[base], to)), from, self.starts[base + self.counts[0]]);
        }
        // A single call of `visit` in the code lets the compiler inline it.
        loop {
            if from < to {
                visit(from, to);
            }
            let Some(range) = rest.take() else { break };
            (from, to) = range;
        }
    }

    /// A cell index along axis d, wrapped into the grid.
    #[inline(always)]
    fn wrapped(&self, index: i64, d: usize) -> usize {
        let count = self.counts[d] as i64;
        // The test avoids a division in the innermost loop.
        if (0..count).contains(&index) { index as usize } else { index.rem_euclid(count) as usize }
    }

    /// Appends the points of the given spans within `radius` of `x`; `WRAPS` as in [`Self::displacement`].
    fn gather_in<const WRAPS: bool>(
        &self,
        x: &Vector<D>,
        spans: &[(i64, i64); D],
        radius: f64,
        found: &mut Vec<Neighbor<D>>,
    ) {
        let limit = radius * radius;
        let filler = Neighbor { r2: 0.0, index: 0, dx: Vector::<D>::zeros() };
        self.for_each_range(spans, |from, to| {
            let mut end = found.len();
            // Each candidate is written to the slot of the next hit. A branch would be mispredicted half the time.
            found.resize(end + (to - from), filler);
            for (slot, position) in (from..to).zip(&self.sorted[from..to]) {
                let dx = self.displacement::<WRAPS>(x, position);
                let r2 = dx.norm_squared();
                found[end] = Neighbor { r2, index: self.order[slot], dx };
                end += usize::from(r2 <= limit);
            }
            found.truncate(end);
        });
    }

    /// Calls `visit` with the points of the given spans within `radius` of `x`; `WRAPS` as in [`Self::displacement`].
    #[inline]
    fn for_each_in<const WRAPS: bool>(
        &self,
        x: &Vector<D>,
        spans: &[(i64, i64); D],
        radius: f64,
        visit: &mut impl FnMut(usize, &Vector<D>, f64),
    ) {
        let limit = radius * radius;
        self.for_each_range(spans, |from, to| {
            for slot in from..to {
                let dx = self.displacement::<WRAPS>(x, &self.sorted[slot]);
                let r2 = dx.norm_squared();
                if r2 <= limit {
                    visit(self.order[slot], &dx, r2);
                }
            }
        });
    }

    /// The spans of cells along all axes that can contain points within `radius` of `x`.
    fn spans(&self, x: &Vector<D>, radius: f64) -> [(i64, i64); D] {
        std::array::from_fn(|d| self.span(x, radius, d))
    }
}

/// The axis of a domain along which its images are displaced, and by how much of its length.
fn lean<const D: usize>(domain: &Domain<D>) -> (usize, f64) {
    domain.tilt().map_or((0, 0.0), |tilt| (tilt.axis, tilt.offset / domain.length(tilt.axis)))
}

impl<const D: usize> NeighborSearch<D> for CellList<D> {
    fn gather(&self, x: &Vector<D>, radius: f64, found: &mut Vec<Neighbor<D>>) {
        let x = self.wrap(*x);
        let spans = self.spans(&x, radius);
        found.clear();
        if self.crosses_border(&spans) {
            self.gather_in::<true>(&x, &spans, radius, found);
        } else {
            self.gather_in::<false>(&x, &spans, radius, found);
        }
    }

    #[inline]
    fn for_each_within(&self, x: &Vector<D>, radius: f64, mut visit: impl FnMut(usize, &Vector<D>, f64)) {
        let x = self.wrap(*x);
        let spans = self.spans(&x, radius);
        if self.crosses_border(&spans) {
            self.for_each_in::<true>(&x, &spans, radius, &mut visit);
        } else {
            self.for_each_in::<false>(&x, &spans, radius, &mut visit);
        }
    }

    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)> {
        if self.is_empty() {
            return None;
        }
        // The radius doubles until the ball contains a point. The nearest point in the ball is then the nearest of all.
        let edge = self.edge.max();
        let widest = self.farthest(x);
        let mut radius = edge.min(cutoff);
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
            if radius >= cutoff || radius > widest {
                return None;
            }
            radius = (2.0 * radius).min(cutoff);
        }
    }
}

impl<const D: usize> CellList<D> {
    /// Indices of the points in the order of their cells.
    #[must_use]
    pub fn permutation(&self) -> &[usize] {
        &self.order
    }

    /// Positions in the order of [`Self::permutation`], wrapped into the domain.
    #[must_use]
    pub fn sorted(&self) -> &[Vector<D>] {
        &self.sorted
    }

    /// First slot of each cell: the points of cell c are in the slots `starts[c]..starts[c + 1]`.
    #[must_use]
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// Whether any point within `radius` has a slot that fulfills the condition. The search ends at the first such
    /// point.
    pub fn any_within(&self, x: &Vector<D>, radius: f64, condition: impl Fn(usize) -> bool) -> bool {
        let x = self.wrap(*x);
        let limit = radius * radius;
        let spans = self.spans(&x, radius);
        let wraps = self.crosses_border(&spans);
        let mut found = false;
        self.for_each_range(&spans, |from, to| {
            found = found
                || (from..to).zip(&self.sorted[from..to]).any(|(slot, position)| {
                    // The condition is often cheaper than the distance.
                    condition(slot) && self.nearest_image(&x, position, wraps).norm_squared() <= limit
                });
        });
        found
    }

    /// Gives every cell the union (bitwise or) of its own marks and those of the adjacent cells. `before` is a scratch
    /// buffer.
    pub fn spread_marks(&self, marks: &mut Vec<u8>, before: &mut Vec<u8>) {
        let mut stride = 1;
        for d in 0..D {
            let (count, wraps) = (self.counts[d], self.is_periodic(d));
            before.clone_from(marks);
            for cell in 0..marks.len() {
                let at = cell / stride % count;
                let last = (count - 1) * stride;
                if at > 0 || wraps {
                    marks[cell] |= before[if at > 0 { cell - stride } else { cell + last }];
                }
                if at + 1 < count || wraps {
                    marks[cell] |= before[if at + 1 < count { cell + stride } else { cell - last }];
                }
            }
            stride *= count;
        }
    }

    /// An upper bound of the distance from `x` to any point of the list.
    fn farthest(&self, x: &Vector<D>) -> f64 {
        let high = Vector::<D>::from_fn(|d, _| self.low[d] + self.edge[d] * self.counts[d] as f64);
        let (axis, slope) = self.lean;
        (x - self.low).abs().sup(&(x - high).abs()).norm() + (slope * (high[axis] - self.low[axis])).abs()
    }
}

#[cfg(test)]
mod tests;
