//! Examination of the points of a surface before anything is computed on them.
//!
//! Coincident points, normals of length zero and coordinates whose squares overflow make a computation impossible
//! ([`Unusable`]). Holes, close sheets and normals that contradict the points make it less accurate ([`Flaw`]).

use super::normals::plane;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use std::cmp::Ordering;
use std::fmt;

/// Number of points whose distances give a first estimate of the spacing.
const SAMPLES: usize = 500;
/// Largest number of points in a cell of a few spacings. With more points, the cost of searches would grow with their
/// square.
const MOST_IN_CELL: usize = 4096;
/// Points coincide when their distance is below this fraction of the local spacing.
const SAME_POINT: f64 = 1e-3;
/// Radius of the neighborhood for normals and directions, in spacings: about twenty neighbors on a surface, four on a
/// curve.
const NEAR: f64 = 2.5;
/// Sine of the elevation over the tangent plane above which a neighbor belongs to another sheet.
///
/// On a sphere this is the elevation at which normals differ by 60°, beyond which operators do not use neighbors
/// either.
const ASIDE: f64 = 0.5;
/// Largest angle (rad) without a neighbor, for curves and for surfaces. A wider gap marks an edge. On a curve the gap
/// is 180° or 360°.
const WIDEST_GAP: [f64; 2] = [1.5 * std::f64::consts::PI, 2.0 * std::f64::consts::FRAC_PI_3];
/// Extents whose fourth powers, and those of their parts, neither overflow nor underflow.
pub(super) const EXTENTS: std::ops::Range<f64> = 1e-40..1e40;
/// Smallest ratio of the spacing to the largest coordinate that leaves enough digits for differences.
pub(super) const LEAST_SPACING: f64 = 1e-9;
/// Number of points that a message names.
const NAMED: usize = 5;

/// A set of points: the indices of the first few, and their number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointList {
    /// Indices of the first few points, ascending.
    pub first: Vec<usize>,
    /// Number of all points.
    pub count: usize,
    /// Indices of all points, ascending.
    pub all: Vec<usize>,
}

impl PointList {
    /// The points for which a condition holds; None if there are none.
    #[must_use]
    pub fn from_condition(points: usize, holds: impl Fn(usize) -> bool) -> Option<Self> {
        Self::from_indices((0..points).filter(|i| holds(*i)).collect())
    }

    /// The points with the given indices, in any order; None if there are none.
    pub(super) fn from_indices(mut found: Vec<usize>) -> Option<Self> {
        found.sort_unstable();
        let first = found.iter().take(NAMED).copied().collect();
        (!found.is_empty()).then_some(Self { first, count: found.len(), all: found })
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

/// Reasons why nothing can be computed on points.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// Too few points to determine a spacing.
    #[error("{count} points are too few for a surface: {least} at least")]
    TooFew {
        /// Number of points.
        count: usize,
        /// Smallest number that suffices.
        least: usize,
    },
    /// Points that coincide.
    #[error("{points}: each lies where another one does (points {} and {} are {distance:.3e} apart); leave one of them", pair[0], pair[1])]
    Duplicates {
        /// All points that coincide with another one.
        points: PointList,
        /// The first pair of coincident points.
        pair: [usize; 2],
        /// Distance of this pair.
        distance: f64,
    },
    /// A period that is short beside the distance of points.
    #[error(
        "the period {period:.4e} is short: supports reach up to {least:.4e}; more points, or a longer part of the surface, help"
    )]
    ShortPeriod {
        /// Length of the period.
        period: f64,
        /// The length that it must exceed.
        least: f64,
    },
    /// After a period the surface does not go on.
    #[error(
        "shifted by the period, no point comes closer than {closest:.3e} to another one, {spacing:.3e} apart: the surface does not go on there"
    )]
    NoRepetition {
        /// Least distance of a copy from a point.
        closest: f64,
        /// Largest local spacing.
        spacing: f64,
    },
    /// Points at a place with so many others that their local spacing is zero.
    #[error("{0}: so many others lie at the same place that there is no spacing; `clean`: \"drop\" keeps one of them")]
    Stacked(PointList),
    /// Points far from all others.
    #[error("{0}: far from all other points; leave them out")]
    Strays(PointList),
    /// Points of a surface that lie on a line.
    #[error(
        "{lines} of {count} points lie on a line with their neighbors: they are no surface; of a curve in the plane, give \"dimension\": 2"
    )]
    Line {
        /// Number of points.
        count: usize,
        /// Number of those whose neighbors lie on a line.
        lines: usize,
    },
    /// Normals of length zero or with undefined components.
    #[error("{0}: a normal without length")]
    ZeroNormals(PointList),
    /// Coordinates that a double cannot resolve.
    #[error(
        "{count} points {spacing:.3e} apart, over {extent:.3e}, at coordinates up to {largest:.3e}: these are not told apart well enough; scale or shift them"
    )]
    OutOfScale {
        /// Number of points.
        count: usize,
        /// Diagonal of the bounding box.
        extent: f64,
        /// Typical distance of neighbors; NaN where it was not computed.
        spacing: f64,
        /// Largest coordinate, in magnitude.
        largest: f64,
    },
    /// Some points are very far from the others, so that most points share a cell.
    #[error(
        "{count} points are about {spacing:.3e} apart while all spread over {extent:.3e}: point {farthest} at {at:?} is far from the others"
    )]
    Crowded {
        /// Number of points in the fullest cell.
        count: usize,
        /// Typical distance of neighbors.
        spacing: f64,
        /// Diagonal of the bounding box.
        extent: f64,
        /// Index of the point that is farthest from the median of the coordinates.
        farthest: usize,
        /// Position of that point.
        at: Vec<f64>,
    },
}

