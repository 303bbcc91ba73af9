//! A surface seen from one side: points in front, projected along the line of sight.

/// Lines of sight, from the surface to the eye; the z axis points up in the picture. The first one is taken where no other shows
/// the surface much wider.
const SIGHTS: [[f64; 3]; 7] = [
    [0.45, -0.7, 0.55],
    [-0.45, -0.7, 0.55],
    [-0.7, -0.45, 0.55],
    [0.7, -0.45, 0.55],
    [0.15, -0.25, 0.95],
    [0.2, -0.95, 0.25],
    [0.95, -0.2, 0.25],
];
/// How much wider another line of sight must show a surface, by area.
const WIDER: f64 = 1.4;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn scaled_to_one(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    a.map(|c| c / length)
}

/// The directions to the right and upward in a picture seen along a line of sight.
fn axes(sight: [f64; 3]) -> [[f64; 3]; 2] {
    let right = scaled_to_one([-sight[1], sight[0], 0.0]);
    let up = [
        sight[1] * right[2] - sight[2] * right[1],
        sight[2] * right[0] - sight[0] * right[2],
        sight[0] * right[1] - sight[1] * right[0],
    ];
    [right, up]
}

/// Size of the projection of points along a line of sight: the determinant of the covariance of their coordinates in the picture.
fn spread(points: &[[f64; 3]], sight: [f64; 3]) -> f64 {
    let axes = axes(sight);
    let count = points.len().max(1) as f64;
    let flat: Vec<[f64; 2]> = points.iter().map(|x| axes.map(|axis| dot(*x, axis))).collect();
    let middle = [0, 1].map(|a| flat.iter().map(|x| x[a]).sum::<f64>() / count);
    let product =
        |a: usize, b: usize| flat.iter().map(|x| (x[a] - middle[a]) * (x[b] - middle[b])).sum::<f64>() / count;
    (product(0, 0) * product(1, 1) - product(0, 1).powi(2)).max(0.0).sqrt()
}

/// Fewer points have no wide side.
const FEW: usize = 12;

/// The line of sight from a good side.
fn good_sight(points: &[[f64; 3]]) -> [f64; 3] {
    let sights = SIGHTS.map(scaled_to_one);
    if points.len() < FEW {
        return sights[0];
    }
    let first = spread(points, sights[0]);
    let wider = sights.map(|sight| (sight, spread(points, sight)));
    let best = wider.iter().fold(wider[0], |best, next| if next.1 > best.1 { *next } else { best });
    if best.1 > WIDER * first { best.0 } else { sights[0] }
}

/// Points in front, projected (z = 0) and sorted from the farthest, with their values.
#[must_use]
pub fn seen(points: &[[f64; 3]], normals: &[[f64; 3]], values: &[f64]) -> (Vec<[f64; 3]>, Vec<f64>) {
    let sight = good_sight(points);
    let [right, up] = axes(sight);
    // The farthest first, so that what is in front is drawn over it.
    let mut order: Vec<usize> = (0..points.len()).filter(|i| dot(normals[*i], sight) > 0.0).collect();
    order.sort_by(|a, b| dot(points[*a], sight).total_cmp(&dot(points[*b], sight)));
    order.iter().map(|i| ([dot(points[*i], right), dot(points[*i], up), 0.0], values[*i])).unzip()
}

#[cfg(test)]
mod tests {
    use super::{good_sight, seen};

    #[test]
    fn a_flat_surface_is_seen_from_its_wide_side() {
        let disc = |axis: usize| -> Vec<[f64; 3]> {
            let at = |k: u32| {
                let (radius, angle) = (f64::from(k).sqrt(), 2.4 * f64::from(k));
                let flat = [radius * angle.cos(), radius * angle.sin()];
                std::array::from_fn(|d| if d == axis { 0.0 } else { flat[(d + usize::from(d > axis)) % 2] })
            };
            (0..200).map(at).collect()
        };
        for axis in 0..3 {
            assert!(good_sight(&disc(axis))[axis].abs() > 0.65, "{axis}");
        }
    }

    #[test]
    fn the_back_of_a_sphere_is_not_seen_and_up_is_up() {
        let points = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.45, -0.7, 0.0]];
        let (shown, values) = seen(&points, &points, &[1.0, 2.0, 3.0]);
        assert_eq!((shown.len(), values), (2, vec![1.0, 3.0]));
        assert!(shown[0][1] > 0.5 && shown[0][0].abs() < 1e-12);
    }
}
