//! Consistent sides of normals on the graph of stars (König and Gumhold 2009).
//!
//! The normal of a neighbor is mirrored in the plane across the middle of the edge. On a circle the mirror image of the one
//! normal is the other. Sides are passed on along the tree of the edges where normal and mirror image differ least.
//!
//! Bodies that touch are one part of the graph, and the tree passes sides on through their contact, where normals mean nothing.
//! So every piece of trusted points is turned outward by itself.

use super::least_turn::Edge;
use super::rays::outward_share;
use super::star_graph::StarGraph;
use crate::geometry::Vector;
use crate::parallel::Interrupt;
use std::collections::BinaryHeap;

/// The product n_i · (n_j − 2 (n_j·e) e), where e is the direction of the edge: positive where both have the same side.
#[must_use]
pub fn agreement<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>], i: usize, j: usize) -> f64 {
    let d = points[j] - points[i];
    let square = d.norm_squared();
    let along = if square > 0.0 { 2.0 * normals[j].dot(&d) * normals[i].dot(&d) / square } else { 0.0 };
    normals[i].dot(&normals[j]) - along
}

/// Gives the normals of each part one side, outward where the part encloses a volume.
///
/// A part without an inside, such as a flat patch, has its normals upward on the whole, along the last axis.
pub fn orient<const D: usize>(points: &[Vector<D>], graph: &StarGraph, normals: &mut [Vector<D>]) {
    let mut is_done = vec![false; points.len()];
    let mut heap = BinaryHeap::new();
    for start in 0..points.len() {
        if is_done[start] {
            continue;
        }
        is_done[start] = true;
        let mut part = vec![start];
        let mut at = Some(start);
        while let Some(from) = at {
            for to in graph.neighbors(from) {
                if !is_done[*to as usize] {
                    let turn = 1.0 - agreement(points, normals, from, *to as usize).abs();
                    heap.push(Edge { turn, from: from as u32, to: *to });
                }
            }
            at = None;
            while let Some(Edge { from, to, .. }) = heap.pop() {
                let to = to as usize;
                if !is_done[to] {
                    if agreement(points, normals, from as usize, to) < 0.0 {
                        normals[to] = -normals[to];
                    }
                    is_done[to] = true;
                    part.push(to);
                    at = Some(to);
                    break;
                }
            }
        }
        if points_inward(points, graph, normals, &part) {
            part.iter().for_each(|i| normals[*i] = -normals[*i]);
        }
    }
}

/// Largest |Σ A n| by Σ A of a piece that closes on itself. On a closed surface the sum vanishes; a hole adds its area.
const CLOSED: f64 = 0.1;
/// Least points of such a piece.
const LEAST_PIECE: usize = 12;
/// Least agreement of the normals of neighbors in a piece.
const SMOOTH: f64 = 0.5;
/// Share of a part that is most of it: its sides are those that the part got as a whole.
const MOST: f64 = 0.9;

