//! What is wrong with the points of a surface, found before anything is computed on them.
//!
//! Points that lie on one another, normals without a length and coordinates whose squares are no numbers leave nothing
//! to compute ([`Unusable`]). Holes, parts of the surface that come too close and normals that contradict the points make
//! a computation worse, not impossible ([`Flaw`]).

use super::normals::plane;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use std::cmp::Ordering;
use std::fmt;

/// Points whose distances are taken for a first idea of the spacing.
const SAMPLES: usize = 500;
/// Points that a cell of a few spacings may hold: with more of them, searches would take the square of their number.
const MOST_IN_CELL: usize = 4096;
/// Points are one where they are closer than this share of the spacing there.
const SAME_POINT: f64 = 1e-3;
/// Neighbors for normals and directions, by the spacing: about twenty of a surface, four of a curve.
const NEAR: f64 = 2.5;
/// Sine of the elevation over the tangent plane above which a neighbor does not belong to the same sheet: on a sphere
/// that of normals which differ by 60°, beyond which operators do not take neighbors either.
const ASIDE: f64 = 0.5;
/// The largest angle without a neighbor inside a surface; on a curve (where it is 180° or 360°) inside it.
const WIDEST_GAP: [f64; 2] = [1.5 * std::f64::consts::PI, 2.0 * std::f64::consts::FRAC_PI_3];
/// Extents whose squares, and the squares of these, are numbers, parts included.
const EXTENTS: std::ops::Range<f64> = 1e-40..1e40;
/// The least spacing by the largest coordinate that leaves enough digits for differences.
const LEAST_SPACING: f64 = 1e-9;
/// Numbers of points that a message names.
const NAMED: usize = 5;

/// Points by their numbers: the first few, and how many there are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointList {
    /// The first few, rising.
    pub first: Vec<usize>,
    /// All.
    pub count: usize,
}

impl PointList {
    /// The points for which a condition holds, if there are any.
    fn from_condition(points: usize, holds: impl Fn(usize) -> bool) -> Option<Self> {
        let found: Vec<usize> = (0..points).filter(|i| holds(*i)).collect();
        let first = found.iter().take(NAMED).copied().collect();
        (!found.is_empty()).then_some(Self { first, count: found.len() })
    }
}

impl fmt::Display for PointList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.first.iter().map(ToString::to_string).collect();
        write!(f, "{} {}", if self.count == 1 { "point" } else { "points" }, numbers.join(", "))?;
        match self.count - self.first.len() {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

/// Why nothing can be computed on points.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// Fewer than tell a spacing.
    #[error("{count} points are too few for a surface: {least} at least")]
    TooFew {
        /// How many.
        count: usize,
        /// Least.
        least: usize,
    },
    /// Two points in one place.
    #[error("{points}: each lies where another one does (points {} and {} are {distance:.3e} apart); leave one of them", pair[0], pair[1])]
    Duplicates {
        /// All that have another one in their place.
        points: PointList,
        /// The first of them.
        pair: [usize; 2],
        /// How far these are apart.
        distance: f64,
    },
    /// Normals without a direction.
    #[error("{0}: a normal without length")]
    ZeroNormals(PointList),
    /// Coordinates beyond the digits of numbers.
    #[error(
        "{count} points {spacing:.3e} apart, over {extent:.3e}, at coordinates up to {largest:.3e}: these are not told apart well enough; scale or shift them"
    )]
    OutOfScale {
        /// How many.
        count: usize,
        /// The length of the diagonal of the box that they lie in.
        extent: f64,
        /// Between points; NaN where it was not looked for.
        spacing: f64,
        /// The largest coordinate.
        largest: f64,
    },
    /// Some points are very far from the others.
    #[error(
        "{count} points are about {spacing:.3e} apart while all spread over {extent:.3e}: point {farthest} at {at:?} is far from the others"
    )]
    Crowded {
        /// In the fullest cell.
        count: usize,
        /// Between most points.
        spacing: f64,
        /// The length of the diagonal of the box that all lie in.
        extent: f64,
        /// The point that is farthest from the middle one along the axes.
        farthest: usize,
        /// Where it is.
        at: Vec<f64>,
    },
}

