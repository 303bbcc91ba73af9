//! A surface seen from one side: points in front, projected along the line of sight.

/// The line of sight, from the surface to the eye; the z axis points up in the picture.
const SIGHT: [f64; 3] = [0.45, -0.7, 0.55];

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn scaled_to_one(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    a.map(|c| c / length)
}

/// Points in front, projected (z = 0) and sorted from the farthest, with their values.
#[must_use]
pub fn seen(points: &[[f64; 3]], normals: &[[f64; 3]], values: &[f64]) -> (Vec<[f64; 3]>, Vec<f64>) {
    let sight = scaled_to_one(SIGHT);
    let right = scaled_to_one([-sight[1], sight[0], 0.0]);
    let up = [
        sight[1] * right[2] - sight[2] * right[1],
        sight[2] * right[0] - sight[0] * right[2],
        sight[0] * right[1] - sight[1] * right[0],
    ];
    // The farthest first, so that what is in front is drawn over it.
    let mut order: Vec<usize> = (0..points.len()).filter(|i| dot(normals[*i], sight) > 0.0).collect();
    order.sort_by(|a, b| dot(points[*a], sight).total_cmp(&dot(points[*b], sight)));
    order.iter().map(|i| ([dot(points[*i], right), dot(points[*i], up), 0.0], values[*i])).unzip()
}

#[cfg(test)]
mod tests {
    use super::seen;

    #[test]
    fn the_back_of_a_sphere_is_not_seen_and_up_is_up() {
        let points = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.45, -0.7, 0.0]];
        let (shown, values) = seen(&points, &points, &[1.0, 2.0, 3.0]);
        assert_eq!((shown.len(), values), (2, vec![1.0, 3.0]));
        assert!(shown[0][1] > 0.5 && shown[0][0].abs() < 1e-12);
    }
}