/// Turns oriented normals outward on every piece of trusted points, and those of other points to the side of their
/// neighbors there. Returns the number of pieces that close on themselves.
///
/// The outer side of a piece is found by rays that leave it along its normals ([`outward_share`]), which does not ask for a closed
/// piece: near a contact a coarse body has no trusted points. Where rays say nothing, a closed piece goes by its signed volume.
/// When `interrupt` is raised it ends early, and sides do not count.
pub fn orient_pieces<const D: usize>(
    points: &[Vector<D>],
    graph: &StarGraph,
    is_trusted: &[bool],
    normals: &mut [Vector<D>],
    interrupt: &Interrupt,
) -> usize {
    let mut is_turned = vec![false; points.len()];
    let mut is_placed = vec![false; points.len()];
    let mut closed = 0;
    let mut members = vec![Vec::new(); graph.part_count];
    (0..points.len()).for_each(|i| members[graph.parts[i] as usize].push(i));
    for piece in smooth_pieces(points, graph, is_trusted, normals) {
        if interrupt.is_raised() {
            return closed;
        }
        if piece.len() < LEAST_PIECE {
            continue;
        }
        piece.iter().for_each(|i| is_placed[*i] = true);
        let sum = piece.iter().fold(Vector::<D>::zeros(), |sum, i| sum + normals[*i] * graph.areas[*i]);
        let whole: f64 = piece.iter().map(|i| graph.areas[*i]).sum();
        let is_closed = sum.norm() <= CLOSED * whole;
        closed += usize::from(is_closed);
        let part = &members[graph.parts[piece[0]] as usize];
        let is_most = piece.len() as f64 > MOST * part.len() as f64;
        let share = if is_most { None } else { outward_share(points, normals, graph, (part, &piece)) };
        let turns = match share {
            Some(share) => share < 0.5,
            None => is_closed && points_inward(points, graph, normals, &piece),
        };
        if turns {
            piece.iter().for_each(|i| is_turned[*i] = true);
        }
    }
    normals.iter_mut().zip(&is_turned).filter(|(_, turned)| **turned).for_each(|(n, _)| *n = -*n);
    let mut is_touched = vec![false; graph.part_count];
    (0..points.len()).filter(|i| is_turned[*i]).for_each(|i| is_touched[graph.parts[i] as usize] = true);
    is_placed.iter_mut().zip(&graph.parts).for_each(|(placed, part)| *placed |= !is_touched[*part as usize]);
    go_along(points, graph, is_placed, normals);
    closed
}

/// Turns points that have no side yet to that of their neighbors that have one, layer by layer.
fn go_along<const D: usize>(
    points: &[Vector<D>],
    graph: &StarGraph,
    mut is_placed: Vec<bool>,
    normals: &mut [Vector<D>],
) {
    let open_beside = |places: &[usize], is_placed: &[bool]| {
        let near = places.iter().flat_map(|i| graph.neighbors(*i)).map(|j| *j as usize);
        let mut found: Vec<usize> = near.filter(|j| !is_placed[*j]).collect();
        found.sort_unstable();
        found.dedup();
        found
    };
    let placed: Vec<usize> = (0..points.len()).filter(|i| is_placed[*i]).collect();
    let mut frontier = open_beside(&placed, &is_placed);
    while !frontier.is_empty() {
        let agreed = |i: usize| {
            let near = graph.neighbors(i).iter().map(|j| *j as usize).filter(|j| is_placed[*j]);
            near.map(|j| agreement(points, normals, i, j)).sum::<f64>()
        };
        let sums: Vec<f64> = frontier.iter().map(|i| agreed(*i)).collect();
        for (i, sum) in frontier.iter().zip(sums) {
            is_placed[*i] = true;
            if sum < 0.0 {
                normals[*i] = -normals[*i];
            }
        }
        frontier = open_beside(&frontier, &is_placed);
    }
}