/// Reasons why a computation on points is less accurate.
#[derive(Debug, Clone, PartialEq)]
pub enum Flaw {
    /// Points at an edge, with neighbors on one side only.
    Holes(PointList),
    /// Points whose support contains points of another part of the surface.
    CloseSheets {
        /// These points.
        points: PointList,
        /// Radius of the support.
        radius: f64,
    },
    /// Points whose given normals oppose those of their neighbors, or are not orthogonal to the surface.
    InconsistentNormals(PointList),
}

impl Flaw {
    /// The points that it is about.
    #[must_use]
    pub fn points(&self) -> &PointList {
        match self {
            Self::Holes(points) | Self::InconsistentNormals(points) | Self::CloseSheets { points, .. } => points,
        }
    }

    /// Short name of the flaw, used as the code of a finding.
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

/// Origin of normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NormalSource {
    /// The normals were given with the points.
    Given,
    /// The normals were estimated from the points.
    Estimated,
}

/// Points that are distinct, with their spacing and neighbors.
///
/// ```
/// use meniscus::{geometry::fibonacci, point_clouds::Examined};
///
/// let points = fibonacci::sphere(1000);
/// let examined = Examined::new(&points).unwrap();
/// let mut normals = points.clone();
/// let given = meniscus::point_clouds::examination::NormalSource::Given;
/// assert!(examined.flaws(&mut normals, given, 0.3).is_empty());
/// ```
#[derive(Debug)]
pub struct Examined<'a, const D: usize> {
    points: &'a [Vector<D>],
    cells: CellList<D>,
    /// Median spacing: the length per point of a curve, or the square root of the area per point of a surface.
    pub spacing: f64,
    /// Spacing at each point.
    local: Vec<f64>,
}

impl<'a, const D: usize> Examined<'a, D> {
    /// Examines points.
    ///
    /// 1. Find equal points by sorting.
    /// 2. Estimate the spacing from some of the points.
    /// 3. Compute the spacing at each point from the number of its neighbors.
    /// 4. Find points that almost coincide.
    ///
    /// # Errors
    /// [`Unusable`] when nothing can be computed on the points.
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
        // Points that all coincide must be reported as equal points, not as points with a small extent.
        equal_points(points)?;
        if !EXTENTS.contains(&extent) {
            return Err(out_of_scale(f64::NAN));
        }
        let first = typical_distance(points, nearest, extent);
        if first <= LEAST_SPACING * largest {
            return Err(out_of_scale(first));
        }
        // The radius contains about fifty points of a surface. On a curve it is not a multiple of half the spacing,
        // which regular points need.
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

