//! Area or volume inside the surface with its center and second moments, by quadrature on the fitted polynomials.
//!
//! A coarse grid covers the samples. Cells away from the surface count completely or not at all. Cells that the surface
//! cuts are halved along every axis. The smallest cells count the share below the tangent plane at the foot point of
//! their center, corrected by the mean curvature of the surface over the cell.

use super::level_surface::LevelSurface;
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use nalgebra::SMatrix;
use rayon::prelude::{IntoParallelIterator, ParallelIterator};

/// Number of times that a cut cell is halved.
///
/// In 2D, 2⁴ parts leave an error below (h/16)² per length of the cut. In 3D there are fewer, since the number of cut
/// cells grows with the square.
const fn halvings(dimension: usize) -> u32 {
    if dimension == 2 { 4 } else { 1 }
}

/// Number of cells along the longest side of the bounding box of the samples, before any cell is halved.
const COARSE_CELLS: f64 = 16.0;

/// Moments of the enclosed area or volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnclosedMoments<const D: usize> {
    /// Enclosed area (2D) or volume (3D).
    pub area_or_volume: f64,
    /// Length (2D) or area (3D) of the surface.
    pub surface: f64,
    /// First moments ∫ x dV.
    pub first: Vector<D>,
    /// Second moments ∫ x_d² dV, axis by axis.
    pub second: Vector<D>,
    /// Mixed second moments ∫ x_d x_e dV with the axis e after d, for d = x, y, z; in the plane the first is ∫ x y dV.
    pub mixed: Vector<D>,
    /// Lower corner of the bounding box of the samples.
    pub low: Vector<D>,
    /// Upper corner of the bounding box of the samples.
    pub high: Vector<D>,
}

impl<const D: usize> EnclosedMoments<D> {
    /// The moments of an empty set.
    fn zero() -> Self {
        let zero = Vector::<D>::zeros();
        Self { area_or_volume: 0.0, surface: 0.0, first: zero, second: zero, mixed: zero, low: zero, high: zero }
    }

    /// Adds the moments of another set.
    fn add(&mut self, other: &Self) {
        self.area_or_volume += other.area_or_volume;
        self.surface += other.surface;
        self.first += other.first;
        self.second += other.second;
        self.mixed += other.mixed;
    }

    /// Center of area or volume.
    #[must_use]
    pub fn center(&self) -> Vector<D> {
        self.first / self.area_or_volume
    }

    /// Central second moments divided by the area or volume, axis by axis.
    #[must_use]
    pub fn variance(&self) -> Vector<D> {
        let center = self.center();
        self.second / self.area_or_volume - center.component_mul(&center)
    }

    /// The tensor of central second moments divided by the area or volume.
    #[must_use]
    pub fn covariance(&self) -> SMatrix<f64, D, D> {
        let (center, variance) = (self.center(), self.variance());
        SMatrix::<f64, D, D>::from_fn(|d, e| {
            if d == e {
                return variance[d];
            }
            // The pair (d, e) stands at the axis from which e is the next.
            let at = if (d + 1) % D == e { d } else { e };
            self.mixed[at] / self.area_or_volume - center[d] * center[e]
        })
    }
}

/// Area or volume of the set with negative level, for a bounded surface in an unbounded domain.
///
/// It is zero without samples. The sum runs over cells in a fixed order.
///
/// # Errors
/// [`Interrupted`] when the interrupt is raised.
pub fn enclosed_area_or_volume<const D: usize>(
    surface: &LevelSurface<D>,
    interrupt: &Interrupt,
) -> Result<f64, Interrupted> {
    enclosed_moments(surface, |x| *x, &Space::whole(), interrupt).map(|moments| moments.area_or_volume)
}

/// A box outside of which nothing counts; infinite where it is open.
#[derive(Debug, Clone, Copy)]
pub struct Bounds<const D: usize> {
    /// Lower corner.
    pub low: Vector<D>,
    /// Upper corner.
    pub high: Vector<D>,
}

impl<const D: usize> Bounds<D> {
    /// No bounds.
    #[must_use]
    pub fn none() -> Self {
        Self { low: Vector::<D>::repeat(f64::NEG_INFINITY), high: Vector::<D>::repeat(f64::INFINITY) }
    }
}

/// The signed distance of a place from the nearest body, negative within, and the direction towards it.
pub type FromBodies<'a, const D: usize> = &'a (dyn Fn(&Vector<D>) -> (f64, Vector<D>) + Sync);

/// The space in which an interface counts.
#[derive(Clone, Copy)]
pub struct Space<'a, const D: usize> {
    /// A box around it.
    pub bounds: Bounds<D>,
    /// A box around the inside, where it may reach farther than its surface, as a pool does.
    pub inside: Option<Bounds<D>>,
    /// Bodies within, where nothing counts.
    pub bodies: Option<FromBodies<'a, D>>,
}