/// What makes a computation on points worse.
#[derive(Debug, Clone, PartialEq)]
pub enum Flaw {
    /// Points at an edge: neighbors on one side alone.
    Holes(PointList),
    /// Points whose support reaches another part of the surface.
    CloseSheets {
        /// Which.
        points: PointList,
        /// Of the support.
        radius: f64,
    },
    /// Given normals that opposed those about them, or did not stand on the points about them.
    InconsistentNormals(PointList),
}

impl Flaw {
    /// A short name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Holes(_) => "holes",
            Self::CloseSheets { .. } => "close_sheets",
            Self::InconsistentNormals(_) => "inconsistent_normals",
        }
    }
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Holes(points) => {
                write!(f, "{points}: neighbors on one side alone, so the surface has a hole or an edge there")
            }
            Self::CloseSheets { points, radius } => {
                write!(f, "{points}: another part of the surface lies within the support of {radius:.4e}")
            }
            Self::InconsistentNormals(points) => {
                write!(
                    f,
                    "{points}: the normal opposes those of most neighbors, or does not stand on the surface; one that is estimated takes its place"
                )
            }
        }
    }
}

/// Where normals come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NormalSource {
    /// They came with the points.
    Given,
    /// From the points.
    Estimated,
}

/// Points that can be told apart, and who lies near them.
#[derive(Debug)]
pub struct Examined<'a, const D: usize> {
    points: &'a [Vector<D>],
    cells: CellList<D>,
    /// The length, or the root of the area, that a point has for itself, about: the median.
    pub spacing: f64,
    /// The same at each point.
    local: Vec<f64>,
}

