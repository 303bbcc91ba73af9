//! Linear maps under which stretched particles lie as densely in every direction, one particle to a unit of volume.

use crate::geometry::Vector;
use crate::neighbors::{CellList, Neighbor, NeighborSearch};
use nalgebra::{Matrix3, SMatrix};

/// A linear map X = A x and its inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalMap<const D: usize> {
    /// The symmetric matrix A.
    pub map: SMatrix<f64, D, D>,
    /// The inverse A⁻¹.
    pub inverse: SMatrix<f64, D, D>,
    /// Longest semi-axis of the ellipsoid ‖A x‖ = 1: the spacing of particles in the direction of the stretch.
    pub longest: f64,
    /// Shortest semi-axis of the ellipsoid.
    pub shortest: f64,
}

impl<const D: usize> LocalMap<D> {
    /// The map of particles of a spacing that is the same in every direction.
    #[must_use]
    pub fn even(spacing: f64) -> Self {
        let identity = SMatrix::<f64, D, D>::identity();
        Self { map: identity / spacing, inverse: identity * spacing, longest: spacing, shortest: spacing }
    }

    /// The symmetric map with the metric AᵀA; None where it is not positive definite.
    #[must_use]
    pub fn from_metric(metric: &SMatrix<f64, D, D>) -> Option<Self> {
        let (least, most) = range_of_eigenvalues(metric);
        if !(least > 0.0 && most.is_finite()) {
            return None;
        }
        let map = spectral(metric, f64::sqrt);
        let inverse = spectral(metric, |value| 1.0 / value.sqrt());
        Some(Self { map, inverse, longest: 1.0 / least.sqrt(), shortest: 1.0 / most.sqrt() })
    }

    /// The longest axis by the shortest.
    #[must_use]
    pub fn stretch(&self) -> f64 {
        self.longest / self.shortest
    }

    /// The map of a cloud that is `factor` times as coarse.
    #[must_use]
    pub fn coarser(&self, factor: f64) -> Self {
        Self {
            map: self.map / factor,
            inverse: self.inverse * factor,
            longest: self.longest * factor,
            shortest: self.shortest * factor,
        }
    }
}

/// The matrix with the eigenvectors of a symmetric matrix and a function of its eigenvalues.
#[must_use]
pub fn spectral<const D: usize>(matrix: &SMatrix<f64, D, D>, function: impl Fn(f64) -> f64) -> SMatrix<f64, D, D> {
    let eigen = embedded(matrix).symmetric_eigen();
    let values = eigen.eigenvalues.map(function);
    let found = eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose();
    SMatrix::<f64, D, D>::from_fn(|d, e| found[(d, e)])
}

/// The smallest and the largest eigenvalue of a symmetric matrix.
#[must_use]
pub fn range_of_eigenvalues<const D: usize>(matrix: &SMatrix<f64, D, D>) -> (f64, f64) {
    let values = embedded(matrix).symmetric_eigenvalues();
    (values.min(), values.max())
}

/// The determinant of a symmetric matrix.
#[must_use]
pub fn determinant<const D: usize>(matrix: &SMatrix<f64, D, D>) -> f64 {
    let mean = matrix.trace() / D as f64;
    embedded(matrix).determinant() / mean.powi(3 - D as i32)
}

/// The matrix in three dimensions, with the mean of its eigenvalues along axes that it does not have.
fn embedded<const D: usize>(matrix: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    let mean = matrix.trace() / D as f64;
    Matrix3::from_fn(|d, e| {
        if d < D && e < D {
            0.5 * (matrix[(d, e)] + matrix[(e, d)])
        } else if d == e {
            mean
        } else {
            0.0
        }
    })
}

/// A search in the coordinates X = A x over particles that are sorted in space.
pub struct MappedSearch<'a, const D: usize> {
    /// The particles in space.
    pub cells: &'a CellList<D>,
    /// The map.
    pub map: &'a LocalMap<D>,
}

impl<const D: usize> NeighborSearch<D> for MappedSearch<'_, D> {
    fn for_each_within(&self, x: &Vector<D>, radius: f64, mut visit: impl FnMut(usize, &Vector<D>, f64)) {
        let place = self.map.inverse * x;
        let limit = radius * radius;
        // The slack covers the rounding of the axes.
        self.cells.for_each_within(&place, radius * self.map.longest * (1.0 + 1e-9), |j, dx, _| {
            let dx = self.map.map * dx;
            let r2 = dx.norm_squared();
            if r2 <= limit {
                visit(j, &dx, r2);
            }
        });
    }

    fn gather(&self, x: &Vector<D>, radius: f64, found: &mut Vec<Neighbor<D>>) {
        found.clear();
        self.for_each_within(x, radius, |index, dx, r2| found.push(Neighbor { r2, index, dx: *dx }));
    }

    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        self.for_each_within(x, cutoff, |j, _, r2| {
            if best.is_none_or(|(index, least)| r2 < least || r2 <= least && j < index) {
                best = Some((j, r2));
            }
        });
        best.map(|(j, r2)| (j, r2.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::{LocalMap, MappedSearch, SMatrix, Vector};
    use crate::geometry::Domain;
    use crate::neighbors::{CellList, NeighborSearch};

    #[test]
    fn a_map_has_the_axes_of_its_metric() {
        // Axes of length 2 along (3, 4)/5 and 0.5 across.
        let (u, v) = (Vector::<2>::new(0.6, 0.8), Vector::<2>::new(-0.8, 0.6));
        let metric = u * u.transpose() / 4.0 + v * v.transpose() * 4.0;
        let map = LocalMap::from_metric(&metric).unwrap();
        assert!((map.longest - 2.0).abs() < 1e-14 && (map.shortest - 0.5).abs() < 1e-14);
        assert!(((map.map * u).norm() - 0.5).abs() < 1e-14 && ((map.map * v).norm() - 2.0).abs() < 1e-14);
        assert!((map.map * map.inverse - SMatrix::<f64, 2, 2>::identity()).norm() < 1e-14);
        assert!(LocalMap::from_metric(&(u * u.transpose())).is_none_or(|map| map.stretch() > 1e6));
        assert!((map.coarser(3.0).longest - 6.0).abs() < 1e-14);
    }

    #[test]
    fn a_mapped_search_finds_what_lies_in_the_ellipsoid() {
        let points: Vec<Vector<3>> = (0..1000)
            .map(|k| Vector::<3>::new((k % 10) as f64, (k / 10 % 10) as f64 * 0.3, (k / 100) as f64 * 0.1))
            .collect();
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.7);
        let metric = SMatrix::<f64, 3, 3>::from_diagonal(&Vector::<3>::new(1.0, 1.0 / 0.09, 100.0));
        let map = LocalMap::from_metric(&metric).unwrap();
        let mut found = Vec::new();
        MappedSearch { cells: &cells, map: &map }.gather(&(map.map * points[555]), 1.2, &mut found);
        // The particle and one to either side along each axis.
        assert_eq!(found.len(), 7);
        assert_eq!(MappedSearch { cells: &cells, map: &map }.nearest(&(map.map * points[555]), 1.0).unwrap().0, 555);
    }
}
