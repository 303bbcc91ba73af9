//! Frames of a hyperplane: unit vectors across a normal, and the normal across given vectors; and those of a front, which may be
//! a curve in space.

use super::Vector;

/// Unit vectors across a unit normal and each other, M = D − 1 of them.
#[must_use]
pub fn tangents<const D: usize, const M: usize>(n: &Vector<D>) -> [Vector<D>; M] {
    // Of the axes the one that is farthest from the normal, then what is across both.
    let mut found = [Vector::<D>::zeros(); M];
    for a in 0..M {
        let rest = |d: usize| {
            let mut e = Vector::<D>::zeros();
            e[d] = 1.0;
            let mut e = e - n * n[d];
            for t in &found[..a] {
                e -= t * t[d];
            }
            e
        };
        let longest = (0..D).map(|d| (d, rest(d).norm_squared()));
        let (axis, _) = longest.fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best });
        found[a] = rest(axis).normalize();
    }
    found
}

/// The unit vector across D − 1 independent vectors, right-handed with them: in the plane the vector turned clockwise, in
/// space the cross product.
#[must_use]
pub fn across<const D: usize, const M: usize>(tangents: &[Vector<D>; M]) -> Vector<D> {
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

/// Unit vectors along a front of M dimensions, and those across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<const D: usize, const M: usize, const C: usize> {
    /// Tangents.
    pub along: [Vector<D>; M],
    /// Normals.
    pub across: [Vector<D>; C],
}

/// The frame of a front of D − 1 dimensions by its normal.
#[must_use]
pub fn about_normal<const D: usize, const M: usize, const C: usize>(normal: &Vector<D>) -> Frame<D, M, C> {
    Frame { along: tangents(normal), across: [*normal; C] }
}

/// The frame of a curve by its tangent.
#[must_use]
pub fn about_tangent<const D: usize, const M: usize, const C: usize>(tangent: &Vector<D>) -> Frame<D, M, C> {
    Frame { along: [*tangent; M], across: tangents(tangent) }
}

#[cfg(test)]
mod tests {
    use super::{across, tangents};
    use crate::geometry::Vector;

    #[test]
    fn a_frame_is_orthonormal_and_its_normal_comes_back() {
        for n in [Vector::<3>::new(0.0, 0.0, 1.0), Vector::<3>::new(0.36, -0.48, 0.8), Vector::<3>::new(-1.0, 0.0, 0.0)]
        {
            let frame = tangents::<3, 2>(&n);
            assert!(frame[0].dot(&frame[1]).abs() < 1e-15 && (frame[0].norm() - 1.0).abs() < 1e-15);
            assert!(frame.iter().all(|t| t.dot(&n).abs() < 1e-15));
            assert!((across(&frame).dot(&n).abs() - 1.0).abs() < 1e-15);
        }
        let n = Vector::<2>::new(0.6, 0.8);
        assert!((across(&tangents::<2, 1>(&n)).dot(&n).abs() - 1.0).abs() < 1e-15);
    }
}
