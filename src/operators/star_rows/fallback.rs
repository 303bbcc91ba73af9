//! Rows of points without a bounded fit: quadratic fits with positive weights (after Seibold 2008, without linear
//! programs), then the rows of Voronoi cells.

use super::growth::with_center;
use super::{Builder, Row, RowKind, Workspace, ratio};
use crate::linear_algebra::number::LANES;
use crate::operators::basis::Basis;
use crate::operators::charts::tangent::Metric;
use crate::operators::charts::{Functional, Heights, first, second};
use crate::operators::fits::{add_terms, heights};
use crate::operators::moment_fit::MomentFit;

/// Degree of the fits.
const DEGREE: usize = 2;
/// Radius of the support in local spacings, the factor of its growth, and the number of radii that are tried.
const CUTOFF: f64 = 2.4;
const GROWTH: f64 = 1.25;
const RADII: usize = 4;
/// Fits with ever fewer neighbors at most.
const REFITS: usize = 12;
/// Least pivot ratio of a fit.
const LEAST_PIVOT: f64 = 1e-4;
/// A weight is negative below minus this share of the largest one.
const NEGATIVE: f64 = 1e-9;

/// The row of a point without a bounded fit.
pub(super) fn row<const D: usize, const M: usize>(
    builder: &Builder<'_, D, M>,
    i: usize,
    workspace: &mut Workspace<M>,
) -> Row<M> {
    let basis = Basis::<M>::new(DEGREE);
    let mut radius = CUTOFF * builder.cloud.spacings[i];
    for trial in 0..RADII {
        if let Some(row) = positive_row(builder, &basis, (i, radius), workspace) {
            return Row { is_grown: trial > 0, ..row };
        }
        radius *= GROWTH;
    }
    voronoi_row(builder, &basis, (i, radius / GROWTH), workspace)
}

/// The row of a quadratic fit. Neighbors with negative weights are dropped until there are none.
fn positive_row<const D: usize, const M: usize>(
    builder: &Builder<'_, D, M>,
    basis: &Basis<M>,
    (i, radius): (usize, f64),
    workspace: &mut Workspace<M>,
) -> Option<Row<M>> {
    let mut near = Vec::new();
    workspace.walk.gather(&builder.cloud, i, radius, &mut near);
    let slopes = workspace.walk.slopes.clone();
    for _ in 0..REFITS {
        if near.len() < basis.size() {
            return None;
        }
        let Workspace { fits, .. } = workspace;
        fits.fit.near.iter_mut().for_each(|lane| lane.clone_from(&near));
        fits.fit.slopes.iter_mut().for_each(|lane| lane.clone_from(&slopes));
        // A pivot that is no number is not large enough either.
        if fits.fit.factorize(basis)[0] > LEAST_PIVOT {
            let found = match builder.cloud.metric {
                Metric::FromHeights => heights(basis, &mut fits.fit, [radius; LANES], [true; LANES])[0],
                Metric::FromNormals => flat(),
            };
            if fits.fit.has_slopes() {
                fits.fit.factorize_with_slopes(basis);
            }
            let weights = solve(builder, basis, (i, radius, Functional::LaplaceBeltrami, &found), workspace);
            let largest = weights[..near.len()].iter().fold(0.0_f64, |most, w| most.max(w.abs()));
            let is_negative = |place: usize| weights[place] < -NEGATIVE * largest;
            if !(0..near.len()).any(is_negative) {
                let row = finish(builder, basis, (i, radius), found, workspace);
                return Some(Row {
                    kind: RowKind::Positive,
                    ratio: ratio(weights[..near.len()].iter().copied()),
                    ..row
                });
            }
            let mut place = 0;
            near.retain(|_| {
                place += 1;
                !is_negative(place - 1)
            });
        } else {
            return None;
        }
    }
    None
}

fn flat<const M: usize>() -> Heights<M> {
    Heights { first: [0.0; M], second: [[0.0; M]; M] }
}

