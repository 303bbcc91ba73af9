//! Cell list: points sorted by the cell of a Cartesian grid that they lie in, x running fastest, so that the cells
//! of a row are one contiguous range of points.
//!
//! Along periodic axes the grid divides the period into whole cells and rows wrap round; along the others it covers
//! the bounding box of the points. Rebuilding reuses all storage.

use super::{Neighbor, NeighborSearch};
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
    /// 1/edge: divisions cost as much as the rest of a look-up.
    inverse_edge: Vector<D>,
    /// Whether any axis is periodic.
    is_wrapped: bool,
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
            is_wrapped: domain.axes().iter().any(|axis| matches!(axis, Axis::Periodic { .. })),
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
        // Points that are nowhere share one cell: whoever moved them will find out.
        let is_somewhere = low.iter().chain(high.iter()).all(|c| c.is_finite());
        if n == 0 || !is_somewhere {
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
        self.inverse_edge = self.edge.map(|edge| 1.0 / edge);
        self.sort(points);
    }

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
        // A stable counting sort; filling from the starts and shifting them back keeps one array.
        for (i, x) in points.enumerate() {
            let cell = self.cell_of[i];
            let place = self.starts[cell];
            self.order[place] = i;
            self.sorted[place] = self.wrap(x);
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
            let index = (x[d] - self.low[d]) * self.inverse_edge[d];
            (index.max(0.0) as usize).min(self.counts[d] - 1)
        })
    }

    fn flat(&self, cell: &[usize; D]) -> usize {
        (0..D).rev().fold(0, |flat, d| flat * self.counts[d] + cell[d])
    }

    #[inline(always)]
    fn wrap(&self, x: Vector<D>) -> Vector<D> {
        if self.is_wrapped { self.domain.wrap(x) } else { x }
    }

    #[inline(always)]
    fn displacement(&self, from: &Vector<D>, to: &Vector<D>) -> Vector<D> {
        if self.is_wrapped { self.domain.displacement(from, to) } else { to - from }
    }

    /// Whether a span of a row holds so few points that narrowing it costs more than it saves.
    #[inline(always)]
    fn is_row_short(&self, base: usize, span: (i64, i64)) -> bool {
        let (first, last) = (self.wrapped(span.0, 0), self.wrapped(span.1, 0));
        first <= last && self.starts[base + last + 1] - self.starts[base + first] < 8
    }

    fn is_periodic(&self, d: usize) -> bool {
        matches!(self.domain.axes()[d], Axis::Periodic { .. })
    }

    /// Range of (unwrapped) cell indices along axis d that can hold points within `radius` of `x`.
    fn span(&self, x: &Vector<D>, radius: f64, d: usize) -> (i64, i64) {
        // The padding covers rounding of the divisions for points exactly `radius` away.
        let (at, cutoff) = ((x[d] - self.low[d]) * self.inverse_edge[d], radius * self.inverse_edge[d]);
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

    /// Calls `visit` with each range of sorted places that the given spans of cells cover.
    #[inline(always)]
    fn for_each_range(&self, spans: &[(i64, i64); D], mut visit: impl FnMut(usize, usize)) {
        self.for_each_row(spans, |_, base| self.for_each_part(base, spans[0], &mut visit));
    }

    /// Calls `visit` with the (unwrapped) indices and the first cell of each row of the given spans.
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

    /// The one or two ranges of places of a span of cells of a row.
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
        // One call, so that it can be inlined.
        loop {
            if from < to {
                visit(from, to);
            }
            let Some(range) = rest.take() else { break };
            (from, to) = range;
        }
    }

    #[inline(always)]
    fn wrapped(&self, index: i64, d: usize) -> usize {
        let count = self.counts[d] as i64;
        // A division in the innermost loop is worth avoiding.
        if (0..count).contains(&index) { index as usize } else { index.rem_euclid(count) as usize }
    }

    fn spans(&self, x: &Vector<D>, radius: f64) -> [(i64, i64); D] {
        std::array::from_fn(|d| self.span(x, radius, d))
    }
}

impl<const D: usize> NeighborSearch<D> for CellList<D> {
    fn gather(&self, x: &Vector<D>, radius: f64, found: &mut Vec<Neighbor<D>>) {
        let x = self.wrap(*x);
        let limit = radius * radius;
        let nobody = Neighbor { r2: 0.0, index: 0, dx: Vector::<D>::zeros() };
        found.clear();
        self.for_each_range(&self.spans(&x, radius), |from, to| {
            let mut end = found.len();
            // Every candidate is written where the next hit belongs: a branch would be guessed wrong half the time.
            found.resize(end + (to - from), nobody);
            for (place, position) in (from..to).zip(&self.sorted[from..to]) {
                let dx = self.displacement(&x, position);
                let r2 = dx.norm_squared();
                found[end] = Neighbor { r2, index: self.order[place], dx };
                end += usize::from(r2 <= limit);
            }
            found.truncate(end);
        });
    }