    /// Radius of the neighborhood from which a normal is estimated.
    #[must_use]
    pub fn radius_of_normals(&self) -> f64 {
        NEAR * self.spacing
    }

    /// Refuses points that almost coincide.
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

    /// Flaws of the points and their unit normals, for operators with supports of the given radius.
    ///
    /// Inconsistent normals are replaced by estimated ones that agree with most of their neighbors.
    pub fn flaws(&self, normals: &mut [Vector<D>], source: NormalSource, radius: f64) -> Vec<Flaw> {
        let at = |(i, _): (usize, &Vector<D>)| self.inspect(i, normals, source, radius);
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

    /// Inspects the neighborhood of point `i`.
    fn inspect(&self, i: usize, normals: &[Vector<D>], source: NormalSource, radius: f64) -> Seen<D> {
        let (x, n) = (&self.points[i], &normals[i]);
        let near = NEAR * self.local[i];
        let [first, second] = tangents(n);
        let (mut angles, mut facing) = (Vec::new(), Vector::<D>::zeros());
        let (mut opposing, mut has_sheet) = (0, false);
        self.cells.for_each_within(x, near.max(radius), |j, dx, square| {
            let turn = n.dot(&normals[j]);
            if dx.dot(n).abs() > ASIDE * square.sqrt() {
                // A parallel or opposite normal belongs to another sheet, an orthogonal one to the other side of a
                // bend.
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
        // A plane through two sheets says nothing about either, and a gap around a wrong normal says nothing about the
        // surface.
        let is_off = |across: &Vector<D>| !has_sheet && across.dot(n).abs() < 0.5;
        let instead = estimated.filter(|across| 2 * opposing > angles.len() || is_off(across));
        let is_at_edge = instead.is_none() && widest_gap(angles) > WIDEST_GAP[D - 2];
        Seen { is_at_edge, has_sheet, instead }
    }
}

/// Flaws at a point.
struct Seen<const D: usize> {
    is_at_edge: bool,
    has_sheet: bool,
    /// The estimated normal that replaces an inconsistent one.
    instead: Option<Vector<D>>,
}

/// Normalizes given normals.
///
/// # Errors
/// [`Unusable::ZeroNormals`] names normals of length zero and normals that are not finite.
pub fn unit_normals<const D: usize>(given: &[Vector<D>]) -> Result<Vec<Vector<D>>, Unusable> {
    // Dividing by the largest component first avoids overflow. `amax` ignores NaN, hence the separate test.
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

/// Median distance of some of the points to their `nearest`-th neighbor.
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

/// Median of numbers; 0 for an empty list.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// Index and position of the point that is farthest, in the maximum norm, from the median of the coordinates.
fn farthest<const D: usize>(points: &[Vector<D>]) -> (usize, Vec<f64>) {
    let middle = Vector::<D>::from_fn(|d, _| median(points.iter().map(|x| x[d]).collect()));
    let distance = |x: &Vector<D>| (x - middle).amax();
    let farthest = points.iter().enumerate().max_by(|a, b| distance(a.1).total_cmp(&distance(b.1)).then(b.0.cmp(&a.0)));
    farthest.map_or((0, Vec::new()), |(i, x)| (i, x.iter().copied().collect()))
}

/// Two unit vectors that are orthogonal to a unit normal and to each other. In the plane the second one is zero.
fn tangents<const D: usize>(n: &Vector<D>) -> [Vector<D>; 2] {
    let mut axis = Vector::<D>::zeros();
    axis[n.abs().imin()] = 1.0;
    let first = (axis - n * n.dot(&axis)).normalize();
    let part = |a: usize, b: usize| n[a] * first[b] - n[b] * first[a];
    let across = |d: usize| if D == 3 { part((d + 1) % D, (d + 2) % D) } else { 0.0 };
    [first, Vector::<D>::from_fn(|d, _| across(d))]
}

/// The widest gap (rad) between directions; the full circle without directions.
fn widest_gap(mut angles: Vec<f64>) -> f64 {
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return std::f64::consts::TAU };
    let round = std::f64::consts::TAU + first - last;
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(round, f64::max)
}

#[cfg(test)]
mod tests;