/// Weights of a functional from the present factorization, and that of the point itself.
fn solve<const D: usize, const M: usize>(
    builder: &Builder<'_, D, M>,
    basis: &Basis<M>,
    (i, radius, functional, found): (usize, f64, Functional<M>, &Heights<M>),
    workspace: &mut Workspace<M>,
) -> Vec<f64> {
    let fits = &mut workspace.fits;
    builder.terms(functional, i, found, &mut fits.terms);
    fits.values.clear();
    fits.values.resize(basis.size(), [0.0; LANES]);
    (0..LANES).for_each(|lane| add_terms(basis, &fits.terms, radius, lane, &mut fits.values));
    fits.fit.solution.clear();
    fits.fit.solution.extend(fits.values.iter().map(|values| crate::linear_algebra::number::Lanes::new(*values)));
    fits.fit.solve();
    with_center(&fits.fit.weights[..fits.fit.near[0].len()], 0)
}

/// The rows of all functionals from the present factorization.
fn finish<const D: usize, const M: usize>(
    builder: &Builder<'_, D, M>,
    basis: &Basis<M>,
    (i, radius): (usize, f64),
    heights: Heights<M>,
    workspace: &mut Workspace<M>,
) -> Row<M> {
    let mut columns: Vec<u32> = workspace.fits.fit.near[0].iter().map(|node| node.index).collect();
    columns.push(i as u32);
    let row = |functional: &Functional<M>| solve(builder, basis, (i, radius, *functional, &heights), workspace);
    let weights = builder.functionals.iter().map(row).collect();
    Row { columns, weights, heights, kind: RowKind::Positive, is_grown: false, ratio: f64::NAN }
}

/// The row (ℓ_ij − δ_ij Σ ℓ)/A_i of the cell of a point. Gradients and heights come from a quadratic fit without regard to its
/// rank: they are smooth, but of no order.
fn voronoi_row<const D: usize, const M: usize>(
    builder: &Builder<'_, D, M>,
    basis: &Basis<M>,
    (i, radius): (usize, f64),
    workspace: &mut Workspace<M>,
) -> Row<M> {
    let graph = builder.cloud.graph;
    let mut near = Vec::new();
    workspace.walk.gather(&builder.cloud, i, radius, &mut near);
    workspace.fits.fit.near.iter_mut().for_each(|lane| lane.clone_from(&near));
    workspace.fits.fit.factorize(basis);
    let partials = |alpha: [u8; M], fit: &mut MomentFit<M>| {
        let mut values = vec![[0.0; LANES]; basis.size()];
        add_terms(basis, &[(alpha, 1.0)], radius, 0, &mut values);
        let functional: Vec<f64> = values.iter().map(|value| value[0]).collect();
        fit.solve_low_rank(0, &functional);
        fit.weights[..near.len()].iter().map(|w| w.as_array()[0]).collect::<Vec<f64>>()
    };
    let fit = &mut workspace.fits.fit;
    let slopes: [Vec<f64>; M] = std::array::from_fn(|a| partials(first(a), fit));
    let bends: [[Vec<f64>; M]; M] = std::array::from_fn(|a| std::array::from_fn(|b| partials(second(a, b), fit)));
    // Heights of the nodes are divided by the radius.
    let applied = |weights: &[f64]| weights.iter().zip(&near).map(|(w, node)| w * node.height * radius).sum::<f64>();
    let heights = Heights {
        first: std::array::from_fn(|a| applied(&slopes[a])),
        second: std::array::from_fn(|a| std::array::from_fn(|b| applied(&bends[a][b]))),
    };
    // The columns of both: those of the cell, then those of the fit, then the point itself.
    let cell = graph.neighbors(i);
    let columns = cell.iter().copied().chain(near.iter().map(|node| node.index)).chain([i as u32]).collect();
    let mut weights = Vec::with_capacity(builder.functionals.len());
    for functional in builder.functionals {
        let mut row: Vec<f64> = match functional {
            Functional::LaplaceBeltrami => {
                let flows = graph.conductances(i).iter().map(|conductance| conductance / graph.areas[i]);
                flows.chain(near.iter().map(|_| 0.0)).collect()
            }
            other => {
                builder.terms(*other, i, &heights, &mut workspace.fits.terms);
                let mut sum = vec![0.0; cell.len() + near.len()];
                for (alpha, coefficient) in &workspace.fits.terms {
                    let weights = partials(*alpha, &mut workspace.fits.fit);
                    let place = sum[cell.len()..].iter_mut().zip(weights);
                    place.for_each(|(sum, w)| *sum += coefficient * w);
                }
                sum
            }
        };
        row.push(-row.iter().sum::<f64>());
        weights.push(row);
    }
    Row { columns, weights, heights, kind: RowKind::Voronoi, is_grown: false, ratio: 1.0 }
}
