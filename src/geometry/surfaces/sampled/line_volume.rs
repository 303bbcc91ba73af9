//! The volume where a level is negative, by lengths along lines through small cells.

use super::Vector;
use crate::geometry::block::indices;

/// Least edge of a cell, relative to the longest side of the box.
const FINEST: f64 = 1.0 / 64.0;
/// Gauss–Legendre points and weights on [0, 1].
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
/// Steps of the search for a root.
const MOST_STEPS: usize = 60;

/// The volume where a level is negative within a box. The level must not change faster than the distance.
///
/// Cubes are halved where the level may change its sign. In the smallest ones Gauss's points across the steepest axis give
/// lines, and the length on which the level is negative is exact. Where the sign changes across the ends of a cell the error
/// is of second order: 1e-5 of the volume, about.
pub(in crate::geometry::surfaces) fn line_volume<const D: usize>(
    level: &dyn Fn(&Vector<D>) -> f64,
    low: &Vector<D>,
    high: &Vector<D>,
) -> f64 {
    let sides = high - low;
    let finest = FINEST * sides.max();
    let cells: [usize; D] = std::array::from_fn(|d| ((sides[d] / (8.0 * finest)).ceil() as usize).max(1));
    let edges = Vector::<D>::from_fn(|d, _| sides[d] / cells[d] as f64);
    let mut volume = 0.0;
    for k in 0..cells.iter().product::<usize>() {
        let cell = indices(k, &cells);
        let center = Vector::<D>::from_fn(|d, _| low[d] + (cell[d] as f64 + 0.5) * edges[d]);
        volume += in_cell(level, &center, &(edges * 0.5), finest);
    }
    volume
}

fn in_cell<const D: usize>(
    level: &dyn Fn(&Vector<D>) -> f64,
    center: &Vector<D>,
    half: &Vector<D>,
    finest: f64,
) -> f64 {
    let here = level(center);
    if here.abs() >= half.norm() {
        return if here < 0.0 { (half * 2.0).product() } else { 0.0 };
    }
    if 2.0 * half.max() > 1.001 * finest {
        let quarter = half * 0.5;
        let child = |corner: usize| {
            let offset = Vector::<D>::from_fn(|d, _| if corner >> d & 1 == 1 { quarter[d] } else { -quarter[d] });
            in_cell(level, &(center + offset), &quarter, finest)
        };
        return (0..1_usize << D).map(child).sum();
    }
    let change = |d: usize| {
        let mut e = Vector::<D>::zeros();
        e[d] = half[d];
        (level(&(center + e)) - level(&(center - e))).abs() / half[d]
    };
    let axis = (1..D).fold(0, |best, d| if change(d) > change(best) { d } else { best });
    let mut sum = 0.0;
    for line in 0..GAUSS.len().pow(D as u32 - 1) {
        let mut rest = line;
        let mut weight = 1.0;
        let mut start = center - half;
        for d in (0..D).filter(|d| *d != axis) {
            let (place, share) = GAUSS[rest % GAUSS.len()];
            rest /= GAUSS.len();
            start[d] += 2.0 * half[d] * place;
            weight *= 2.0 * half[d] * share;
        }
        sum += weight * negative_length(level, &start, axis, 2.0 * half[axis]);
    }
    sum
}

/// The length of a line along an axis on which the level is negative, with one change of sign at most (the Illinois method).
fn negative_length<const D: usize>(
    level: &dyn Fn(&Vector<D>) -> f64,
    start: &Vector<D>,
    axis: usize,
    length: f64,
) -> f64 {
    let at = |s: f64| {
        let mut x = *start;
        x[axis] += s;
        level(&x)
    };
    let (mut a, mut b) = (0.0, length);
    let (mut f, mut g) = (at(a), at(b));
    let starts_inside = f < 0.0;
    if starts_inside == (g < 0.0) {
        return if starts_inside { length } else { 0.0 };
    }
    for _ in 0..MOST_STEPS {
        let s = (a * g - b * f) / (g - f);
        let value = at(s);
        if value == 0.0 || b - a <= 1e-13 * length {
            (a, b) = (s, s);
            break;
        }
        if (value < 0.0) == starts_inside {
            // The other end keeps its place: half its value brings the next root nearer to it.
            (a, f, g) = (s, value, 0.5 * g);
        } else {
            (b, g, f) = (s, value, 0.5 * f);
        }
    }
    let root = 0.5 * (a + b);
    if starts_inside { root } else { length - root }
}