/// Pieces of trusted points that are joined by edges along which normals agree.
fn smooth_pieces<const D: usize>(
    points: &[Vector<D>],
    graph: &StarGraph,
    is_trusted: &[bool],
    normals: &[Vector<D>],
) -> Vec<Vec<usize>> {
    let mut is_done = vec![false; points.len()];
    let mut pieces = Vec::new();
    for start in (0..points.len()).filter(|i| is_trusted[*i]) {
        if is_done[start] {
            continue;
        }
        is_done[start] = true;
        let mut piece = vec![start];
        let mut place = 0;
        while let Some(from) = piece.get(place).copied() {
            place += 1;
            for to in graph.neighbors(from).iter().map(|j| *j as usize) {
                if is_trusted[to] && !is_done[to] && agreement(points, normals, from, to) > SMOOTH {
                    is_done[to] = true;
                    piece.push(to);
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}

/// Least |Σ A n·x| by Σ A |x| of a part that encloses a volume, x measured from its middle.
const LEAST_VOLUME: f64 = 1e-3;

fn points_inward<const D: usize>(
    points: &[Vector<D>],
    graph: &StarGraph,
    normals: &[Vector<D>],
    part: &[usize],
) -> bool {
    let whole: f64 = part.iter().map(|i| graph.areas[*i]).sum();
    let middle = part.iter().fold(Vector::<D>::zeros(), |sum, i| sum + points[*i] * (graph.areas[*i] / whole));
    let (mut volume, mut size, mut up) = (0.0, 0.0, 0.0);
    for i in part {
        let x = points[*i] - middle;
        volume += graph.areas[*i] * normals[*i].dot(&x);
        size += graph.areas[*i] * x.norm();
        up += graph.areas[*i] * normals[*i][D - 1];
    }
    if volume.abs() > LEAST_VOLUME * size { volume < 0.0 } else { up < 0.0 }
}

#[cfg(test)]
mod tests {
    use super::{go_along, orient, points_inward};
    use crate::geometry::{Vector, fibonacci};
    use crate::point_clouds::local_spacing::{Nearest, at_each_point, smoothed};
    use crate::point_clouds::star_graph::StarGraph;
    use crate::point_clouds::stars::Stars;

    fn graph(points: &[Vector<3>], normals: &[Vector<3>]) -> StarGraph {
        let nearest = Nearest::new(points, 30);
        let spacing = smoothed::<3>(&at_each_point(points, &nearest), &nearest);
        StarGraph::new(&Stars::new(points, &nearest, normals, &spacing))
    }

    /// Normals with random signs on two spheres, one inside the other.
    #[test]
    fn every_part_gets_its_outer_side() {
        let ball = fibonacci::sphere(500);
        let points: Vec<Vector<3>> = ball.iter().map(|x| x * 0.4).chain(ball.iter().copied()).collect();
        let exact: Vec<Vector<3>> = ball.iter().chain(&ball).copied().collect();
        let mut normals: Vec<Vector<3>> =
            exact.iter().enumerate().map(|(i, n)| if i * i % 7 < 3 { -n } else { *n }).collect();
        let graph = graph(&points, &exact);
        orient(&points, &graph, &mut normals);
        assert!(normals.iter().zip(&exact).all(|(n, e)| n.dot(e) > 0.99));
    }

    /// Two spheres that touch: one part, with each half outward but for the points at the contact.
    #[test]
    fn bodies_that_touch_are_turned_outward_each() {
        let ball = fibonacci::sphere(600);
        let center = Vector::<3>::x() * 2.0;
        let points: Vec<Vector<3>> = ball.iter().copied().chain(ball.iter().map(|x| x + center)).collect();
        let found =
            crate::point_clouds::PreparedCloud::new(&points, None, crate::point_clouds::cleaning::Cleaning::Drop);
        let found = found.unwrap();
        assert_eq!((found.graph.part_count, found.closed_pieces), (1, 2));
        let outward = |i: usize| if i < 600 { points[i] } else { points[i] - center };
        // Within half a radius of the contact the gap is below two spacings.
        let is_apart = |i: &usize| (found.points[*i] - Vector::<3>::x()).norm() > 0.5;
        assert!((0..1200).filter(is_apart).all(|i| found.normals[i].dot(&outward(i)) > 0.9));
    }

    /// Sides go along a row of points from its ends.
    #[test]
    fn points_without_a_side_take_that_of_their_neighbors() {
        let points: Vec<_> = (0..400).map(|k| Vector::<3>::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let graph = graph(&points, &vec![Vector::<3>::z(); 400]);
        let sign = |i: usize| if i * i % 7 < 3 && i > 0 { -1.0 } else { 1.0 };
        let mut normals: Vec<_> = (0..400).map(|i| Vector::<3>::z() * sign(i)).collect();
        go_along(&points, &graph, (0..400).map(|i| i == 0).collect(), &mut normals);
        assert!(normals.iter().all(|n| n[2] > 0.0));
    }

    #[test]
    fn a_patch_points_up() {
        let points: Vec<_> = (0..400).map(|k| Vector::<3>::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let mut normals = vec![-Vector::<3>::z(); 400];
        let graph = graph(&points, &normals);
        orient(&points, &graph, &mut normals);
        assert!(normals.iter().all(|n| n[2] > 0.0));
        assert!(!points_inward(&points, &graph, &normals, &(0..400).collect::<Vec<_>>()));
    }
}
