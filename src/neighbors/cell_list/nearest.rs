//! The nearest point of a cell list, given one that is near already.

use super::CellList;
use crate::geometry::Vector;
use crate::neighbors::NeighborSearch;

impl<const D: usize> CellList<D> {
    /// Index and squared distance of the nearest point, given a `known` point with its squared distance.
    ///
    /// Rows and cells farther away than the best point so far are skipped. Of equally near points the one with the
    /// smallest index is returned.
    #[must_use]
    pub fn nearest_from(&self, x: &Vector<D>, known: (usize, f64)) -> (usize, f64) {
        let x = self.wrap(*x);
        let spans = self.spans(&x, known.1.sqrt());
        if self.crosses_border(&spans) {
            self.nearest_in::<true>(&x, &spans, known)
        } else {
            self.nearest_in::<false>(&x, &spans, known)
        }
    }

    /// The search of [`Self::nearest_from`] in spans of cells; `WRAPS` as in [`Self::displacement`].
    fn nearest_in<const WRAPS: bool>(
        &self,
        x: &Vector<D>,
        spans: &[(i64, i64); D],
        known: (usize, f64),
    ) -> (usize, f64) {
        let mut best = known;
        // The indices of a span over a whole period do not tell the distance of its rows.
        let is_whole: [bool; D] =
            std::array::from_fn(|d| self.is_periodic(d) && spans[d].1 - spans[d].0 + 1 >= self.counts[d] as i64);
        self.for_each_row(spans, |row, base| {
            let mut row_distance = 0.0;
            for d in 1..D {
                if !is_whole[d] {
                    let start = self.low[d] + row[d] as f64 * self.edge[d];
                    let gap = (start - x[d]).max(x[d] - start - self.edge[d]).max(0.0);
                    row_distance += gap * gap;
                }
            }
            // The slack covers the rounding of cell borders.
            if row_distance * (1.0 - 1e-9) > best.1 {
                return;
            }
            let mut along = spans[0];
            if !is_whole[0] && !self.is_row_short(base, along) {
                // Rows that lean are met at another place along them than the nearest.
                let used = if self.lean.0 > 0 { 0.0 } else { row_distance * (1.0 - 1e-9) };
                let narrow = self.span(x, (best.1 - used).sqrt(), 0);
                along = (along.0.max(narrow.0), along.1.min(narrow.1));
            }
            self.for_each_part(base, along, |from, to| {
                for (slot, position) in (from..to).zip(&self.sorted[from..to]) {
                    let r2 = self.displacement::<WRAPS>(x, position).norm_squared();
                    if r2 < best.1 || r2 <= best.1 && self.order[slot] < best.0 {
                        best = (self.order[slot], r2);
                    }
                }
            });
        });
        best
    }

    /// Index and squared distance of the nearest point with `r ≤ cutoff`, for a sequence of nearby queries.
    ///
    /// - `last`: result of the query before, from which the search starts; replaced by the result of this query.
    /// - `at`: position of a point by its index.
    #[must_use]
    pub fn nearest_next(
        &self,
        x: &Vector<D>,
        cutoff: f64,
        last: &mut Option<usize>,
        at: impl Fn(usize) -> Vector<D>,
    ) -> Option<(usize, f64)> {
        let nearest = match *last {
            Some(point) => {
                self.nearest_from(x, (point, self.nearest_image(x, &at(point), self.is_wrapped).norm_squared()))
            }
            // The plain search respects the cutoff itself.
            None => self.nearest(x, cutoff).map(|(point, distance)| (point, distance * distance))?,
        };
        *last = Some(nearest.0);
        (nearest.1.sqrt() <= cutoff).then_some(nearest)
    }
}
