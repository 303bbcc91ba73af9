//! The conservative form of Δ_S: exchange between Voronoi cells in the tangent planes.
//!
//! (Δ_S u)_i = (1/A_i) Σ_j ℓ_ij (u_j − u_i), with the conductances and areas of the graph of stars. The matrix is symmetric in
//! the product of areas, and no weight of a neighbor is negative. So no mode grows, a diffusing field stays within its bounds,
//! and Σ A_i u_i is kept to rounding. Its rows are not consistent point by point, but solutions have second order.

use crate::linear_algebra::SparseRows;
use crate::linear_algebra::mean_term::MeanTerm;
use crate::point_clouds::StarGraph;

/// The rows of the operator, columns ascending.
pub(super) fn rows(graph: &StarGraph) -> SparseRows {
    let mut rows = SparseRows::default();
    let (mut columns, mut weights) = (Vec::new(), Vec::new());
    for i in 0..graph.len() {
        columns.clear();
        weights.clear();
        let inverse = 1.0 / graph.areas[i];
        let own: f64 = graph.conductances(i).iter().sum();
        for (j, conductance) in graph.neighbors(i).iter().zip(graph.conductances(i)) {
            if *j as usize > i && columns.last().is_none_or(|last| (*last as usize) < i) {
                columns.push(i as u32);
                weights.push(-own * inverse);
            }
            columns.push(*j);
            weights.push(conductance * inverse);
        }
        if columns.last().is_none_or(|last| (*last as usize) < i) {
            columns.push(i as u32);
            weights.push(-own * inverse);
        }
        rows.push_row(&columns, &weights);
    }
    rows
}

/// The symmetric matrix diag(own) + exchange · Σ ℓ_ij (x_i − x_j), columns ascending. Rows and columns of held points are those of
/// the identity.
pub(super) fn exchange_matrix(
    graph: &StarGraph,
    own: impl Fn(usize) -> f64,
    exchange: f64,
    is_held: impl Fn(usize) -> bool,
) -> SparseRows {
    let mut rows = SparseRows::default();
    let (mut columns, mut weights) = (Vec::new(), Vec::new());
    for i in 0..graph.len() {
        columns.clear();
        weights.clear();
        columns.push(i as u32);
        weights.push(1.0);
        if !is_held(i) {
            weights[0] = own(i);
            for (j, conductance) in graph.neighbors(i).iter().zip(graph.conductances(i)) {
                weights[0] += exchange * conductance;
                if !is_held(*j as usize) {
                    columns.push(*j);
                    weights.push(-exchange * conductance);
                }
            }
        }
        rows.push_row(&columns, &weights);
    }
    rows.sorted()
}

/// Gives back to each part what a solver left of Σ A u = Σ right, evenly: exchange between points cancels. `left` is a buffer.
pub(super) fn keep_integrals(
    graph: &StarGraph,
    areas: &[f64],
    right: &[f64],
    values: &mut [f64],
    left: &mut Vec<[f64; 2]>,
) {
    left.clear();
    left.resize(graph.part_count, [0.0; 2]);
    for (((part, area), value), right) in graph.parts.iter().zip(areas).zip(values.iter()).zip(right) {
        let [defect, whole] = &mut left[*part as usize];
        (*defect, *whole) = (*defect + right - area * value, *whole + area);
    }
    for (value, part) in values.iter_mut().zip(&graph.parts) {
        let [defect, whole] = left[*part as usize];
        // A part without an area holds nothing.
        *value += if whole > 0.0 { defect / whole } else { 0.0 };
    }
}

/// The term that makes Δ_S regular on every part of a cloud: area means, with α about the least eigenvalue of a sphere of
/// the same area, −8π/A, or of a circle of the same length, −(2π/L)².
pub(super) fn mean_term(graph: &StarGraph, dimension: usize) -> MeanTerm {
    let mut areas = vec![0.0; graph.part_count];
    graph.parts.iter().zip(&graph.areas).for_each(|(part, area)| areas[*part as usize] += area);
    let alpha = |area: &f64| {
        if dimension == 2 { -(std::f64::consts::TAU / area).powi(2) } else { -8.0 * std::f64::consts::PI / area }
    };
    MeanTerm::new(graph.parts.clone(), graph.areas.clone(), areas.iter().map(alpha).collect())
}

#[cfg(test)]
mod tests {
    use super::{mean_term, rows};
    use crate::geometry::fibonacci;
    use crate::point_clouds::PreparedCloud;
    use crate::point_clouds::cleaning::Cleaning;

    #[test]
    fn the_operator_is_symmetric_in_areas_and_conserves() {
        let found = PreparedCloud::new(&fibonacci::sphere(500), None, Cleaning::Drop).unwrap();
        let rows = rows(&found.graph);
        let areas = &found.graph.areas;
        let entry = |i: usize, j: usize| {
            let (columns, weights) = rows.row(i);
            columns.binary_search(&(j as u32)).map_or(0.0, |place| areas[i] * weights[place])
        };
        for i in 0..500 {
            for j in rows.row(i).0 {
                let j = *j as usize;
                assert!((entry(i, j) - entry(j, i)).abs() < 1e-13);
                assert!(i == j || entry(i, j) >= 0.0);
            }
        }
        let field: Vec<f64> = found.points.iter().map(|x| x[2] + x[0] * x[1]).collect();
        let mut applied = vec![0.0; 500];
        rows.apply(&field, &mut applied);
        let change: f64 = applied.iter().zip(areas).map(|(value, area)| value * area).sum();
        assert!(change.abs() < 1e-13, "{change}");
        let term = mean_term(&found.graph, 3);
        assert!((term.alpha()[0] + 2.0).abs() < 1e-2 && (term.means(&[3.0; 500])[0] - 3.0).abs() < 1e-12);
    }
}