impl<'a, const D: usize> Examined<'a, D> {
    /// 1. Equal points by sorting. 2. A first idea of the spacing from some points. 3. That of each by the number of its neighbors.
    ///    4. Points that are almost one.
    ///
    /// # Errors
    /// [`Unusable`].
    pub fn new(points: &'a [Vector<D>]) -> Result<Self, Unusable> {
        let nearest = if D == 2 { 4 } else { 12 };
        let count = points.len();
        if count <= nearest {
            return Err(Unusable::TooFew { count, least: nearest + 1 });
        }
        let (mut low, mut high) = (points[0], points[0]);
        for x in points {
            (low, high) = (low.inf(x), high.sup(x));
        }
        let largest = low.abs().sup(&high.abs()).max();
        let extent = (high - low).norm();
        let out_of_scale = |spacing: f64| Unusable::OutOfScale { count, extent, spacing, largest };
        // Points that are all in one place are equal points, not small ones.
        equal_points(points)?;
        if !EXTENTS.contains(&extent) {
            return Err(out_of_scale(f64::NAN));
        }
        let first = typical_distance(points, nearest, extent);
        if first <= LEAST_SPACING * largest {
            return Err(out_of_scale(first));
        }
        // Of a surface about fifty points lie within; of a curve a number of spacings and a half, as lattices want.
        let radius = if D == 2 { 2.25 } else { 2.0 } * first;
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), radius);
        let fullest = cells.starts().windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0);
        if fullest > MOST_IN_CELL {
            let (farthest, at) = farthest(points);
            return Err(Unusable::Crowded { count: fullest, spacing: first, extent, farthest, at });
        }
        let spacing_at = |x: &Vector<D>| {
            let mut number = 0;
            cells.for_each_within(x, radius, |_, _, _| number += 1);
            let number = f64::from(number);
            if D == 2 { 2.0 * radius / number } else { radius * (std::f64::consts::PI / number).sqrt() }
        };
        let local: Vec<f64> = points.par_iter().with_min_len(64).map(spacing_at).collect();
        let spacing = median(local.clone());
        let found = Self { points, cells, spacing, local };
        found.almost_equal_points()?;
        Ok(found)
    }

    /// A radius that holds the neighbors which tell a normal.
    #[must_use]
    pub fn radius_of_normals(&self) -> f64 {
        NEAR * self.spacing
    }

    fn almost_equal_points(&self) -> Result<(), Unusable> {
        let twin = |(i, x): (usize, &Vector<D>)| {
            let mut nearest = None;
            self.cells.for_each_within(x, SAME_POINT * self.local[i], |j, _, square| {
                if j != i && nearest.is_none_or(|(_, best)| square < best) {
                    nearest = Some((j, square));
                }
            });
            nearest
        };
        let twins: Vec<Option<(usize, f64)>> = self.points.par_iter().with_min_len(64).enumerate().map(twin).collect();
        let Some(points) = PointList::from_condition(twins.len(), |i| twins[i].is_some()) else { return Ok(()) };
        let i = points.first[0];
        let (j, square) = twins[i].unwrap_or((i, 0.0));
        Err(Unusable::Duplicates { points, pair: [i, j], distance: square.sqrt() })
    }

    /// What is wrong with the points and their unit normals for operators with supports of a radius. Inconsistent normals are
    /// replaced by estimated ones that face where most neighbors' do.
    pub fn flaws(&self, normals: &mut [Vector<D>], source: NormalSource, radius: f64) -> Vec<Flaw> {
        let at = |(i, _): (usize, &Vector<D>)| self.about(i, normals, source, radius);
        let seen: Vec<Seen<D>> = self.points.par_iter().with_min_len(64).enumerate().map(at).collect();
        for (normal, seen) in normals.iter_mut().zip(&seen) {
            *normal = seen.instead.unwrap_or(*normal);
        }
        let from_condition = |holds: fn(&Seen<D>) -> bool| PointList::from_condition(seen.len(), |i| holds(&seen[i]));
        let holes = from_condition(|seen| seen.is_at_edge).map(Flaw::Holes);
        let sheets = from_condition(|seen| seen.has_sheet).map(|points| Flaw::CloseSheets { points, radius });
        let inconsistent = from_condition(|seen| seen.instead.is_some()).map(Flaw::InconsistentNormals);
        [holes, sheets, inconsistent].into_iter().flatten().collect()
    }

    /// What can be seen from a point.
    fn about(&self, i: usize, normals: &[Vector<D>], source: NormalSource, radius: f64) -> Seen<D> {
        let (x, n) = (&self.points[i], &normals[i]);
        let near = NEAR * self.local[i];
        let [first, second] = tangents(n);
        let (mut angles, mut facing) = (Vec::new(), Vector::<D>::zeros());
        let (mut opposing, mut has_sheet) = (0, false);
        self.cells.for_each_within(x, near.max(radius), |j, dx, square| {
            let turn = n.dot(&normals[j]);
            if dx.dot(n).abs() > ASIDE * square.sqrt() {
                // Facing the same way it is a sheet too; across, it is the other side of a bend.
                has_sheet |= turn.abs() > 0.5 && square <= radius * radius;
            } else if j != i && square <= near * near {
                angles.push(dx.dot(&second).atan2(dx.dot(&first)));
                opposing += usize::from(turn < 0.0);
            }
            if j != i && square <= near * near {
                facing += normals[j];
            }
        });
        let across = || plane(&self.cells, i, x, near).map(|n| if n.dot(&facing) < 0.0 { -n } else { n }).ok();
        let estimated = if source == NormalSource::Given { across() } else { None };
        // The plane through two sheets tells nothing of either, a gap across a wrong normal nothing of the surface.
        let is_off = |across: &Vector<D>| !has_sheet && across.dot(n).abs() < 0.5;
        let instead = estimated.filter(|across| 2 * opposing > angles.len() || is_off(across));
        let is_at_edge = instead.is_none() && widest_gap(angles) > WIDEST_GAP[D - 2];
        Seen { is_at_edge, has_sheet, instead }
    }
}

/// What can be seen from a point.
struct Seen<const D: usize> {
    is_at_edge: bool,
    has_sheet: bool,
    /// The normal to be taken in the place of an inconsistent one.
    instead: Option<Vector<D>>,
}

