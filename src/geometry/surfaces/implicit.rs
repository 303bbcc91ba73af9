//! Surfaces where a level function is zero: any level, not a distance alone, in one or several closed pieces.
//!
//! The zero set is sampled once within a box. Closest points come from the samples by Newton's method and are exact to
//! round-off where the level is smooth. At kinks of the level, such as those of `max` and `abs`, a closest point is found by
//! steps downhill and has no normal.

use super::sampled::newton::{descend, project};
use super::sampled::trace::{bulges, polygon_area, trace};
use super::sampled::volume::curved_volume;
use super::sampled::{
    BULGE, Found, LEAST_BULGE, LocalFoot, Patch, PatchSet, local_foot, medial_distance, radius_in_ball,
};
use super::{Surface, SurfacePoint, Vector};
use crate::geometry::block::indices;
use crate::geometry::level::{LevelFunction, LevelJet};
use crate::geometry::shown;
use std::sync::{Arc, OnceLock};

/// Tuning constants of the sampling, for the plane and for space.
struct SamplingTuning {
    /// Cells along each axis of the box in which the zero is looked for.
    search_cells: [usize; 2],
    /// Cells along the longest side of the zero's own box, before they are halved.
    first_cells: [usize; 2],
    /// Halvings of all cells that may hold a part of the zero.
    halvings: [u32; 2],
    /// Halvings beyond, where the zero turns within a cell.
    more_halvings: [u32; 2],
    /// Largest turn of the zero within half the diagonal of a cell, in rad.
    turn: f64,
    /// Spacing of the points by which an area is found, relative to the extent.
    area_spacing: f64,
}

const TUNING: SamplingTuning = SamplingTuning {
    search_cells: [128, 48],
    first_cells: [48, 16],
    halvings: [2, 2],
    more_halvings: [6, 3],
    turn: 0.25,
    area_spacing: 1e-3,
};

/// Why a level function has no surface in a box.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ImplicitError {
    /// A value that is no number.
    #[error("the level is not finite at {place}; give low and high of a box where it is a number everywhere")]
    NotFinite {
        /// The place, as it is shown.
        place: String,
    },
    /// All values have one sign.
    #[error(
        "the level has no zero in the box: it lies between {least:.3e} and {most:.3e} there; give low and high about the \
         shape, or a level that is negative inside and positive outside"
    )]
    NoZero {
        /// Least value found.
        least: f64,
        /// Largest value found.
        most: f64,
    },
    /// The zero is cut off by the box.
    #[error(
        "the zero of the level reaches the side of the box near {place}; give low and high that contain the whole shape"
    )]
    ReachesSide {
        /// The place, as it is shown.
        place: String,
    },
    /// The level touches zero instead of crossing it with a slope.
    #[error(
        "the level crosses its zero without a slope near {place}, as a cube does; give a level whose gradient is not 0 there"
    )]
    NoSlope {
        /// The place, as it is shown.
        place: String,
    },
}

/// The closed surface where a level function is zero, within a box.
pub struct ImplicitSurface<const D: usize> {
    level: Arc<dyn LevelFunction<D>>,
    low: Vector<D>,
    high: Vector<D>,
    /// The level's sign on the sides of the box, and beyond.
    outer_sign: f64,
    patches: PatchSet<D>,
    area_or_volume: OnceLock<f64>,
}

