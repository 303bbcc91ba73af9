//! A k-d tree for the nearest points of clouds whose density varies (Bentley 1975).
//!
//! The tree is balanced: the node of a range of points is its median along the longest side of their box. A search takes
//! about as long on dense parts of a cloud as on sparse ones.

use crate::geometry::Vector;

/// Points of a range that are not split further.
const LEAF: usize = 10;

/// The points of a cloud in the order of a balanced tree.
///
/// ```
/// use meniscus::{geometry::Vector, neighbors::KdTree};
///
/// let points = [Vector::<2>::new(0.0, 0.0), Vector::<2>::new(1.0, 0.0), Vector::<2>::new(5.0, 0.0)];
/// let tree = KdTree::new(&points);
/// let mut found = Vec::new();
/// tree.nearest(&Vector::<2>::new(4.0, 0.0), 2, &mut found);
/// assert_eq!(found, [(1.0, 2), (9.0, 1)]);
/// ```
#[derive(Debug, Clone)]
pub struct KdTree<const D: usize> {
    /// Points in the order of the tree.
    sorted: Vec<Vector<D>>,
    /// Index of each of them in the cloud.
    order: Vec<u32>,
    /// Axis of the split at each median.
    axes: Vec<u8>,
}

impl<const D: usize> KdTree<D> {
    /// The tree of finite points.
    #[must_use]
    pub fn new(points: &[Vector<D>]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(points, &mut order, &mut axes);
        let sorted = order.iter().map(|i| points[*i as usize]).collect();
        Self { sorted, order, axes }
    }

    /// Replaces `found` by the squared distances and the indices of the `count` points that are nearest to `x`, nearest
    /// first. Of equally near points the one with the smaller index comes first.
    pub fn nearest(&self, x: &Vector<D>, count: usize, found: &mut Vec<(f64, u32)>) {
        found.clear();
        if count > 0 {
            self.search((0, self.sorted.len()), x, count, found);
        }
    }

    fn search(&self, (from, to): (usize, usize), x: &Vector<D>, count: usize, found: &mut Vec<(f64, u32)>) {
        if to - from <= LEAF {
            (from..to).for_each(|slot| self.offer(slot, x, count, found));
            return;
        }
        let middle = usize::midpoint(from, to);
        let axis = usize::from(self.axes[middle]);
        let beyond = x[axis] - self.sorted[middle][axis];
        let (near, far) =
            if beyond < 0.0 { ((from, middle), (middle + 1, to)) } else { ((middle + 1, to), (from, middle)) };
        self.search(near, x, count, found);
        self.offer(middle, x, count, found);
        if found.len() < count || found.last().is_some_and(|(square, _)| beyond * beyond <= *square) {
            self.search(far, x, count, found);
        }
    }

    /// Takes a point in if it is among the nearest so far.
    #[inline(always)]
    fn offer(&self, slot: usize, x: &Vector<D>, count: usize, found: &mut Vec<(f64, u32)>) {
        let offered = ((self.sorted[slot] - x).norm_squared(), self.order[slot]);
        let is_before = |other: &(f64, u32)| (other.0, other.1) < offered;
        if found.len() == count {
            if found.last().is_some_and(is_before) {
                return;
            }
            found.pop();
        }
        let mut place = found.len();
        while place > 0 && !is_before(&found[place - 1]) {
            place -= 1;
        }
        found.insert(place, offered);
    }
}

/// Puts the median of the points along the longest side of their box into the middle, and splits both halves likewise.
fn split<const D: usize>(points: &[Vector<D>], order: &mut [u32], axes: &mut [u8]) {
    if order.len() <= LEAF {
        return;
    }
    let start = points[order[0] as usize];
    let bounds = |(low, high): (Vector<D>, Vector<D>), i: &u32| {
        let x = points[*i as usize];
        (low.inf(&x), high.sup(&x))
    };
    let (low, high) = order.iter().fold((start, start), bounds);
    let axis = (high - low).imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| {
        points[*a as usize][axis].total_cmp(&points[*b as usize][axis]).then(a.cmp(b))
    });
    axes[middle] = axis as u8;
    let (lower, upper) = order.split_at_mut(middle);
    let (lower_axes, upper_axes) = axes.split_at_mut(middle);
    split(points, lower, lower_axes);
    split(points, &mut upper[1..], &mut upper_axes[1..]);
}

#[cfg(test)]
mod tests {
    use super::{KdTree, Vector};
    use crate::geometry::random::CounterRandom;

    #[test]
    fn nearest_points_are_those_of_sorting_all() {
        let random = CounterRandom::new(3);
        // Two thirds of the points crowd in a corner, and some coincide.
        let at = |i: i64| {
            let scale = if i % 3 == 0 { 1.0 } else { 1e-3 };
            Vector::<3>::from_fn(|d, _| scale * random.symmetric(&[i - i % 7 / 6, d as i64]))
        };
        let points: Vec<_> = (0..500).map(at).collect();
        let tree = KdTree::new(&points);
        let mut found = Vec::new();
        for (k, x) in points.iter().enumerate().step_by(11) {
            let mut all: Vec<(f64, u32)> =
                points.iter().enumerate().map(|(j, y)| ((y - x).norm_squared(), j as u32)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for count in [1, 13, 40, 600] {
                tree.nearest(x, count, &mut found);
                assert_eq!(found, all[..count.min(500)], "{k} {count}");
            }
        }
        tree.nearest(&points[0], 0, &mut found);
        assert!(found.is_empty());
    }
}
