//! A tree of boxes about items in space, for the search of those near a place.

use super::Vector;

/// Items in a leaf at most.
const LEAF: usize = 4;

/// Items in boxes, sorted by place.
#[derive(Debug, Clone)]
pub(crate) struct BoxTree<const D: usize> {
    nodes: Vec<Node<D>>,
    /// Indices of the items, those of a leaf together.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Node<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
    /// The items of the node, as a range of `order`.
    start: u32,
    end: u32,
    /// Index of the second child; the first one follows its parent. 0 in a leaf.
    second: u32,
}

impl<const D: usize> Node<D> {
    fn distance(&self, x: &Vector<D>) -> f64 {
        (self.low - x).sup(&(x - self.high)).sup(&Vector::<D>::zeros()).norm()
    }

    fn overlaps(&self, low: &Vector<D>, high: &Vector<D>) -> bool {
        (0..D).all(|d| self.low[d] <= high[d] && low[d] <= self.high[d])
    }
}

impl<const D: usize> BoxTree<D> {
    /// A tree of items with the lower and upper corners of their boxes.
    pub fn new(boxes: &[(Vector<D>, Vector<D>)]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            let mut order = std::mem::take(&mut tree.order);
            tree.add(boxes, &mut order, 0);
            tree.order = order;
        }
        tree
    }

    /// Adds the node of the items `order`, which begin at `start` of all.
    fn add(&mut self, boxes: &[(Vector<D>, Vector<D>)], order: &mut [u32], start: u32) {
        let mut whole = boxes[order[0] as usize];
        for item in order.iter() {
            let (low, high) = &boxes[*item as usize];
            whole = (whole.0.inf(low), whole.1.sup(high));
        }
        let place = self.nodes.len();
        let end = start + order.len() as u32;
        self.nodes.push(Node { low: whole.0, high: whole.1, start, end, second: 0 });
        if order.len() <= LEAF {
            return;
        }
        let axis = (whole.1 - whole.0).imax();
        let middle = |item: u32| boxes[item as usize].0[axis] + boxes[item as usize].1[axis];
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |a, b| middle(*a).total_cmp(&middle(*b)).then(a.cmp(b)));
        let (first, rest) = order.split_at_mut(half);
        self.add(boxes, first, start);
        self.nodes[place].second = self.nodes.len() as u32;
        self.add(boxes, rest, start + half as u32);
    }

    /// Calls `visit` with items whose boxes may lie within `bound` of `x`, near ones first as a rule. `visit` returns the
    /// bound from then on.
    pub fn for_each_near(&self, x: &Vector<D>, mut bound: f64, mut visit: impl FnMut(usize) -> f64) {
        let mut stack = Vec::with_capacity(64);
        if let Some(root) = self.nodes.first() {
            stack.push((0_u32, root.distance(x)));
        }
        while let Some((place, distance)) = stack.pop() {
            if distance > bound {
                continue;
            }
            let node = &self.nodes[place as usize];
            if node.second == 0 {
                for item in &self.order[node.start as usize..node.end as usize] {
                    bound = visit(*item as usize);
                }
                continue;
            }
            let (first, second) = (place + 1, node.second);
            let distances = [first, second].map(|child| self.nodes[child as usize].distance(x));
            if distances[0] <= distances[1] {
                stack.extend([(second, distances[1]), (first, distances[0])]);
            } else {
                stack.extend([(first, distances[0]), (second, distances[1])]);
            }
        }
    }

    /// Calls `visit` with items in leaves that overlap a box.
    pub fn for_each_overlapping(&self, low: &Vector<D>, high: &Vector<D>, mut visit: impl FnMut(usize)) {
        let mut stack = Vec::with_capacity(64);
        if !self.nodes.is_empty() {
            stack.push(0_u32);
        }
        while let Some(place) = stack.pop() {
            let node = &self.nodes[place as usize];
            if !node.overlaps(low, high) {
                continue;
            }
            if node.second == 0 {
                self.order[node.start as usize..node.end as usize].iter().for_each(|item| visit(*item as usize));
            } else {
                stack.extend([node.second, place + 1]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{BoxTree, Vector};
    use crate::geometry::random::CounterRandom;

    #[test]
    fn the_nearest_of_many_boxes_is_found() {
        let random = CounterRandom::new(5);
        let place = |i: i64| Vector::<3>::from_fn(|d, _| random.symmetric(&[i, d as i64]));
        let points: Vec<_> = (0..500).map(place).collect();
        let boxes: Vec<_> = points.iter().map(|x| (*x, *x)).collect();
        let tree = BoxTree::new(&boxes);
        for i in 500..600 {
            let x = place(i);
            let mut best = f64::INFINITY;
            tree.for_each_near(&x, best, |item| {
                best = best.min((points[item] - x).norm());
                best
            });
            let expected = points.iter().map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min);
            assert_eq!(best.to_bits(), expected.to_bits());
            let mut inside = 0;
            let (low, high) = (x.add_scalar(-0.3), x.add_scalar(0.3));
            let is_in = |p: &Vector<3>| (0..3).all(|d| low[d] <= p[d] && p[d] <= high[d]);
            tree.for_each_overlapping(&low, &high, |item| inside += usize::from(is_in(&points[item])));
            assert_eq!(inside, points.iter().filter(|p| is_in(p)).count());
        }
    }
}