impl<const D: usize> ImplicitSurface<D> {
    /// The zero of a level in the box from `low` to `high`. Parts of it that are smaller than a cell of the search, 1/128 of
    /// the box in the plane and 1/48 in space, may be missed.
    ///
    /// # Errors
    /// [`ImplicitError`]: no zero, a zero that reaches the sides, values that are not finite, or a zero without a slope.
    pub fn new(level: Arc<dyn LevelFunction<D>>, low: Vector<D>, high: Vector<D>) -> Result<Self, ImplicitError> {
        let search = search(level.as_ref(), &low, &high)?;
        let mut sampler = Sampler { level: level.as_ref(), patches: Vec::new(), crossed: 0, missed: 0, no_slope: None };
        let sides = search.high - search.low;
        let edge = sides.max() / TUNING.first_cells[D - 2] as f64;
        let counts: [usize; D] = std::array::from_fn(|d| ((sides[d] / edge).ceil() as usize).max(1));
        for k in 0..counts.iter().product::<usize>() {
            let cell = indices(k, &counts);
            let center = Vector::<D>::from_fn(|d, _| search.low[d] + (cell[d] as f64 + 0.5) * edge);
            sampler.add(&center, 0.5 * edge, 0);
        }
        // A kink may hide the zero of a cell; a zero without a slope hides it everywhere.
        if let Some(place) = sampler.no_slope.filter(|_| sampler.missed > sampler.crossed / 4) {
            return Err(ImplicitError::NoSlope { place: shown(&place) });
        }
        let patches = PatchSet::new(sampler.patches);
        Ok(Self { level, low, high, outer_sign: search.outer_sign, patches, area_or_volume: OnceLock::new() })
    }

    /// The level function.
    #[must_use]
    pub fn level(&self) -> &Arc<dyn LevelFunction<D>> {
        &self.level
    }

    fn is_in_box(&self, x: &Vector<D>) -> bool {
        (0..D).all(|d| self.low[d] <= x[d] && x[d] <= self.high[d])
    }

    /// The level's sign, that on the sides outside the box.
    fn sign(&self, x: &Vector<D>) -> f64 {
        if self.is_in_box(x) { self.level.value(x).signum() } else { self.outer_sign }
    }

    /// The closest point, and other local ones at most `margin` farther away that are not at kinks.
    fn feet(&self, x: &Vector<D>, margin: f64) -> Vec<Found<D>> {
        // Steps downhill are slow: they are taken where a kink may hold the closest point.
        let downhill = |patch: &Patch<D>| descend(self.level.as_ref(), x, &patch.seed, patch.radius);
        let solve = |patch: &Patch<D>, may_be_closest: bool| -> Option<LocalFoot<D>> {
            local_foot(&[self.level.as_ref()], x, &patch.seed, 2.0 * patch.radius)
                .or_else(|| may_be_closest.then(|| downhill(patch)))
                .filter(|foot| self.is_in_box(&foot.point))
        };
        self.patches.feet(x, margin, solve)
    }

    /// The outline; None where a curve of it does not close.
    fn curves(&self, spacing: f64) -> Option<Vec<Vec<Vector<D>>>> {
        let seeds: Vec<Vector<D>> = self.patches.patches().iter().map(|patch| patch.seed).collect();
        let longest = self.patches.patches().iter().map(|patch| patch.radius).fold(f64::INFINITY, f64::min);
        trace(self.level.as_ref(), &seeds, spacing, longest)
    }

    fn extent(&self) -> f64 {
        let (low, high) = self.bounding_box();
        (high - low).max()
    }
}

impl<const D: usize> Surface<D> for ImplicitSurface<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let feet = self.feet(x, 0.0);
        let Some(found) = feet.first() else {
            return SurfacePoint { distance: f64::NAN, point: *x, normal: None, curvature: None };
        };
        let jet = self.level.jet(&found.foot.point);
        let is_smooth = found.foot.is_smooth && jet.gradient.iter().all(|g| g.is_finite());
        SurfacePoint {
            distance: found.distance.copysign(self.sign(x)),
            point: found.foot.point,
            normal: is_smooth.then(|| jet.normal()),
            curvature: is_smooth.then(|| jet.curvature()),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        let (low, high) = self.patches.extent();
        // Between seeds the surface reaches a little farther.
        let beyond = self.patches.patches().iter().map(|patch| patch.bulge).fold(0.0, f64::max);
        (low.add_scalar(-beyond), high.add_scalar(beyond))
    }

    fn area_or_volume(&self) -> f64 {
        *self.area_or_volume.get_or_init(|| {
            if D == 2 {
                let Some(chains) = self.curves(TUNING.area_spacing * self.extent()) else { return f64::NAN };
                let curved = |chain: &Vec<Vector<D>>| bulges(chain, |x| Some(self.level.jet(x).normal()));
                (polygon_area(&chains) + chains.iter().map(curved).sum::<f64>()).abs()
            } else {
                let (low, high) = self.bounding_box();
                curved_volume(self.level.as_ref(), &low, &high).abs()
            }
        })
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        medial_distance(x, &self.feet(x, 2.0 * tolerance)) <= tolerance
    }

    /// Empty where a curve of it does not close, as at a cusp: a part of an outline would pass for the whole.
    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        self.curves(spacing).unwrap_or_default()
    }

    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.feet(x, 0.0).first().map_or(f64::NAN, |found| found.distance.copysign(self.sign(x)))
    }
}

