//! The nearest neighbors of every point of a cloud, and the local spacing.

use crate::geometry::Vector;
use crate::neighbors::KdTree;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};
use std::f64::consts::PI;

/// Points of a parallel task at least.
const POINTS: usize = 64;

/// The nearest neighbors of every point, nearest first, the point itself excepted.
#[derive(Debug, Clone)]
pub struct Nearest {
    /// Neighbors of each point.
    count: usize,
    indices: Vec<u32>,
}

impl Nearest {
    /// The `count` nearest neighbors of every point, or all others where there are fewer.
    #[must_use]
    pub fn new<const D: usize>(points: &[Vector<D>], count: usize) -> Self {
        let tree = KdTree::new(points);
        let count = count.min(points.len().saturating_sub(1));
        let mut indices = vec![0; points.len() * count];
        if count > 0 {
            use rayon::prelude::ParallelSliceMut;
            let lists = indices.par_chunks_mut(count).enumerate().with_min_len(POINTS);
            lists.for_each_init(Vec::new, |found, (i, list)| {
                tree.nearest(&points[i], count + 1, found);
                // Of many points at one place the point itself may not be among the nearest.
                let others = found.iter().map(|(_, j)| *j).filter(|j| *j as usize != i);
                list.iter_mut().zip(others).for_each(|(place, j)| *place = j);
            });
        }
        Self { count, indices }
    }

    /// The neighbors of point i, nearest first.
    #[must_use]
    pub fn of(&self, i: usize) -> &[u32] {
        &self.indices[i * self.count..(i + 1) * self.count]
    }
}

/// Numbers k of the distances d_k that give the spacing of a surface. A single distance is noise where points are random.
const ON_SURFACES: [usize; 4] = [6, 8, 10, 12];
/// The same on curves.
const ON_CURVES: [usize; 4] = [3, 4, 5, 6];

/// Number of neighbors that [`at_each_point`] reads.
#[must_use]
pub const fn neighbors_wanted(dimension: usize) -> usize {
    if dimension == 2 { ON_CURVES[3] } else { ON_SURFACES[3] }
}

/// Local spacing s_i: the median over some k of the spacing of a uniform cloud with the distance d_k to the k-th neighbor,
/// d_k √(π/(k + ½)) on a surface and 2 d_k/(k + ½) on a curve.
#[must_use]
pub fn at_each_point<const D: usize>(points: &[Vector<D>], nearest: &Nearest) -> Vec<f64> {
    let spacing = |i: usize| {
        let near = nearest.of(i);
        let of = |k: usize| {
            let Some(j) = near.get(k - 1).or(near.last()) else { return 0.0 };
            let (distance, share) = ((points[*j as usize] - points[i]).norm(), k as f64 + 0.5);
            if D == 2 { 2.0 * distance / share } else { distance * (PI / share).sqrt() }
        };
        let mut found = if D == 2 { ON_CURVES } else { ON_SURFACES }.map(of);
        found.sort_unstable_by(f64::total_cmp);
        0.5 * (found[1] + found[2])
    };
    (0..points.len()).into_par_iter().with_min_len(POINTS).map(spacing).collect()
}

/// The median of each value and those of the nearest eight neighbors (four on curves).
#[must_use]
pub fn smoothed<const D: usize>(values: &[f64], nearest: &Nearest) -> Vec<f64> {
    let number = if D == 2 { 4 } else { 8 };
    let at = |(i, own): (usize, &f64)| {
        let near = nearest.of(i).iter().take(number);
        let mut found: Vec<f64> = near.map(|j| values[*j as usize]).collect();
        found.push(*own);
        median(&mut found)
    };
    values.par_iter().enumerate().with_min_len(POINTS).map(at).collect()
}

/// Median of numbers, which are sorted; 0 for an empty list.
#[must_use]
pub fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::{Nearest, at_each_point, smoothed};
    use crate::geometry::{Vector, fibonacci};
    use std::f64::consts::{PI, TAU};

    #[test]
    fn spacing_is_the_root_of_the_area_of_a_point() {
        let points = fibonacci::sphere(2000);
        let nearest = Nearest::new(&points, 12);
        let expected = (4.0 * PI / 2000.0).sqrt();
        let found = smoothed::<3>(&at_each_point(&points, &nearest), &nearest);
        assert!(found.iter().all(|s| (0.95..1.05).contains(&(s / expected))), "{found:?}");
    }

    #[test]
    fn spacing_of_a_curve_is_the_length_of_a_point() {
        let at = |i: i32| TAU * f64::from(i) / 200.0;
        let points: Vec<_> = (0..200).map(|i| Vector::<2>::new(at(i).cos(), at(i).sin())).collect();
        let nearest = Nearest::new(&points, 6);
        let found = smoothed::<2>(&at_each_point(&points, &nearest), &nearest);
        assert!(found.iter().all(|s| (0.95..1.05).contains(&(s * 200.0 / TAU))), "{found:?}");
    }
}
