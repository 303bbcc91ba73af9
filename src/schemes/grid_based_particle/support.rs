//! Where a place lies relative to the particles of a fit, in the coordinates along the front.

use super::local_graph::LocalPoint;

/// The place moved into the bounding box of the points and of the origin.
pub(super) fn clamp_to_box<const M: usize>(s: &[f64; M], points: &[LocalPoint<M>]) -> [f64; M] {
    std::array::from_fn(|a| {
        let (low, high) = points.iter().fold((0.0_f64, 0.0_f64), |(l, h), (x, _)| (l.min(x[a]), h.max(x[a])));
        s[a].clamp(low, high)
    })
}

/// Distance by which s lies beyond all points, in the direction of s from their mean; negative between them.
pub(super) fn extrapolation<const M: usize>(s: &[f64; M], points: &[LocalPoint<M>]) -> f64 {
    let share = 1.0 / points.len().max(1) as f64;
    let mut way = *s;
    for (x, _) in points {
        for (way, x) in way.iter_mut().zip(x) {
            *way -= share * x;
        }
    }
    let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
    if length == 0.0 {
        return 0.0;
    }
    let along = |x: &[f64; M]| x.iter().zip(&way).map(|(x, w)| x * w).sum::<f64>() / length;
    let farthest = points.iter().fold(f64::NEG_INFINITY, |most, (x, _)| most.max(along(x)));
    along(s) - farthest
}

#[cfg(test)]
mod tests {
    use super::{clamp_to_box, extrapolation};

    #[test]
    fn a_place_beyond_the_last_point_is_extrapolated() {
        let points = [-1.0, 0.0, 2.0].map(|x| ([x], [0.0; 3]));
        assert!((extrapolation(&[2.5], &points) - 0.5).abs() < 1e-15);
        assert!((extrapolation(&[-1.25], &points) - 0.25).abs() < 1e-15);
        assert!(extrapolation(&[1.0], &points) < 0.0);
        assert_eq!((clamp_to_box(&[2.5], &points), clamp_to_box(&[0.3], &points)), ([2.0], [0.3]));
    }

    #[test]
    fn on_a_surface_the_direction_from_the_mean_counts() {
        let points = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|x| (x, [0.0; 3]));
        assert!((extrapolation(&[1.5, 0.0], &points) - 0.5).abs() < 1e-15);
        assert!((extrapolation(&[2.0, 2.0], &points) - 2.0_f64.sqrt()).abs() < 1e-15);
        assert!(extrapolation(&[0.0, 0.0], &points).abs() < 1e-15);
    }
}
