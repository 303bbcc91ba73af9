//! Normals that came with points, held against those of the points themselves.
//!
//! Only points that can be trusted are asked: their star is closed and their neighbors lie about in a plane. Normals that are
//! wrong together (axes exchanged, colors taken for normals) are wrong at many of them.

use super::examination::PointList;
use super::orientation::{agreement, orient};
use super::planes::Plane;
use super::star_graph::StarGraph;
use super::stars::Stars;
use crate::geometry::Vector;

/// Largest [`Plane::flatness`] of a trusted point.
const FLAT: f64 = 0.05;
/// |cos| of the angle to the normal of the star below which a given normal is wrong: 60°.
const WRONG: f64 = 0.5;
/// Least share of trusted points for a judgment.
const TRUSTED: f64 = 0.1;
/// Share of the trusted points with wrong normals above which all are wrong together. Measured: exact normals 0, noise of 10° 0,
/// meshes up to 0.074; axes exchanged 0.37, colors 0.49.
const TOGETHER: f64 = 0.25;
/// Share of edges between trusted points whose normals have different sides above which all sides are found anew.
const TURNED: f64 = 0.02;
/// Rounds in which a normal takes the side of most of its neighbors.
const ROUNDS: usize = 3;

/// What was found about given normals.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Share of the trusted points whose normal is wrong; NaN where too few points can be trusted.
    pub wrong_share: f64,
    /// Whether all given normals are wrong together, and estimated ones take their place.
    pub is_wrong_together: bool,
    /// Points whose normal was replaced or turned to the other side.
    pub replaced: Option<PointList>,
    /// Whether the sides of all normals were found anew.
    pub is_turned_anew: bool,
    is_trusted: Vec<bool>,
    is_wrong: Vec<bool>,
}

/// Whether each point can be trusted: its star is closed and its neighbors lie about in a plane.
pub(super) fn trusted<const D: usize>(stars: &Stars, planes: &[Plane<D>]) -> Vec<bool> {
    planes.iter().enumerate().map(|(i, plane)| stars.is_closed(i) && plane.flatness < FLAT).collect()
}

/// Holds given unit normals against estimated ones.
pub(super) fn judge<const D: usize>(
    given: &[Vector<D>],
    estimated: &[Vector<D>],
    planes: &[Plane<D>],
    stars: &Stars,
) -> Verdict {
    let count = given.len();
    let trusted_points = trusted(stars, planes);
    let is_off = |i: usize| given[i].dot(&estimated[i]).abs() < WRONG;
    let is_wrong: Vec<bool> = (0..count).map(|i| trusted_points[i] && is_off(i)).collect();
    let number = |list: &[bool]| list.iter().filter(|holds| **holds).count() as f64;
    let trusted = number(&trusted_points);
    let wrong_share = if trusted >= TRUSTED * count as f64 { number(&is_wrong) / trusted } else { f64::NAN };
    Verdict {
        wrong_share,
        is_wrong_together: wrong_share > TOGETHER,
        replaced: None,
        is_turned_anew: false,
        is_trusted: trusted_points,
        is_wrong,
    }
}

impl Verdict {
    /// Whether too few points can be trusted to hold the given normals against.
    #[must_use]
    pub fn is_unchecked(&self) -> bool {
        self.wrong_share.is_nan()
    }

    /// The given normals with wrong ones replaced; None where they are wrong together.
    pub(super) fn corrected<const D: usize>(
        &self,
        given: &[Vector<D>],
        estimated: &[Vector<D>],
    ) -> Option<Vec<Vector<D>>> {
        let of = |i: usize| if self.is_wrong[i] { estimated[i] } else { given[i] };
        (!self.is_wrong_together).then(|| (0..given.len()).map(of).collect())
    }

    /// Turns single normals to the side of their neighbors, or finds all sides anew where many edges join different sides.
    pub(super) fn agree<const D: usize>(&mut self, points: &[Vector<D>], graph: &StarGraph, normals: &mut [Vector<D>]) {
        let before = normals.to_vec();
        let differs = |normals: &[Vector<D>], i: usize, j: &u32| agreement(points, normals, i, *j as usize) < 0.0;
        for _ in 0..ROUNDS {
            let is_outvoted = |i: usize| {
                let near = graph.neighbors(i);
                let others = near.iter().filter(|j| differs(normals, i, j)).count();
                2 * others > near.len()
            };
            let outvoted: Vec<usize> = (0..points.len()).filter(|i| is_outvoted(*i)).collect();
            // Two neighbors that outvote each other must not both turn.
            let turn = |i: &&usize| {
                let rivals = graph.neighbors(**i).iter().filter(|j| outvoted.binary_search(&(**j as usize)).is_ok());
                rivals.filter(|j| (**j as usize) < **i).all(|j| !differs(normals, **i, j))
            };
            let turned: Vec<usize> = outvoted.iter().filter(turn).copied().collect();
            turned.iter().for_each(|i| normals[*i] = -normals[*i]);
            if turned.is_empty() {
                break;
            }
        }
        let trusted = (0..points.len()).filter(|i| self.is_trusted[*i]);
        let edges = trusted.flat_map(|i| graph.neighbors(i).iter().map(move |j| (i, j)));
        let (mut number, mut turned) = (0_usize, 0_usize);
        for (i, j) in edges.filter(|(_, j)| self.is_trusted[**j as usize]) {
            number += 1;
            turned += usize::from(differs(normals, i, j));
        }
        if turned as f64 > TURNED * number as f64 {
            self.is_turned_anew = true;
            orient(points, graph, normals);
        }
        let is_changed = |i: usize| self.is_wrong[i] || (!self.is_turned_anew && normals[i] != before[i]);
        self.replaced = PointList::from_condition(points.len(), is_changed);
    }
}
