//! Fits of one degree, four points at once, whose supports grow until their rows are bounded.

use super::{Builder, MOST_RATIO, Row, RowKind, StarSupport, Workspace as BlockWorkspace, ratio};
use crate::linear_algebra::number::{LANES, Lanes};
use crate::operators::basis::Basis;
use crate::operators::charts::tangent::Metric;
use crate::operators::charts::{Functional, Heights};
use crate::operators::fits::{MAX_GROWTH, MIN_PIVOT, NEIGHBORS_PER_FUNCTION, add_terms, heights};
use crate::operators::moment_fit::MomentFit;

/// Factor of one growth of a support.
const GROWTH: f64 = 1.15;

/// Fits of one degree.
pub(super) struct GrowingFits<const M: usize> {
    basis: Basis<M>,
    cutoff: f64,
    /// Neighbors wanted at least.
    wanted: usize,
}

/// Workspace of a thread.
#[derive(Default)]
pub(super) struct Workspace<const M: usize> {
    pub fit: MomentFit<M>,
    pub terms: Vec<([u8; M], f64)>,
    /// Values of a functional for the basis functions, in each lane.
    pub values: Vec<[f64; LANES]>,
}

/// A point in a lane, with the radius of its support by that at first.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    point: usize,
    growth: f64,
    /// Whether its row must be bounded.
    is_bounded: bool,
}

impl<const M: usize> GrowingFits<M> {
    pub fn new(support: StarSupport) -> Self {
        let basis = Basis::new(support.degree);
        let wanted = (NEIGHBORS_PER_FUNCTION * basis.size() as f64).ceil() as usize;
        Self { basis, cutoff: support.cutoff, wanted }
    }

    /// Passes on the rows of all points that get a bounded one.
    ///
    /// A lane takes the next point when its point has a row or has reached the largest support.
    pub fn rows<const D: usize>(
        &self,
        builder: &Builder<'_, D, M>,
        points: &[usize],
        workspace: &mut BlockWorkspace<M>,
        mut take: impl FnMut(usize, Row<M>),
    ) {
        let mut open = points.iter().copied();
        let mut lanes: [Option<Candidate>; LANES] = [None; LANES];
        loop {
            for (lane, place) in lanes.iter_mut().enumerate() {
                while place.is_none() {
                    let Some(point) = open.next() else { break };
                    *place = self.gather(builder, Candidate { point, growth: 1.0, is_bounded: true }, lane, workspace);
                }
            }
            let Some(full) = lanes.iter().position(Option::is_some) else { return };
            for lane in (0..LANES).filter(|lane| lanes[*lane].is_none()) {
                // Spare lanes repeat one with a point.
                let fit = &mut workspace.fits.fit;
                (fit.near[lane], fit.slopes[lane]) = (fit.near[full].clone(), fit.slopes[full].clone());
            }
            let shared = lanes.map(|lane| lane.or(lanes[full]));
            self.solve(builder, shared, &mut lanes, workspace, &mut take);
            for (lane, place) in lanes.iter_mut().enumerate() {
                if let Some(Candidate { point, growth, .. }) = *place {
                    *place = self.gather(
                        builder,
                        Candidate { point, growth: growth * GROWTH, is_bounded: true },
                        lane,
                        workspace,
                    );
                }
            }
        }
    }

    /// Collects the neighbors of a point, with a support that grows until there are enough of them; None at the largest
    /// support.
    fn gather<const D: usize>(
        &self,
        builder: &Builder<'_, D, M>,
        candidate: Candidate,
        lane: usize,
        workspace: &mut BlockWorkspace<M>,
    ) -> Option<Candidate> {
        let Candidate { point, mut growth, .. } = candidate;
        let BlockWorkspace { walk, fits, .. } = workspace;
        let near = &mut fits.fit.near[lane];
        while growth <= MAX_GROWTH {
            let radius = growth * self.cutoff * builder.cloud.spacings[point];
            walk.gather(&builder.cloud, point, radius, near);
            if near.len() >= self.wanted {
                fits.fit.slopes[lane].clone_from(&walk.slopes);
                return Some(Candidate { point, growth, is_bounded: walk.is_bounded });
            }
            growth *= GROWTH;
        }
        None
    }

    fn radius<const D: usize>(&self, builder: &Builder<'_, D, M>, candidate: Candidate) -> f64 {
        candidate.growth * self.cutoff * builder.cloud.spacings[candidate.point]
    }

