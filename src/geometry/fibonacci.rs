//! Points spread evenly over a sphere.

use super::Vector;
use std::f64::consts::PI;

/// Fibonacci points of the unit sphere: z_i = 1 − 2 (i + ½)/N, turned by the golden angle from one to the next.
#[must_use]
pub fn sphere(count: usize) -> Vec<Vector<3>> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let (across, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            Vector::<3>::new(across * angle.cos(), across * angle.sin(), z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn points_are_on_the_sphere_and_as_far_apart_as_their_share_of_it() {
        let points = super::sphere(500);
        let share = (4.0 * std::f64::consts::PI / 500.0_f64).sqrt();
        for (i, x) in points.iter().enumerate() {
            assert!((x.norm() - 1.0).abs() < 1e-14);
            let nearest = points[..i].iter().map(|y| (x - y).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.8 * share, "{nearest}");
        }
    }
}
