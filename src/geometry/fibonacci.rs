//! Evenly spread points on surfaces of revolution, along a Fibonacci spiral (González 2009).
//!
//! Each point stands for the same area. The next point is turned about the axis by the golden angle.

use super::Vector;
use std::f64::consts::PI;

/// Angle of point i about the axis: i times the golden angle π (3 − √5).
fn spiral_angle(i: usize) -> f64 {
    PI * (3.0 - 5.0_f64.sqrt()) * i as f64
}

/// `count` Fibonacci points of the unit sphere: z_i = 1 − 2 (i + ½)/N at the angle i π (3 − √5).
///
/// ```
/// let points = meniscus::geometry::fibonacci::sphere(100);
/// assert!(points.iter().all(|x| (x.norm() - 1.0).abs() < 1e-14));
/// ```
#[must_use]
pub fn sphere(count: usize) -> Vec<Vector<3>> {
    (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let (across, angle) = ((1.0 - z * z).sqrt(), spiral_angle(i));
            Vector::<3>::new(across * angle.cos(), across * angle.sin(), z)
        })
        .collect()
}

/// `count` Fibonacci points of a surface of revolution about the z axis.
///
/// - `share(s)`: the share of the area below the parameter s, rising from 0 to 1 over [0, 1].
/// - `profile(s)`: distance from the axis, and z, at the parameter s.
#[must_use]
pub fn surface_of_revolution(
    count: usize,
    share: impl Fn(f64) -> f64,
    profile: impl Fn(f64) -> (f64, f64),
) -> Vec<Vector<3>> {
    (0..count)
        .map(|i| {
            let wanted = (i as f64 + 0.5) / count as f64;
            let (mut low, mut high) = (0.0, 1.0);
            // Sixty halvings of [0, 1] exhaust the 53 bits of a double.
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if share(middle) < wanted {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let ((across, z), angle) = (profile(low), spiral_angle(i));
            Vector::<3>::new(across * angle.cos(), across * angle.sin(), z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    #[test]
    fn points_lie_on_the_sphere_and_are_evenly_spread() {
        let points = super::sphere(500);
        let share = (4.0 * PI / 500.0_f64).sqrt();
        for (i, x) in points.iter().enumerate() {
            assert!((x.norm() - 1.0).abs() < 1e-14);
            let nearest = points[..i].iter().map(|y| (x - y).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.8 * share, "{nearest}");
        }
    }

    #[test]
    fn the_sphere_is_a_surface_of_revolution() {
        let turned =
            super::surface_of_revolution(300, |s| 0.5 * (1.0 - (PI * s).cos()), |s| ((PI * s).sin(), (PI * s).cos()));
        for (x, y) in turned.iter().zip(super::sphere(300)) {
            assert!((x - y).norm() < 1e-12);
        }
    }
}
