//! Cells that go along with the points of a moving surface: their areas follow those of the triangles about them.
//!
//! Voronoi cells do not go along: when a surface is stretched, each takes area from its neighbors. The share A_i of the surface that
//! belongs to a point is therefore that at the start times the area of its triangles now by that at the start. On a curve the
//! pieces to both neighbors take the place of triangles.

use crate::geometry::Vector;

/// Pieces of the surface between points, and the areas of cells at the start.
#[derive(Debug, Clone)]
pub(super) struct MaterialCells {
    /// Corners of triangles; of pieces of a curve the last two are the same.
    pieces: Vec<[u32; 3]>,
    /// Area of the cell of each point by that of the pieces about it.
    shares: Vec<f64>,
    /// Area of the cell of each point without pieces, which it keeps; 0 of others.
    constant: Vec<f64>,
    /// On which side of each piece the normals are at the start.
    sides: Vec<bool>,
}

/// Area of a triangle, or length of a piece of a curve.
fn measure<const D: usize>(points: &[Vector<D>], [i, j, k]: [u32; 3]) -> f64 {
    let (a, b) = (points[j as usize] - points[i as usize], points[k as usize] - points[i as usize]);
    if D == 2 {
        return a.norm();
    }
    // |a × b| = √(a² b² − (a·b)²).
    0.5 * (a.norm_squared() * b.norm_squared() - a.dot(&b).powi(2)).max(0.0).sqrt()
}

/// Whether the normals of a piece point to its left side (of a triangle: its corners run counter-clockwise about them).
fn side<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>], piece: [u32; 3]) -> bool {
    let [i, j, k] = piece.map(|corner| corner as usize);
    let normal = normals[i] + normals[j] + normals[k];
    let (a, b) = (points[j] - points[i], points[k] - points[i]);
    if D == 2 {
        return a[0] * normal[1] - a[1] * normal[0] > 0.0;
    }
    (0..D).map(|d| normal[d] * (a[(d + 1) % D] * b[(d + 2) % D] - a[(d + 2) % D] * b[(d + 1) % D])).sum::<f64>() > 0.0
}

impl MaterialCells {
    /// Cells of points with areas and pieces at the start.
    pub fn new<const D: usize>(
        (points, normals): (&[Vector<D>], &[Vector<D>]),
        areas: &[f64],
        pieces: Vec<[u32; 3]>,
    ) -> Self {
        let (shares, constant) = (vec![1.0; areas.len()], vec![0.0; areas.len()]);
        let sides = pieces.iter().map(|piece| side(points, normals, *piece)).collect();
        let mut cells = Self { pieces, shares, constant, sides };
        let about = cells.areas(points);
        cells.shares =
            areas.iter().zip(&about).map(|(area, about)| if *about > 0.0 { area / about } else { 1.0 }).collect();
        cells.constant = areas.iter().zip(&about).map(|(area, about)| if *about > 0.0 { 0.0 } else { *area }).collect();
        cells
    }

    /// The share of the pieces whose normals are on the other side now: there the surface has passed through itself.
    pub fn turned<const D: usize>(&self, points: &[Vector<D>], normals: &[Vector<D>]) -> f64 {
        let pieces = self.pieces.iter().zip(&self.sides);
        let turned = pieces.filter(|(piece, was)| side(points, normals, **piece) != **was).count();
        turned as f64 / self.pieces.len().max(1) as f64
    }

    /// Areas of the cells where the points are now.
    pub fn areas<const D: usize>(&self, points: &[Vector<D>]) -> Vec<f64> {
        let mut sums = vec![0.0; self.shares.len()];
        for piece in &self.pieces {
            let part = measure(points, *piece);
            let corners = if D == 2 { &piece[..2] } else { &piece[..] };
            corners.iter().for_each(|i| sums[*i as usize] += part);
        }
        let cells = self.shares.iter().zip(&self.constant);
        sums.iter_mut().zip(cells).for_each(|(sum, (share, constant))| *sum = *sum * share + constant);
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::MaterialCells;
    use crate::geometry::Vector;

    /// Stretched along x, every cell of a square has twice its area, whatever its neighbors.
    #[test]
    fn areas_follow_the_stretch() {
        let points: Vec<Vector<3>> =
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vector::<3>::new(x, y, 0.0)).to_vec();
        let areas = [0.3, 0.2, 0.1, 0.4];
        let normals = [Vector::<3>::z(); 4];
        let cells = MaterialCells::new((&points, &normals), &areas, vec![[0, 1, 2], [0, 2, 3]]);
        let now: Vec<Vector<3>> = points.iter().map(|x| Vector::<3>::new(2.0 * x[0], x[1], 0.0)).collect();
        for (found, area) in cells.areas(&now).iter().zip(areas) {
            assert!((found - 2.0 * area).abs() < 1e-15);
        }
        let mirrored: Vec<Vector<3>> = points.iter().map(|x| Vector::<3>::new(-x[0], x[1], x[2])).collect();
        assert_eq!((cells.turned(&now, &normals), cells.turned(&mirrored, &normals)), (0.0, 1.0));
    }
}
