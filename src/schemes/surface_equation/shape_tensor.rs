//! The shape tensor ∇_S n of a surface at a point, and its principal curvatures and directions.

use crate::geometry::Vector;
use crate::geometry::frame::tangents;
use crate::operators::Tensor;
use crate::operators::charts::Heights;

/// The entries xx, xy, xz, yy, yz, zz of a symmetric tensor, in 1/length.
pub type ShapeTensor = [f64; 6];

/// Places of the entries in [`ShapeTensor`] by axes.
const PLACES: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The tensor of a surface that is given by heights h over the plane with the unit normal `n`:
/// −Σ e_a (g⁻¹ b g⁻¹)^ab e_bᵀ with e_a = t_a + h_a n, g_ab = δ_ab + h_a h_b and b_ab = h_ab/√det g.
#[must_use]
pub fn from_heights<const D: usize, const M: usize>(n: &Vector<D>, heights: &Heights<M>) -> ShapeTensor {
    let h = &heights.first;
    let det = 1.0 + h.iter().map(|slope| slope * slope).sum::<f64>();
    let inverse = |a: usize, b: usize| f64::from(u8::from(a == b)) - h[a] * h[b] / det;
    let t = tangents::<D, M>(n);
    // Columns g^ab e_b.
    let raised: [Vector<D>; M] =
        std::array::from_fn(|a| (0..M).fold(Vector::<D>::zeros(), |sum, b| sum + (t[b] + n * h[b]) * inverse(a, b)));
    let mut tensor = [0.0; 6];
    for (p, places) in PLACES.iter().enumerate().take(D) {
        for (q, place) in places.iter().enumerate().take(D).skip(p) {
            let mut sum = 0.0;
            for a in 0..M {
                for b in 0..M {
                    sum += raised[a][p] * heights.second[a][b] * raised[b][q];
                }
            }
            tensor[*place] = -sum / det.sqrt();
        }
    }
    tensor
}

/// The symmetric part of a tensor of derivatives of normals.
#[must_use]
pub fn from_derivatives<const D: usize>(derivatives: &Tensor<D>) -> ShapeTensor {
    let mut tensor = [0.0; 6];
    for (p, places) in PLACES.iter().enumerate().take(D) {
        for (q, place) in places.iter().enumerate().take(D).skip(p) {
            tensor[*place] = 0.5 * (derivatives[p][q] + derivatives[q][p]);
        }
    }
    tensor
}

/// A row of the tensor.
#[must_use]
pub fn row(tensor: &ShapeTensor, axis: usize) -> Vector<3> {
    Vector::<3>::from_fn(|d, _| tensor[PLACES[axis][d]])
}

/// Principal curvatures, the larger one first, with their unit directions. The normal direction has the eigenvalue zero and is left
/// out: it is the one closest to `n`. The sign of a direction is such that its largest component is positive.
#[must_use]
pub fn principal(tensor: &ShapeTensor, n: &Vector<3>) -> [(f64, Vector<3>); 2] {
    let [first, second] = tangents::<3, 2>(n);
    // The tensor in the tangent plane.
    let applied = |t: &Vector<3>| Vector::<3>::from_fn(|axis, _| row(tensor, axis).dot(t));
    let (a, b, c) = (first.dot(&applied(&first)), first.dot(&applied(&second)), second.dot(&applied(&second)));
    let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
    let gap = half.hypot(b);
    let angle = 0.5 * b.atan2(half);
    let direction = |angle: f64| {
        let v = first * angle.cos() + second * angle.sin();
        let largest = v.iter().fold(0.0_f64, |most, c| if c.abs() > most.abs() { *c } else { most });
        if largest < 0.0 { -v } else { v }
    };
    [(middle + gap, direction(angle)), (middle - gap, direction(angle + std::f64::consts::FRAC_PI_2))]
}

#[cfg(test)]
mod tests {
    use super::{from_derivatives, from_heights, principal};
    use crate::geometry::Vector;
    use crate::geometry::frame::tangents;
    use crate::operators::charts::Heights;

    /// A cylinder of radius 2 about the x axis, seen over a plane that is tilted about both tangents.
    #[test]
    fn a_cylinder_has_its_curvature_across_over_any_plane() {
        let normal = Vector::<3>::new(0.0, 0.6, 0.8);
        for tilt in [[0.0, 0.0], [0.2, -0.1], [-0.3, 0.4]] {
            let n = (normal + Vector::<3>::x() * tilt[0] + Vector::<3>::y() * tilt[1]).normalize();
            let t = tangents::<3, 2>(&n);
            // F = y² + z² − 4 = 0: derivatives of the height along n by implicit differentiation.
            let gradient = Vector::<3>::new(0.0, normal[1], normal[2]) * 4.0;
            let hessian = |a: &Vector<3>, b: &Vector<3>| 2.0 * (a[1] * b[1] + a[2] * b[2]);
            let along = gradient.dot(&n);
            let slope = t.map(|t| -gradient.dot(&t) / along);
            let e: [Vector<3>; 2] = std::array::from_fn(|a| t[a] + n * slope[a]);
            let heights = Heights {
                first: slope,
                second: std::array::from_fn(|a| std::array::from_fn(|b| -hessian(&e[a], &e[b]) / along)),
            };
            let tensor = from_heights(&n, &heights);
            let [(larger, across), (smaller, axis)] = principal(&tensor, &normal);
            assert!((larger - 0.5).abs() < 1e-12 && smaller.abs() < 1e-12, "{larger} {smaller}");
            assert!((axis - Vector::<3>::x()).norm() < 1e-12 && across.dot(&normal).abs() < 1e-12);
        }
    }

    #[test]
    fn the_normals_of_a_sphere_have_one_curvature() {
        let n = Vector::<3>::new(1.0, 2.0, -2.0) / 3.0;
        let derivatives = std::array::from_fn(|a| std::array::from_fn(|b| f64::from(u8::from(a == b)) - n[a] * n[b]));
        let found = principal(&from_derivatives::<3>(&derivatives), &n);
        assert!(found.iter().all(|(k, v)| (k - 1.0).abs() < 1e-12 && v.dot(&n).abs() < 1e-12));
    }
}
