//! The volume within the zero of a smooth level in space.
//!
//! Marching tetrahedra make a closed surface of triangles. Each point y of a triangle stands for the closest point P(y) of
//! the zero. Images of neighboring triangles share their sides, so V = ⅓ ∮ P · n dS = ⅓ Σ ∫∫ P · (∂P/∂u × ∂P/∂v) du dv is exact
//! up to the quadrature, Gauss's on each triangle.

use super::Vector;
use super::newton::{local_foot, project};
use crate::geometry::block::indices;
use crate::geometry::level::{Hessian, LevelFunction};
use nalgebra::{Matrix3, Vector3};

/// Cells along the longest side of the box.
const CELLS: f64 = 20.0;
/// Gauss–Legendre points and weights on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];
/// The six tetrahedra of a cube, as corners: bit d of a corner says whether it lies at the upper end of axis d.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The volume where a level is negative, in a box that contains its zero, up to its sign.
pub(in crate::geometry::surfaces) fn curved_volume<const D: usize>(
    level: &dyn LevelFunction<D>,
    low: &Vector<D>,
    high: &Vector<D>,
) -> f64 {
    if D != 3 {
        return f64::NAN;
    }
    let edge = (high - low).max() / CELLS;
    // The box of the zero with a cell around; off the lattices that shapes of round numbers are made on.
    let first = low.add_scalar(-1.137 * edge);
    let counts: [usize; D] = std::array::from_fn(|d| ((high[d] - low[d]) / edge + 2.5).ceil() as usize);
    let nodes: [usize; D] = counts.map(|count| count + 1);
    let strides: [usize; D] = std::array::from_fn(|d| nodes[..d].iter().product());
    let place = |k: usize| Vector::<D>::from_fn(|d, _| first[d] + (k / strides[d] % nodes[d]) as f64 * edge);
    let points: Vec<Vector<D>> = (0..nodes.iter().product()).map(place).collect();
    let mut values = vec![0.0; points.len()];
    level.values(&points, &mut values);
    let origin = (low + high) * 0.5;
    let mut volume = 0.0;
    for k in 0..counts.iter().product::<usize>() {
        let at = indices(k, &counts);
        let corner = |c: usize| (0..D).map(|d| (at[d] + (c >> d & 1)) * strides[d]).sum::<usize>();
        for tetrahedron in &TETRAHEDRA {
            let corners = tetrahedron.map(|c| (points[corner(c)], values[corner(c)]));
            for triangle in triangles(&corners) {
                volume += patch_volume(level, &triangle, edge, &origin);
            }
        }
    }
    volume
}

/// The triangles of the zero of the linear interpolant in a tetrahedron, with their normals toward positive values.
fn triangles<const D: usize>(corners: &[(Vector<D>, f64); 4]) -> Vec<[Vector<D>; 3]> {
    let is_in = |k: &usize| corners[*k].1 < 0.0;
    let inner: Vec<usize> = (0..4).filter(is_in).collect();
    let outer: Vec<usize> = (0..4).filter(|k| !is_in(k)).collect();
    let crossing = |a: usize, b: usize| {
        // In one order, so that neighbors find the same point.
        let (a, b) = (a.min(b), a.max(b));
        let ((x, f), (y, g)) = (corners[a], corners[b]);
        x + (y - x) * (f / (f - g))
    };
    let mut found: Vec<[Vector<D>; 3]> = match (&inner[..], &outer[..]) {
        ([a], [b, c, d]) | ([b, c, d], [a]) => vec![[crossing(*a, *b), crossing(*a, *c), crossing(*a, *d)]],
        ([a, b], [c, d]) => {
            let (ac, ad, bc, bd) = (crossing(*a, *c), crossing(*a, *d), crossing(*b, *c), crossing(*b, *d));
            vec![[ac, ad, bd], [ac, bd, bc]]
        }
        _ => return Vec::new(),
    };
    let mean = |of: &[usize]| of.iter().map(|k| corners[*k].0).sum::<Vector<D>>() / of.len() as f64;
    let outward = mean(&outer) - mean(&inner);
    for triangle in &mut found {
        if (triangle[1] - triangle[0]).cross(&(triangle[2] - triangle[0])).dot(&outward) < 0.0 {
            triangle.swap(1, 2);
        }
    }
    found
}

/// ⅓ ∫ P · n dS over the part of the zero that a triangle stands for, with P from `origin`.
fn patch_volume<const D: usize>(
    level: &dyn LevelFunction<D>,
    triangle: &[Vector<D>; 3],
    reach: f64,
    origin: &Vector<D>,
) -> f64 {
    let (u, v) = (triangle[1] - triangle[0], triangle[2] - triangle[0]);
    let mut sum = 0.0;
    for (s, weight) in GAUSS {
        for (t, other) in GAUSS {
            // Duffy's coordinates: (s, (1 − s) t) with the area 1 − s.
            let y = triangle[0] + u * s + v * ((1.0 - s) * t);
            let (p, p_u, p_v) = image(level, &y, [&u, &v], reach);
            sum += weight * other * (1.0 - s) * (p - origin).dot(&p_u.cross(&p_v));
        }
    }
    sum / 3.0
}

/// The closest point P(y) of the zero and its derivatives along two directions.
///
/// With the distance d, the normal n and the shape tensor S = (1 − nnᵀ) H (1 − nnᵀ)/|∇f| at the foot, the derivative is
/// (1 + d S)⁻¹ (1 − nnᵀ).
fn image<const D: usize>(
    level: &dyn LevelFunction<D>,
    y: &Vector<D>,
    [u, v]: [&Vector<D>; 2],
    reach: f64,
) -> (Vector<D>, Vector<D>, Vector<D>) {
    let start = project(level, y, reach).unwrap_or(*y);
    let Some(foot) = local_foot(&[level], y, &start, reach) else { return (start, *u, *v) };
    let jet = level.jet(&foot.point);
    let normal = jet.normal();
    let tangential = Hessian::<D>::identity() - normal * normal.transpose();
    let shape = tangential * jet.hessian * tangential / jet.gradient.norm();
    let stretch = Hessian::<D>::identity() + shape * normal.dot(&(y - foot.point));
    let along = |w: &Vector<D>| solve(&stretch, &(tangential * w));
    (foot.point, along(u), along(v))
}

/// The solution of a system in space; the right side where it is singular.
fn solve<const D: usize>(matrix: &Hessian<D>, right: &Vector<D>) -> Vector<D> {
    let (matrix, right) = (Matrix3::from_fn(|i, j| matrix[(i, j)]), Vector3::from_fn(|i, _| right[i]));
    let found = matrix.lu().solve(&right).unwrap_or(right);
    Vector::<D>::from_fn(|d, _| found[d])
}