    /// Fits all lanes, passes on the bounded rows and empties their lanes.
    fn solve<const D: usize>(
        &self,
        builder: &Builder<'_, D, M>,
        shared: [Option<Candidate>; LANES],
        lanes: &mut [Option<Candidate>; LANES],
        workspace: &mut BlockWorkspace<M>,
        take: &mut impl FnMut(usize, Row<M>),
    ) {
        let workspace = &mut workspace.fits;
        let pivots = workspace.fit.factorize(&self.basis);
        let mut sound = pivots.map(|pivot| pivot > MIN_PIVOT);
        let radius = shared.map(|lane| lane.map_or(1.0, |candidate| self.radius(builder, candidate)));
        let flat = Heights { first: [0.0; M], second: [[0.0; M]; M] };
        let heights = match builder.cloud.metric {
            Metric::FromHeights => heights(&self.basis, &mut workspace.fit, radius, sound),
            Metric::FromNormals => [flat; LANES],
        };
        if workspace.fit.has_slopes() {
            // Heights keep to no condition, so that they were fitted before.
            let pivots = workspace.fit.factorize_with_slopes(&self.basis);
            sound.iter_mut().zip(pivots).for_each(|(sound, pivot)| *sound &= pivot > MIN_PIVOT);
        }
        let at = |lane: usize| shared[lane].map_or(0, |candidate| candidate.point);
        self.weigh(builder, Functional::LaplaceBeltrami, (at, &heights, radius), workspace);
        let ratios: [f64; LANES] = std::array::from_fn(|lane| {
            let weights = &workspace.fit.weights[..workspace.fit.near[lane].len()];
            ratio(weights.iter().map(|w| w.as_array()[lane]))
        });
        let is_bounded = |lane: usize| lanes[lane].is_none_or(|candidate| candidate.is_bounded);
        let taken: [bool; LANES] =
            std::array::from_fn(|lane| sound[lane] && (ratios[lane] <= MOST_RATIO || !is_bounded(lane)));
        let mut rows: [Option<Row<M>>; LANES] = std::array::from_fn(|lane| {
            let candidate = lanes[lane].filter(|_| taken[lane])?;
            let near = &workspace.fit.near[lane];
            let mut columns: Vec<u32> = near.iter().map(|node| node.index).collect();
            columns.push(candidate.point as u32);
            let is_grown = candidate.growth > 1.0;
            let weights = Vec::with_capacity(builder.functionals.len());
            let ratio = if candidate.is_bounded { ratios[lane] } else { f64::NAN };
            Some(Row { columns, weights, heights: heights[lane], kind: RowKind::Full, is_grown, ratio })
        });
        if rows.iter().all(Option::is_none) {
            return;
        }
        for functional in builder.functionals {
            if builder.functionals.len() > 1 || *functional != Functional::LaplaceBeltrami {
                self.weigh(builder, *functional, (at, &heights, radius), workspace);
            }
            for (lane, row) in rows.iter_mut().enumerate() {
                let Some(row) = row else { continue };
                row.weights.push(with_center(&workspace.fit.weights[..workspace.fit.near[lane].len()], lane));
            }
        }
        for (lane, row) in rows.into_iter().enumerate() {
            if let (Some(row), Some(candidate)) = (row, lanes[lane]) {
                take(candidate.point, row);
                lanes[lane] = None;
            }
        }
    }

    /// Computes the weights of a functional in all lanes.
    fn weigh<const D: usize>(
        &self,
        builder: &Builder<'_, D, M>,
        functional: Functional<M>,
        (at, heights, radius): (impl Fn(usize) -> usize, &[Heights<M>; LANES], [f64; LANES]),
        workspace: &mut Workspace<M>,
    ) {
        workspace.values.clear();
        workspace.values.resize(self.basis.size(), [0.0; LANES]);
        for lane in 0..LANES {
            builder.terms(functional, at(lane), &heights[lane], &mut workspace.terms);
            add_terms(&self.basis, &workspace.terms, radius[lane], lane, &mut workspace.values);
        }
        workspace.fit.solution.clear();
        workspace.fit.solution.extend(workspace.values.iter().map(|values| Lanes::new(*values)));
        workspace.fit.solve();
    }
}

/// The weights of a lane, and that of the point itself with which the row sums to zero.
pub(super) fn with_center(weights: &[Lanes], lane: usize) -> Vec<f64> {
    let mut row: Vec<f64> = weights.iter().map(|w| w.as_array()[lane]).collect();
    row.push(-row.iter().sum::<f64>());
    row
}
