//! Edges in the order in which normals get their sides: those across which normals turn least come first.

use std::cmp::Ordering;

/// An edge to a point that has no side yet. A heap returns the edge that turns least; equal ones by their points.
pub(super) struct Edge {
    /// How far the normals are from being parallel, or mirrored; 0 where they are.
    pub turn: f64,
    /// Point that has a side.
    pub from: u32,
    /// Point that has none.
    pub to: u32,
}

impl Ord for Edge {
    fn cmp(&self, other: &Self) -> Ordering {
        other.turn.total_cmp(&self.turn).then_with(|| (other.to, other.from).cmp(&(self.to, self.from)))
    }
}

impl PartialOrd for Edge {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Edge {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Edge {}