    #[inline]
    fn for_each_within(&self, x: &Vector<D>, radius: f64, mut visit: impl FnMut(usize, &Vector<D>, f64)) {
        let x = self.wrap(*x);
        let limit = radius * radius;
        self.for_each_range(&self.spans(&x, radius), |from, to| {
            for place in from..to {
                let dx = self.displacement(&x, &self.sorted[place]);
                let r2 = dx.norm_squared();
                if r2 <= limit {
                    visit(self.order[place], &dx, r2);
                }
            }
        });
    }

    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)> {
        if self.is_empty() {
            return None;
        }
        // Search balls of doubling radius until one holds a point: the nearest point of that ball is the nearest.
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
    /// The points in the order of their cells.
    #[must_use]
    pub fn permutation(&self) -> &[usize] {
        &self.order
    }

    /// Positions in that order, wrapped into the domain.
    #[must_use]
    pub fn sorted(&self) -> &[Vector<D>] {
        &self.sorted
    }

    /// Places of the points of each cell: those of cell c are `starts[c]..starts[c + 1]`.
    #[must_use]
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// Whether the place of any point within `radius` fulfils the condition; the search ends with the first that does.
    pub fn any_within(&self, x: &Vector<D>, radius: f64, condition: impl Fn(usize) -> bool) -> bool {
        let x = self.wrap(*x);
        let limit = radius * radius;
        let mut found = false;
        self.for_each_range(&self.spans(&x, radius), |from, to| {
            found = found
                || (from..to).zip(&self.sorted[from..to]).any(|(place, position)| {
                    // The condition is often the cheaper half.
                    condition(place) && self.displacement(&x, position).norm_squared() <= limit
                });
        });
        found
    }

    /// Gives every cell the union of its own marks and those of the cells round it.
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

    /// The nearest point, as (index, r²), for someone who knows a point at the squared distance `known.1`.
    ///
    /// Rows of cells, and cells of a row, beyond the best so far are left out. Among equals the least index.
    #[must_use]
    pub fn nearest_from(&self, x: &Vector<D>, known: (usize, f64)) -> (usize, f64) {
        let x = self.wrap(*x);
        let mut best = known;
        let spans = self.spans(&x, known.1.sqrt());
        // A span of a whole period says nothing of how far its rows are.
        let is_whole: [bool; D] =
            std::array::from_fn(|d| self.is_periodic(d) && spans[d].1 - spans[d].0 + 1 >= self.counts[d] as i64);
        self.for_each_row(&spans, |row, base| {
            let mut away = 0.0;
            for d in 1..D {
                if !is_whole[d] {
                    let start = self.low[d] + row[d] as f64 * self.edge[d];
                    let gap = (start - x[d]).max(x[d] - start - self.edge[d]).max(0.0);
                    away += gap * gap;
                }
            }
            // Slack for the rounding of cell borders.
            if away * (1.0 - 1e-9) > best.1 {
                return;
            }
            let mut along = spans[0];
            if !is_whole[0] && !self.is_row_short(base, along) {
                let cutoff = (best.1 - away * (1.0 - 1e-9)).sqrt();
                let narrow = self.span(&x, cutoff, 0);
                along = (along.0.max(narrow.0), along.1.min(narrow.1));
            }
            self.for_each_part(base, along, |from, to| {
                for (place, position) in (from..to).zip(&self.sorted[from..to]) {
                    let dx = self.displacement(&x, position);
                    let r2 = dx.norm_squared();
                    if r2 < best.1 || r2 <= best.1 && self.order[place] < best.0 {
                        best = (self.order[place], r2);
                    }
                }
            });
        });
        best
    }

    /// The nearest point not farther than `reach`, as (index, r²), for one place after another: each search starts from
    /// the point that `last` holds, whose position `at` tells.
    #[must_use]
    pub fn nearest_next(
        &self,
        x: &Vector<D>,
        cutoff: f64,
        last: &mut Option<usize>,
        at: impl Fn(usize) -> Vector<D>,
    ) -> Option<(usize, f64)> {
        let nearest = match *last {
            Some(point) => self.nearest_from(x, (point, self.displacement(x, &at(point)).norm_squared())),
            // Without a point to start from, the search itself ends at the reach.
            None => self.nearest(x, cutoff).map(|(point, distance)| (point, distance * distance))?,
        };
        *last = Some(nearest.0);
        (nearest.1.sqrt() <= cutoff).then_some(nearest)
    }

    /// A distance that no point of the list exceeds from `x`.
    fn farthest(&self, x: &Vector<D>) -> f64 {
        let high = Vector::<D>::from_fn(|d, _| self.low[d] + self.edge[d] * self.counts[d] as f64);
        (x - self.low).abs().sup(&(x - high).abs()).norm()
    }
}

#[cfg(test)]
mod tests;