/// Where the zero lies.
struct Search<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
    outer_sign: f64,
}

/// Looks for the zero on the nodes of a lattice over the whole box.
fn search<const D: usize>(
    level: &dyn LevelFunction<D>,
    low: &Vector<D>,
    high: &Vector<D>,
) -> Result<Search<D>, ImplicitError> {
    let cells = TUNING.search_cells[D - 2];
    let nodes = cells + 1;
    let index = |k: usize, d: usize| k / nodes.pow(d as u32) % nodes;
    let place =
        |k: usize| Vector::<D>::from_fn(|d, _| low[d] + (high[d] - low[d]) * (index(k, d) as f64 / cells as f64));
    let points: Vec<Vector<D>> = (0..nodes.pow(D as u32)).map(place).collect();
    let mut values = vec![0.0; points.len()];
    level.values(&points, &mut values);
    if let Some(k) = values.iter().position(|value| !value.is_finite()) {
        return Err(ImplicitError::NotFinite { place: shown(&points[k]) });
    }
    let is_side = |k: usize| (0..D).any(|d| index(k, d) == 0 || index(k, d) == cells);
    let outer_sign = values[0].signum();
    if let Some(k) = (0..values.len()).find(|k| is_side(*k) && values[*k] * outer_sign <= 0.0) {
        return Err(ImplicitError::ReachesSide { place: shown(&points[k]) });
    }
    let mut found: Option<(Vector<D>, Vector<D>)> = None;
    let strides: [usize; D] = std::array::from_fn(|d| nodes.pow(d as u32));
    for k in (0..values.len()).filter(|k| (0..D).all(|d| index(*k, d) < cells)) {
        if may_cross(&values, k, &strides) {
            let opposite = points[k + strides.iter().sum::<usize>()];
            let whole = found.unwrap_or((points[k], opposite));
            found = Some((whole.0.inf(&points[k]), whole.1.sup(&opposite)));
        }
    }
    let Some((first, last)) = found else {
        let [least, most] = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        return Err(ImplicitError::NoZero { least, most });
    };
    let margin = (high - low) / cells as f64;
    Ok(Search { low: (first - margin).sup(low), high: (last + margin).inf(high), outer_sign })
}

/// Whether the level may be zero in a cell, by its values at the corners: it changes its sign there, or it comes as near to
/// zero as its slope allows.
fn may_cross<const D: usize>(values: &[f64], first: usize, strides: &[usize; D]) -> bool {
    let corners = 1_usize << D;
    let corner = |c: usize| values[first + (0..D).map(|d| (c >> d & 1) * strides[d]).sum::<usize>()];
    let [least, most] =
        (0..corners).map(corner).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
    least <= 0.0 && most >= 0.0 || least.abs().min(most.abs()) < most - least
}

/// Collects patches from cells.
struct Sampler<'a, const D: usize> {
    level: &'a dyn LevelFunction<D>,
    patches: Vec<Patch<D>>,
    /// Cells on whose corners the level changes its sign.
    crossed: usize,
    /// Those of them in which no point of the zero was found.
    missed: usize,
    /// A place of one of those.
    no_slope: Option<Vector<D>>,
}

