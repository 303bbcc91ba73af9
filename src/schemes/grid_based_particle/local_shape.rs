//! Direction and curvatures of a front at a point of its local graph.

use super::local_graph::GraphJet;
use crate::geometry::Vector;
use crate::geometry::frame::Frame;

/// Direction and curvatures at a point of a front; lengths are those of the graph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LocalShape<const D: usize> {
    /// The normal of a surface, the tangent of a curve in space.
    pub direction: Vector<D>,
    /// ∇·n of a surface, κ of a curve in space.
    pub curvature: f64,
    /// Product of the principal curvatures; zero of a curve.
    pub gauss_curvature: f64,
    /// The largest principal curvature by absolute value.
    pub sharpest: f64,
}

impl<const D: usize> LocalShape<D> {
    /// The shape of the graph of C polynomials over a frame, from their values and derivatives at one point.
    pub fn new<const M: usize, const C: usize>(frame: &Frame<D, M, C>, jets: &[GraphJet<M>; C]) -> Self {
        let jet = &jets[0];
        if C == 1 {
            let (flat, rise) = jet.normal();
            let mut direction = frame.normals[0] * rise;
            for (t, part) in frame.tangents.iter().zip(flat) {
                direction += t * part;
            }
            let (curvature, gauss_curvature) = (jet.curvature(), jet.gauss_curvature());
            return Self { direction, curvature, gauss_curvature, sharpest: jet.sharpest() };
        }
        // r′ = (1, f′), r″ = (0, f″); κ = |part of r″ perpendicular to r′|/|r′|².
        let mut direction = frame.tangents[0];
        let mut bend = Vector::<D>::zeros();
        for (up, jet) in frame.normals.iter().zip(jets) {
            direction += up * jet.first[0];
            bend += up * jet.second[0][0];
        }
        let square = direction.norm_squared();
        bend -= direction * (bend.dot(&direction) / square);
        let curvature = bend.norm() / square;
        Self { direction: direction / square.sqrt(), curvature, gauss_curvature: 0.0, sharpest: curvature }
    }
}

#[cfg(test)]
mod tests {
    use super::{Frame, GraphJet, LocalShape};
    use crate::geometry::Vector;

    /// A helix (cos s, sin s, c s) over its tangent has curvature 1/(1 + c²).
    #[test]
    fn a_curve_in_space_has_the_curvature_of_a_helix() {
        let c: f64 = 0.75;
        let tangent = Vector::<3>::new(0.0, 1.0, c).normalize();
        let frame = Frame::<3, 1, 2>::from_tangent(&tangent);
        // By arc length the second derivative at s = 0 is (−1, 0, 0)/(1 + c²).
        let second = Vector::<3>::new(-1.0 / (1.0 + c * c), 0.0, 0.0);
        let jets = frame.normals.map(|up| GraphJet { value: 0.0, first: [0.0], second: [[up.dot(&second)]] });
        let shape = LocalShape::new(&frame, &jets);
        assert!((shape.curvature - 1.0 / (1.0 + c * c)).abs() < 1e-14);
        assert!((shape.direction - tangent).norm() < 1e-14);
    }

    #[test]
    fn a_hill_has_a_positive_curvature_and_an_upward_normal() {
        let up = Vector::<3>::new(0.0, 0.0, 1.0);
        let frame = Frame::<3, 2, 1>::from_normal(&up);
        let jet = GraphJet { value: 0.2, first: [0.0; 2], second: [[-0.5, 0.0], [0.0, -2.0]] };
        let shape = LocalShape::new(&frame, &[jet]);
        assert!((shape.direction - up).norm() < 1e-15);
        assert!((shape.curvature - 2.5).abs() < 1e-15 && (shape.gauss_curvature - 1.0).abs() < 1e-15);
        assert!((shape.sharpest - 2.0).abs() < 1e-15);
    }
}