/// Normals of length one.
///
/// # Errors
/// [`Unusable::ZeroNormals`]: some have none.
pub fn unit_normals<const D: usize>(given: &[Vector<D>]) -> Result<Vec<Vector<D>>, Unusable> {
    // By the largest component, whose square may be no number; NaN is not the largest.
    let has_length = |i: usize| given[i].iter().all(|c| c.is_finite()) && given[i].amax() >= f64::MIN_POSITIVE;
    match PointList::from_condition(given.len(), |i| !has_length(i)) {
        Some(points) => Err(Unusable::ZeroNormals(points)),
        None => Ok(given.iter().map(|n| (n / n.amax()).normalize()).collect()),
    }
}

/// Refuses points that are equal.
fn equal_points<const D: usize>(points: &[Vector<D>]) -> Result<(), Unusable> {
    let compare = |a: &Vector<D>, b: &Vector<D>| {
        (0..D).map(|d| a[d].total_cmp(&b[d])).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_unstable_by(|a, b| compare(&points[*a], &points[*b]).then(a.cmp(b)));
    let mut twin = vec![None; points.len()];
    for pair in order.windows(2).filter(|pair| points[pair[0]] == points[pair[1]]) {
        twin[pair[1]] = Some(pair[0]);
        twin[pair[0]].get_or_insert(pair[1]);
    }
    let Some(found) = PointList::from_condition(points.len(), |i| twin[i].is_some()) else { return Ok(()) };
    let i = found.first[0];
    Err(Unusable::Duplicates { points: found, pair: [i, twin[i].unwrap_or(i)], distance: 0.0 })
}

/// The median distance from some points to their `nearest`-th neighbor.
fn typical_distance<const D: usize>(points: &[Vector<D>], nearest: usize, extent: f64) -> f64 {
    let guess = extent * (nearest as f64 / points.len() as f64).powf(1.0 / (D as f64 - 1.0));
    let mut cells = CellList::new(Domain::unbounded());
    cells.rebuild(points.iter().copied(), guess);
    let distance = |x: &Vector<D>| {
        let mut found = Vec::new();
        let mut radius = guess;
        loop {
            cells.gather(x, radius, &mut found);
            if found.len() > nearest || radius > 2.0 * extent {
                break;
            }
            radius *= 2.0;
        }
        let mut squares: Vec<f64> = found.iter().map(|neighbor| neighbor.r2).collect();
        squares.sort_by(f64::total_cmp);
        squares.get(nearest).map_or(extent, |square| square.sqrt())
    };
    median(points.iter().step_by(points.len().div_ceil(SAMPLES)).map(distance).collect())
}

/// The middle one of numbers, 0 of none.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// The point that is farthest along the axes from the point in the middle of all along each.
fn farthest<const D: usize>(points: &[Vector<D>]) -> (usize, Vec<f64>) {
    let middle = Vector::<D>::from_fn(|d, _| median(points.iter().map(|x| x[d]).collect()));
    let away = |x: &Vector<D>| (x - middle).amax();
    let most = points.iter().enumerate().max_by(|a, b| away(a.1).total_cmp(&away(b.1)).then(b.0.cmp(&a.0)));
    most.map_or((0, Vec::new()), |(i, x)| (i, x.iter().copied().collect()))
}

/// Two unit vectors across a unit normal and each other; in the plane there is one, and the other is zero.
fn tangents<const D: usize>(n: &Vector<D>) -> [Vector<D>; 2] {
    let mut axis = Vector::<D>::zeros();
    axis[n.abs().imin()] = 1.0;
    let first = (axis - n * n.dot(&axis)).normalize();
    let part = |a: usize, b: usize| n[a] * first[b] - n[b] * first[a];
    let across = |d: usize| if D == 3 { part((d + 1) % D, (d + 2) % D) } else { 0.0 };
    [first, Vector::<D>::from_fn(|d, _| across(d))]
}

/// The widest angle without a direction; all of them where there is none.
fn widest_gap(mut angles: Vec<f64>) -> f64 {
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return std::f64::consts::TAU };
    let round = std::f64::consts::TAU + first - last;
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(round, f64::max)
}

#[cfg(test)]
mod tests;
