//! The area or volume inside the surface, its center and second moments, by quadrature on the fitted polynomials.
//!
//! A coarse grid of cells covers the samples. Cells away from the surface count whole or not at
//! all; cells that it cuts are halved along every axis, and the smallest ones count the share that the
//! tangent plane at the foot of their center leaves inside, moved by the mean bend of the surface over the cell.

use super::level_surface::LevelSurface;
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IntoParallelIterator, ParallelIterator};

/// Halvings of a cut cell: 2⁴ in 2D leaves a plane share with an error below (h/16)² per cut length; 3D stops earlier,
/// since the number of cut cells grows with the square.
const fn halvings(dimension: usize) -> u32 {
    if dimension == 2 { 4 } else { 1 }
}

/// Cells along the longest side of the samples' box before any is halved.
const COARSE_CELLS: f64 = 16.0;

/// Moments of the inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnclosedMoments<const D: usize> {
    /// Area or volume.
    pub area_or_volume: f64,
    /// ∫ x.
    pub first: Vector<D>,
    /// ∫ x_d², axis by axis.
    pub second: Vector<D>,
    /// Lower corner of the box round the samples.
    pub low: Vector<D>,
    /// Upper corner.
    pub high: Vector<D>,
}

impl<const D: usize> EnclosedMoments<D> {
    fn nothing() -> Self {
        let zero = Vector::<D>::zeros();
        Self { area_or_volume: 0.0, first: zero, second: zero, low: zero, high: zero }
    }

    fn add(&mut self, other: &Self) {
        self.area_or_volume += other.area_or_volume;
        self.first += other.first;
        self.second += other.second;
    }

    /// Where it is.
    #[must_use]
    pub fn center(&self) -> Vector<D> {
        self.first / self.area_or_volume
    }

    /// Central second moments, axis by axis, by the measure.
    #[must_use]
    pub fn variance(&self) -> Vector<D> {
        let center = self.center();
        self.second / self.area_or_volume - center.component_mul(&center)
    }
}

/// The measure of all points with a negative level, for a bounded surface in an unbounded space.
///
/// Zero without samples. The sum runs over cells in a fixed order.
///
/// # Errors
/// [`Interrupted`] when somebody asked to stop.
pub fn enclosed_area_or_volume<const D: usize>(
    surface: &LevelSurface<D>,
    interrupt: &Interrupt,
) -> Result<f64, Interrupted> {
    enclosed_moments(surface, |x| *x, interrupt).map(|moments| moments.area_or_volume)
}

/// Measure and moments likewise. In a periodic space `unwrap` moves the points of the surface side by side again.
///
/// # Errors
/// [`Interrupted`] when somebody asked to stop.
pub fn enclosed_moments<const D: usize>(
    surface: &LevelSurface<D>,
    unwrap: impl Fn(&Vector<D>) -> Vector<D>,
    interrupt: &Interrupt,
) -> Result<EnclosedMoments<D>, Interrupted> {
    if surface.is_lost() {
        return Ok(EnclosedMoments::nothing());
    }
    let spacing = surface.spacing();
    let mut low = Vector::<D>::repeat(f64::INFINITY);
    let mut high = Vector::<D>::repeat(f64::NEG_INFINITY);
    for x in surface.sample_points() {
        let x = unwrap(&x);
        low = low.inf(&x);
        high = high.sup(&x);
    }
    let extent = (low, high);
    // Coarse cells that the surface does not cut are settled at one query each.
    let coarsening = ((high - low).max() / (COARSE_CELLS * spacing)).log2().ceil().max(0.0);
    let edge = spacing * coarsening.exp2();
    let halvings = halvings(D) + coarsening as u32;
    let low = low.add_scalar(-2.0 * spacing);
    let counts: [usize; D] = std::array::from_fn(|d| ((high[d] + 2.0 * spacing - low[d]) / edge).ceil() as usize);
    let rows: usize = counts[1..].iter().product();
    let sums: Vec<EnclosedMoments<D>> = (0..rows)
        .into_par_iter()
        .map(|row| {
            let mut corner = low;
            let mut rest = row;
            for d in 1..D {
                corner[d] += (rest % counts[d]) as f64 * edge;
                rest /= counts[d];
            }
            let mut sum = EnclosedMoments::nothing();
            for k in 0..counts[0] {
                corner[0] = low[0] + k as f64 * edge;
                if !interrupt.is_raised() {
                    inside_of_cell(surface, &corner, edge, halvings, &mut sum);
                }
            }
            sum
        })
        .collect();
    interrupt.check()?;
    let mut moments = EnclosedMoments::nothing();
    for sum in &sums {
        moments.add(sum);
    }
    (moments.low, moments.high) = extent;
    Ok(moments)
}

/// Adds the inside part of one cubic cell; a cut one counts at its center.
fn inside_of_cell<const D: usize>(
    surface: &LevelSurface<D>,
    corner: &Vector<D>,
    edge: f64,
    halvings: u32,
    sum: &mut EnclosedMoments<D>,
) {
    let whole = edge.powi(D as i32);
    let center = corner.add_scalar(0.5 * edge);
    let half_diagonal = 0.5 * edge * (D as f64).sqrt();
    let Some(foot) = surface.query(&center, f64::INFINITY) else { return };
    let mut add = |area_or_volume: f64| {
        sum.area_or_volume += area_or_volume;
        sum.first += center * area_or_volume;
        sum.second += center.component_mul(&center).add_scalar(edge * edge / 12.0) * area_or_volume;
    };
    if foot.distance >= half_diagonal {
        if surface.is_inside(&center, &foot) {
            add(whole);
        }
        return;
    }
    if halvings == 0 {
        let signed = if foot.is_outside { foot.distance } else { -foot.distance };
        // The surface bends away from its tangent plane by κ ρ²/2, on the average over a section of the cell by κ edge²/24.
        let bend = (foot.curvature * edge).clamp(-1.0, 1.0) / 24.0;
        add(whole * share_below_plane(&foot.normal, signed / edge + bend));
        return;
    }
    let half = 0.5 * edge;
    for octant in 0..1_usize << D {
        let child = Vector::<D>::from_fn(|d, _| corner[d] + half * (octant >> d & 1) as f64);
        inside_of_cell(surface, &child, half, halvings - 1, sum);
    }
}

/// The share of the unit cube about the origin with n·x + s < 0 for a unit normal n.
///
/// By inclusion and exclusion over the corners: Σ ± max(0, −s − n·c)^D / (D! Π n_d), for the normal's components
/// made positive; components near zero are lifted to keep the formula stable, at an error of their size.
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

#[cfg(test)]
mod tests {
    use super::{Vector, share_below_plane};

    #[test]
    fn planes_cut_the_unit_cube_as_counted() {
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