impl<const D: usize> Space<'_, D> {
    /// Everything.
    #[must_use]
    pub fn whole() -> Self {
        Self { bounds: Bounds::none(), inside: None, bodies: None }
    }

    /// The share of a cell that is not within bodies; None where they cut it and it is to be halved.
    fn share_of_cell(&self, center: &Vector<D>, edges: &Vector<D>, is_smallest: bool) -> Option<f64> {
        let Some(bodies) = self.bodies else { return Some(1.0) };
        let (distance, direction) = bodies(center);
        if distance.abs() >= 0.5 * edges.norm() {
            return Some(if distance > 0.0 { 1.0 } else { 0.0 });
        }
        let edge = edges.max();
        is_smallest.then(|| share_below_plane(&(direction.component_mul(edges) / edge), -distance / edge))
    }
}

/// Moments of the set with negative level.
///
/// In a periodic domain, `unwrap` must move the points of the surface to connected images. Only what lies within `space`
/// counts.
///
/// # Errors
/// [`Interrupted`] when the interrupt is raised.
pub fn enclosed_moments<const D: usize>(
    surface: &LevelSurface<D>,
    unwrap: impl Fn(&Vector<D>) -> Vector<D>,
    space: &Space<'_, D>,
    interrupt: &Interrupt,
) -> Result<EnclosedMoments<D>, Interrupted> {
    let bounds = &space.bounds;
    if surface.is_lost() {
        return Ok(EnclosedMoments::zero());
    }
    let spacing = surface.spacing();
    let extent = extent_of(surface, unwrap);
    let (mut low, mut high) = extent;
    if let Some(inside) = &space.inside {
        low = low.inf(&inside.low);
        high = high.sup(&inside.high);
    }
    // A coarse cell that the surface does not cut costs a single query.
    let coarsening = ((high - low).max() / (COARSE_CELLS * spacing)).log2().ceil().max(0.0);
    let edge = spacing * coarsening.exp2();
    let halvings = halvings(D) + coarsening as u32;
    // Cells that bounds cut would have other edges: the grid begins at a lower bound and fits between two.
    let low = low.add_scalar(-2.0 * spacing).sup(&bounds.low);
    let high = high.add_scalar(2.0 * spacing).inf(&bounds.high);
    let counts: [usize; D] = std::array::from_fn(|d| ((high[d] - low[d]) / edge).ceil().max(1.0) as usize);
    let edges =
        Vector::<D>::from_fn(
            |d, _| {
                if high[d] == bounds.high[d] { (high[d] - low[d]) / counts[d] as f64 } else { edge }
            },
        );
    let rows: usize = counts[1..].iter().product();
    let sums: Vec<EnclosedMoments<D>> = (0..rows)
        .into_par_iter()
        .map(|row| {
            let mut corner = low;
            let mut rest = row;
            for d in 1..D {
                corner[d] += (rest % counts[d]) as f64 * edges[d];
                rest /= counts[d];
            }
            let mut sum = EnclosedMoments::zero();
            for k in 0..counts[0] {
                corner[0] = low[0] + k as f64 * edges[0];
                if !interrupt.is_raised() {
                    inside_of_cell((surface, space), &corner, &edges, halvings, &mut sum);
                }
            }
            sum
        })
        .collect();
    interrupt.check()?;
    let mut moments = EnclosedMoments::zero();
    for sum in &sums {
        moments.add(sum);
    }
    (moments.low, moments.high) = extent;
    Ok(moments)
}

/// The corners of a box around the samples.
fn extent_of<const D: usize>(
    surface: &LevelSurface<D>,
    unwrap: impl Fn(&Vector<D>) -> Vector<D>,
) -> (Vector<D>, Vector<D>) {
    let mut low = Vector::<D>::repeat(f64::INFINITY);
    let mut high = Vector::<D>::repeat(f64::NEG_INFINITY);
    for x in surface.sample_points() {
        let x = unwrap(&x);
        low = low.inf(&x);
        high = high.sup(&x);
    }
    (low, high)
}

