//! Derivatives of vector fields on a surface: divergence, and the shape tensor of the normals.

use crate::geometry::Vector;
use crate::linear_algebra::SparseRows;

/// Derivatives ∂_a v_b of a vector field, where a and b are axes of space.
pub type Tensor<const D: usize> = [[f64; D]; D];

/// The tensor (∇_S v)_ab = G_a v_b of a vector field at every point, where `gradient` holds the operators G_1 … G_D.
///
/// For the field of unit normals this is the shape tensor (Surface DC-PSE, section 4.3).
#[must_use]
pub fn derivative_tensor<const D: usize>(gradient: &[SparseRows], field: &[Vector<D>]) -> Vec<Tensor<D>> {
    let rows = gradient.first().map_or(0, SparseRows::rows);
    let mut tensor = vec![[[0.0; D]; D]; rows];
    let mut derivative = vec![0.0; rows];
    for b in 0..D {
        let component: Vec<f64> = field.iter().map(|v| v[b]).collect();
        for (a, operator) in gradient.iter().enumerate().take(D) {
            operator.apply(&component, &mut derivative);
            tensor.iter_mut().zip(&derivative).for_each(|(s, value)| s[a][b] = *value);
        }
    }
    tensor
}

/// Divergence ∇_S·v, the trace of the tensor. For unit normals it is the curvature ∇·n.
#[must_use]
pub fn divergence<const D: usize>(tensor: &Tensor<D>) -> f64 {
    (0..D).map(|a| tensor[a][a]).sum()
}

/// Sum of the principal minors of order two. For the normals of a surface in space it is the Gauss curvature.
#[must_use]
pub fn sum_of_minors<const D: usize>(tensor: &Tensor<D>) -> f64 {
    let pairs = (0..D).flat_map(|a| (a + 1..D).map(move |b| (a, b)));
    pairs.map(|(a, b)| tensor[a][a] * tensor[b][b] - tensor[a][b] * tensor[b][a]).sum()
}

#[cfg(test)]
mod tests {
    use super::{derivative_tensor, divergence, sum_of_minors};
    use crate::geometry::Vector;
    use crate::geometry::fibonacci;
    use crate::operators::charts::tangent::Metric;
    use crate::operators::{Functional, Support, TangentChart, construct};
    use crate::parallel::Interrupt;

    /// On the unit sphere, the tangential part of a constant c is ∇_S (c·x) with the divergence −2 c·x. The shape
    /// tensor has the divergence 2 and the sum of minors 1. A rotation about an axis has no divergence.
    #[test]
    fn fields_on_the_sphere_have_their_divergence() {
        let points: Vec<Vector<3>> = fibonacci::sphere(2000);
        let radius = 4.0 * (4.0 * std::f64::consts::PI / 2000.0).sqrt();
        let chart = TangentChart::new(&points, &points, Metric::FromNormals, radius);
        let functionals: Vec<Functional<2>> = (0..3).map(Functional::Gradient).collect();
        let support = Support { degree: 5, radius };
        let built = construct::<2>(&chart, support, &functionals, &Interrupt::default()).unwrap();
        let c = Vector::<3>::new(0.3, -0.7, 0.4);
        let tensor_of = |field: Vec<Vector<3>>| derivative_tensor(&built.operators, &field);
        let tangential = tensor_of(points.iter().map(|x| c - x * x.dot(&c)).collect());
        let turning = tensor_of(points.iter().map(|x| c.cross(x)).collect());
        let shape = tensor_of(points.clone());
        for (i, x) in points.iter().enumerate() {
            assert!((divergence(&tangential[i]) + 2.0 * c.dot(x)).abs() < 1e-4);
            assert!(divergence(&turning[i]).abs() < 1e-4);
            assert!((divergence(&shape[i]) - 2.0).abs() < 1e-4 && (sum_of_minors(&shape[i]) - 1.0).abs() < 1e-4);
        }
    }
}