impl<const D: usize> Sampler<'_, D> {
    /// Adds the patches of a cube, halving it where the zero needs that.
    fn add(&mut self, center: &Vector<D>, half: f64, depth: u32) {
        let reach = half * (D as f64).sqrt();
        let jet = self.jet(center, half);
        let is_crossed = self.changes_sign(center, half);
        // The Taylor polynomial of degree 2 bounds the change of the level within the cell.
        let change = jet.gradient.norm() * reach + 0.5 * jet.hessian.norm() * reach * reach;
        if !is_crossed && jet.value.abs() > change {
            return;
        }
        let halvings = TUNING.halvings[D - 2];
        let seed = if depth < halvings { None } else { self.seed(center, reach) };
        let is_last = depth >= halvings + TUNING.more_halvings[D - 2];
        let is_turning = |jet: &LevelJet<D>| jet.sharpest_curvature() * reach > TUNING.turn;
        let needs_halving = match &seed {
            None => depth < halvings || is_crossed,
            Some((_, jet)) => is_turning(jet),
        };
        if needs_halving && !is_last {
            let quarter = 0.5 * half;
            for corner in 0..1_usize << D {
                let offset = |d: usize| if corner >> d & 1 == 1 { quarter } else { -quarter };
                self.add(&Vector::<D>::from_fn(|d, _| center[d] + offset(d)), quarter, depth + 1);
            }
            return;
        }
        self.crossed += usize::from(is_crossed);
        match seed {
            Some((seed, jet)) => {
                let turn = jet.sharpest_curvature() * reach;
                let radius = radius_in_ball(reach, (seed - center).norm(), turn);
                self.patches.push(patch(seed, &jet, radius));
            }
            None if is_crossed => {
                self.missed += 1;
                self.no_slope = Some(*center);
            }
            None => {}
        }
    }

    /// The jet at a place, or next to it where the level has no derivatives there.
    fn jet(&self, x: &Vector<D>, half: f64) -> LevelJet<D> {
        let is_finite = |jet: &LevelJet<D>| jet.gradient.iter().chain(jet.hessian.iter()).all(|v| v.is_finite());
        let jet = self.level.jet(x);
        if is_finite(&jet) {
            return jet;
        }
        self.level.jet(&Vector::<D>::from_fn(|d, _| x[d] + half * (0.1 + 0.07 * d as f64)))
    }

    fn changes_sign(&self, center: &Vector<D>, half: f64) -> bool {
        let corner = |c: usize| {
            let x = Vector::<D>::from_fn(|d, _| center[d] + if c >> d & 1 == 1 { half } else { -half });
            self.level.value(&x) > 0.0
        };
        let first = corner(0);
        (1..1_usize << D).any(|c| corner(c) != first)
    }

    /// The point of the zero closest to a cell's center, if it lies within `reach`.
    fn seed(&self, center: &Vector<D>, reach: f64) -> Option<(Vector<D>, LevelJet<D>)> {
        let foot = local_foot(&[self.level], center, center, reach).map(|foot| foot.point);
        let point = foot.or_else(|| project(self.level, center, reach))?;
        let jet = self.level.jet(&point);
        let is_regular = jet.gradient.norm() > 0.0 && jet.hessian.iter().all(|v| v.is_finite());
        ((point - center).norm() <= reach * 1.001 && is_regular).then_some((point, jet))
    }
}

/// The patch about a seed on the zero of one level.
fn patch<const D: usize>(seed: Vector<D>, jet: &LevelJet<D>, radius: f64) -> Patch<D> {
    let normal = jet.normal();
    // A curve leaves its tangent by κr²/2; half as much again for curvature that grows.
    let bulge = (BULGE * jet.sharpest_curvature() * radius * radius).min(radius) + LEAST_BULGE * radius;
    Patch {
        seed,
        is_on_surface: true,
        faces: [0; D],
        count: 1,
        radius,
        bulge,
        normal,
        across: normal * normal.transpose(),
    }
}
