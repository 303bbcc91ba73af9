//! Orthonormal frames at a point of a surface or a curve.
//!
//! A frame splits space into tangents and normals. A surface of D − 1 dimensions has one normal. A curve in space has
//! one tangent and two normals.

use super::Vector;

/// M = D − 1 unit vectors that are orthogonal to the unit normal `n` and to each other.
///
/// They come from the coordinate axes by Gram–Schmidt, the axis with the longest remainder first.
#[must_use]
pub fn tangents<const D: usize, const M: usize>(n: &Vector<D>) -> [Vector<D>; M] {
    let mut found = [Vector::<D>::zeros(); M];
    for a in 0..M {
        // The remainder of axis d without its parts along `n` and the tangents found before.
        let remainder = |d: usize| {
            let mut e = Vector::<D>::zeros();
            e[d] = 1.0;
            let mut e = e - n * n[d];
            for t in &found[..a] {
                e -= t * t[d];
            }
            e
        };
        let lengths = (0..D).map(|d| (d, remainder(d).norm_squared()));
        let (axis, _) = lengths.fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best });
        found[a] = remainder(axis).normalize();
    }
    found
}

/// The unit vector that is orthogonal to D − 1 independent vectors and right-handed with them.
///
/// In the plane this is the vector turned clockwise, in space the normalized cross product.
#[must_use]
pub fn normal_to<const D: usize, const M: usize>(tangents: &[Vector<D>; M]) -> Vector<D> {
    let mut n = Vector::<D>::zeros();
    if D == 2 {
        n[0] = tangents[0][1];
        n[1] = -tangents[0][0];
    } else {
        let (a, b) = (&tangents[0], &tangents[M - 1]);
        for d in 0..D {
            let (e, f) = ((d + 1) % D, (d + 2) % D);
            n[d] = a[e] * b[f] - a[f] * b[e];
        }
    }
    n.normalize()
}

/// Orthonormal tangents and normals of a front of M dimensions in D = M + C dimensions.
///
/// ```
/// use meniscus::geometry::{Vector, frame::Frame};
///
/// let frame = Frame::<3, 2, 1>::from_normal(&Vector::<3>::new(0.0, 0.6, 0.8));
/// assert!(frame.tangents.iter().all(|t| t.dot(&frame.normals[0]).abs() < 1e-15));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<const D: usize, const M: usize, const C: usize> {
    /// Unit vectors along the front.
    pub tangents: [Vector<D>; M],
    /// Unit vectors orthogonal to the front.
    pub normals: [Vector<D>; C],
}

impl<const D: usize, const M: usize, const C: usize> Frame<D, M, C> {
    /// The frame of a front of D − 1 dimensions (C = 1) with the given unit normal.
    #[must_use]
    pub fn from_normal(normal: &Vector<D>) -> Self {
        Self { tangents: tangents(normal), normals: [*normal; C] }
    }

    /// The frame of a curve (M = 1) with the given unit tangent.
    #[must_use]
    pub fn from_tangent(tangent: &Vector<D>) -> Self {
        Self { tangents: [*tangent; M], normals: tangents(tangent) }
    }
}

#[cfg(test)]
mod tests {
    use super::{normal_to, tangents};
    use crate::geometry::Vector;

    #[test]
    fn a_frame_is_orthonormal_and_its_normal_comes_back() {
        for n in [Vector::<3>::new(0.0, 0.0, 1.0), Vector::<3>::new(0.36, -0.48, 0.8), Vector::<3>::new(-1.0, 0.0, 0.0)]
        {
            let frame = tangents::<3, 2>(&n);
            assert!(frame[0].dot(&frame[1]).abs() < 1e-15 && (frame[0].norm() - 1.0).abs() < 1e-15);
            assert!(frame.iter().all(|t| t.dot(&n).abs() < 1e-15));
            assert!((normal_to(&frame).dot(&n).abs() - 1.0).abs() < 1e-15);
        }
        let n = Vector::<2>::new(0.6, 0.8);
        assert!((normal_to(&tangents::<2, 1>(&n)).dot(&n).abs() - 1.0).abs() < 1e-15);
    }
}