/// Adds the inside part of a cell with these edges. The part of a cut cell is added at the center of the cell.
fn inside_of_cell<const D: usize>(
    (surface, space): (&LevelSurface<D>, &Space<'_, D>),
    corner: &Vector<D>,
    edges: &Vector<D>,
    halvings: u32,
    sum: &mut EnclosedMoments<D>,
) {
    let whole = edges.product();
    let center = corner + edges * 0.5;
    let half_diagonal = 0.5 * edges.norm();
    let Some(foot) = surface.query(&center, f64::INFINITY) else { return };
    let free = space.share_of_cell(&center, edges, halvings == 0);
    if free == Some(0.0) {
        return;
    }
    let mut add = |area_or_volume: f64| {
        sum.area_or_volume += area_or_volume;
        sum.first += center * area_or_volume;
        sum.second += (center.component_mul(&center) + edges.component_mul(edges) / 12.0) * area_or_volume;
        sum.mixed += Vector::<D>::from_fn(|d, _| center[d] * center[(d + 1) % D]) * area_or_volume;
    };
    if foot.distance >= half_diagonal {
        if !surface.is_inside(&center, &foot) {
            return;
        }
        if let Some(free) = free {
            add(whole * free);
            return;
        }
    } else if halvings == 0 {
        // In units of the longest edge.
        let edge = edges.max();
        let signed = if foot.is_outside { foot.distance } else { -foot.distance };
        // At the distance ρ the surface is κ ρ²/2 away from its tangent plane, on average κ edge²/24 over a section of
        // the cell.
        let mean_deviation = (foot.curvature * edge).clamp(-1.0, 1.0) / 24.0;
        let offset = signed / edge + mean_deviation;
        let normal = foot.normal.component_mul(edges) / edge;
        let whole = whole * free.unwrap_or(1.0);
        add(whole * share_below_plane(&normal, offset));
        sum.surface += whole / edge * section_by_plane(&normal, offset);
        return;
    }
    let half = edges * 0.5;
    for octant in 0..1_usize << D {
        let child = Vector::<D>::from_fn(|d, _| corner[d] + half[d] * (octant >> d & 1) as f64);
        inside_of_cell((surface, space), &child, &half, halvings - 1, sum);
    }
}

/// Share of the unit cube, centered at the origin, with n·x + s < 0, where s = `signed`.
///
/// Inclusion and exclusion over the corners c gives Σ ± max(0, −s − n·c)^D / (D! Π n_d) for positive components of the
/// normal. Components near zero are raised to 1e-4 to keep the formula stable, which costs an error of that size.
fn share_below_plane<const D: usize>(normal: &Vector<D>, signed: f64) -> f64 {
    let n = normal.map(|c| c.abs().max(1e-4));
    let total: f64 = n.sum();
    let depth = 0.5 * total - signed;
    if depth <= 0.0 {
        return 0.0;
    }
    if depth >= total {
        return 1.0;
    }
    let mut sum = 0.0;
    for corner in 0..1_usize << D {
        let offset: f64 = (0..D).filter(|d| corner >> d & 1 == 1).map(|d| n[d]).sum();
        let term = (depth - offset).max(0.0).powi(D as i32);
        sum += if corner.count_ones().is_multiple_of(2) { term } else { -term };
    }
    let factorial = if D == 2 { 2.0 } else { 6.0 };
    (sum / (factorial * n.product())).clamp(0.0, 1.0)
}

/// Length (2D) or area (3D) of the section of the unit cube, centered at the origin, by the plane n·x + s = 0: minus the
/// derivative of [`share_below_plane`] by s.
fn section_by_plane<const D: usize>(normal: &Vector<D>, signed: f64) -> f64 {
    let n = normal.map(|c| c.abs().max(1e-4));
    let depth = 0.5 * n.sum() - signed;
    let mut sum = 0.0;
    for corner in 0..1_usize << D {
        let offset: f64 = (0..D).filter(|d| corner >> d & 1 == 1).map(|d| n[d]).sum();
        let term = (depth - offset).max(0.0).powi(D as i32 - 1);
        sum += if corner.count_ones().is_multiple_of(2) { term } else { -term };
    }
    let factorial = if D == 2 { 1.0 } else { 2.0 };
    // Behind the far corner the terms cancel up to round-off.
    (sum / (factorial * n.product())).clamp(0.0, 2.0)
}

#[cfg(test)]
mod tests {
    use super::{Vector, section_by_plane, share_below_plane};

    #[test]
    fn sections_are_those_of_lines_and_planes() {
        let near = |got: f64, expected: f64| assert!((got - expected).abs() < 1e-3, "{got}, not {expected}");
        near(section_by_plane(&Vector::<2>::new(1.0, 0.0), 0.2), 1.0);
        near(section_by_plane(&Vector::<2>::new(1.0, -1.0).normalize(), 0.0), 2.0_f64.sqrt());
        near(section_by_plane(&Vector::<2>::new(1.0, 1.0).normalize(), 0.8), 0.0);
        near(section_by_plane(&Vector::<2>::new(1.0, 1.0).normalize(), -0.8), 0.0);
        // A regular hexagon through the center.
        near(section_by_plane(&Vector::<3>::repeat(1.0).normalize(), 0.0), 0.75 * 3.0_f64.sqrt());
        near(section_by_plane(&Vector::<3>::new(0.0, 0.0, -1.0), 0.3), 1.0);
    }

    #[test]
    fn shares_of_the_unit_cube_agree_with_counted_points() {
        for (normal, signed) in [
            (Vector::<3>::new(1.0, 2.0, -2.0) / 3.0, 0.1),
            (Vector::<3>::new(0.0, 0.6, 0.8), -0.3),
            (Vector::<3>::new(1.0, 0.0, 0.0), 0.2),
        ] {
            let n = 60;
            let mut count = 0;
            for k in 0..n * n * n {
                let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                let x = Vector::<3>::new(at(k % n), at(k / n % n), at(k / n / n));
                count += i32::from(x.dot(&normal) + signed < 0.0);
            }
            let share = share_below_plane(&normal, signed);
            assert!((share - f64::from(count) / f64::from(n * n * n)).abs() < 0.01, "{share}");
        }
    }
}
