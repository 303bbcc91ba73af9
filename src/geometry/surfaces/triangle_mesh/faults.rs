//! What keeps triangles from being a closed surface.

use super::Vector;
use crate::geometry::box_tree::BoxTree;
use crate::geometry::shown;
use std::collections::BTreeMap;

/// Faults of one kind that are named.
const MOST_NAMED: usize = 5;
/// Crossings that are counted at most.
const MOST_COUNTED: usize = 10_000;
/// Places within this distance of a triangle touch it, relative to the extent of the mesh.
const TOUCH: f64 = 1e-12;

/// A fault of a mesh. Points are named by their places, triangles by their numbers, from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshFault {
    /// There is nothing.
    #[error("there are no triangles; a mesh of a closed surface has at least 4")]
    Empty,
    /// An edge of one triangle alone.
    #[error("edge from {from} to {to} is open: it belongs to one triangle alone{more}; close the hole")]
    Open {
        /// One end.
        from: String,
        /// The other end.
        to: String,
        /// How many more there are.
        more: String,
    },
    /// An edge of more than two triangles.
    #[error("edge from {from} to {to} belongs to {count} triangles{more}; every edge of a closed surface has two")]
    Shared {
        /// One end.
        from: String,
        /// The other end.
        to: String,
        /// Number of its triangles.
        count: usize,
        /// How many more there are.
        more: String,
    },
    /// Two triangles that run along their edge in the same direction.
    #[error(
        "the triangles at the edge from {from} to {to} are turned against each other{more}; give all corners \
         counterclockwise as seen from outside"
    )]
    Turned {
        /// One end.
        from: String,
        /// The other end.
        to: String,
        /// How many more there are.
        more: String,
    },
    /// Two triangles that cross.
    #[error("triangles {first} and {second} cross near {place}{more}; a closed surface does not cross itself")]
    Crossing {
        /// The first triangle.
        first: usize,
        /// The second triangle.
        second: usize,
        /// Where.
        place: String,
        /// How many more there are.
        more: String,
    },
}

/// Names the first few of a list; the last one says how many more there are.
fn named<T>(found: &[T], name: impl Fn(&T, String) -> MeshFault) -> Vec<MeshFault> {
    let shown = &found[..found.len().min(MOST_NAMED)];
    let rest = found.len() - shown.len();
    let more = |k: usize| {
        if k + 1 == shown.len() && rest > 0 { format!(" (and {rest} more such places)") } else { String::new() }
    };
    shown.iter().enumerate().map(|(k, fault)| name(fault, more(k))).collect()
}

/// Refuses edges that do not belong to two triangles which run along them in opposite directions.
pub(super) fn check_edges(points: &[Vector<3>], triangles: &[[u32; 3]]) -> Result<(), Vec<MeshFault>> {
    if triangles.is_empty() {
        return Err(vec![MeshFault::Empty]);
    }
    let mut edges: BTreeMap<(u32, u32), [usize; 2]> = BTreeMap::new();
    for corners in triangles {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default()[usize::from(a > b)] += 1;
        }
    }
    let of_kind = |is_kind: fn([usize; 2]) -> bool| -> Vec<((u32, u32), [usize; 2])> {
        edges.iter().filter(|(_, uses)| is_kind(**uses)).map(|(edge, uses)| (*edge, *uses)).collect()
    };
    let ends = |edge: &(u32, u32)| (shown(&points[edge.0 as usize]), shown(&points[edge.1 as usize]));
    let mut faults = named(&of_kind(|[a, b]| a + b == 1), |(edge, _), more| {
        let (from, to) = ends(edge);
        MeshFault::Open { from, to, more }
    });
    faults.extend(named(&of_kind(|[a, b]| a + b > 2), |(edge, [a, b]), more| {
        let (from, to) = ends(edge);
        MeshFault::Shared { from, to, count: a + b, more }
    }));
    faults.extend(named(&of_kind(|[a, b]| a + b == 2 && a != b), |(edge, _), more| {
        let (from, to) = ends(edge);
        MeshFault::Turned { from, to, more }
    }));
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

/// Refuses triangles that cross others. Triangles that merely touch are let pass.
pub(super) fn check_crossings(
    points: &[Vector<3>],
    triangles: &[[u32; 3]],
    boxes: &[(Vector<3>, Vector<3>)],
    tree: &BoxTree<3>,
) -> Result<(), Vec<MeshFault>> {
    let low = points.iter().fold(points[0], |low, x| low.inf(x));
    let high = points.iter().fold(points[0], |high, x| high.sup(x));
    let touch = TOUCH * (high - low).max();
    let mut found = Vec::new();
    for (first, corners) in triangles.iter().enumerate() {
        tree.for_each_overlapping(&boxes[first].0, &boxes[first].1, |second| {
            let is_apart = |d: usize| boxes[first].0[d] > boxes[second].1[d] || boxes[second].0[d] > boxes[first].1[d];
            if second == first || found.len() >= MOST_COUNTED || (0..3).any(is_apart) {
                return;
            }
            // Each edge against the other triangle; the other way round comes with the other triangle's turn.
            let others = triangles[second];
            let corner = |k: u32| points[k as usize];
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                // Each edge belongs to two triangles: once is enough.
                if a < b && !others.contains(&a) && !others.contains(&b) {
                    let crossing = crossing([corner(a), corner(b)], others.map(corner), touch);
                    found.extend(crossing.map(|x| (first.min(second), first.max(second), x)));
                }
            }
        });
    }
    found.sort_by_key(|(first, second, _)| (*first, *second));
    found.dedup_by_key(|(first, second, _)| (*first, *second));
    let faults = named(&found, |(first, second, x), more| MeshFault::Crossing {
        first: *first,
        second: *second,
        place: shown(x),
        more,
    });
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

/// Where a straight piece passes through the inside of a triangle.
fn crossing([p, q]: [Vector<3>; 2], [a, b, c]: [Vector<3>; 3], touch: f64) -> Option<Vector<3>> {
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
    let (above, below) = (normal.dot(&(p - a)), normal.dot(&(q - a)));
    if above.abs() <= touch || below.abs() <= touch || (above > 0.0) == (below > 0.0) {
        return None;
    }
    let x = p + (q - p) * (above / (above - below));
    let is_inner = |from: Vector<3>, to: Vector<3>| {
        let along = to - from;
        normal.dot(&along.cross(&(x - from))) > touch * along.norm()
    };
    (is_inner(a, b) && is_inner(b, c) && is_inner(c, a)).then_some(x)
}
