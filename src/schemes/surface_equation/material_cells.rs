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

impl MaterialCells {
    /// Cells of points with areas and pieces at the start.
    pub fn new<const D: usize>(points: &[Vector<D>], areas: &[f64], pieces: Vec<[u32; 3]>) -> Self {
        let mut cells = Self { pieces, shares: vec![1.0; areas.len()] };
        let about = cells.areas(points);
        cells.shares =
            areas.iter().zip(&about).map(|(area, about)| if *about > 0.0 { area / about } else { 1.0 }).collect();
        cells
    }

    /// Areas of the cells where the points are now.
    pub fn areas<const D: usize>(&self, points: &[Vector<D>]) -> Vec<f64> {
        let mut sums = vec![0.0; self.shares.len()];
        for piece in &self.pieces {
            let part = measure(points, *piece);
            let corners = if D == 2 { &piece[..2] } else { &piece[..] };
            corners.iter().for_each(|i| sums[*i as usize] += part);
        }
        sums.iter_mut().zip(&self.shares).for_each(|(sum, share)| *sum *= share);
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
        let cells = MaterialCells::new(&points, &areas, vec![[0, 1, 2], [0, 2, 3]]);
        let now: Vec<Vector<3>> = points.iter().map(|x| Vector::<3>::new(2.0 * x[0], x[1], 0.0)).collect();
        for (found, area) in cells.areas(&now).iter().zip(areas) {
            assert!((found - 2.0 * area).abs() < 1e-15);
        }
    }
}
