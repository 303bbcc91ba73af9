//! The fits of a chart, four points at once, with their fallbacks.
//!
//! A support with too few neighbors, or with a rank-deficient moment matrix, grows. If that does not help, all points
//! on the same side are accepted, and the moment conditions are solved by a rank-revealing decomposition. The weights
//! are used if the conditions hold. Every fallback is counted.

use super::basis::Basis;
use super::charts::{Chart, Functional, Heights, Node, first, second};
use super::moment_fit::MomentFit;
use crate::linear_algebra::number::{LANES, Lanes};
use crate::parallel::Interrupt;
use std::ops::Range;

/// Degree of the polynomials and radius of the support of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Total degree of the polynomials, at most 7.
    pub degree: usize,
    /// Nominal radius r_c of the support, a length.
    pub radius: f64,
}

/// Numbers of fallbacks and failures of fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupportDiagnostics {
    /// Number of enlargements of supports.
    pub enlarged: u64,
    /// Points whose moment conditions were solved by the rank-revealing decomposition.
    pub low_rank: u64,
    /// Points with neighbors whose normals differ by more than 60°, because the surface is too coarse there.
    pub unresolved: u64,
    /// Points whose moment conditions cannot be met, so that their rows give NaN.
    pub failed: u64,
    /// Index of the first failed point.
    pub first_failed: Option<usize>,
    /// Smallest pivot ratio of the points that were solved directly.
    pub min_pivot: f64,
}

impl Default for SupportDiagnostics {
    /// The diagnostics before any fit.
    fn default() -> Self {
        Self { enlarged: 0, low_rank: 0, unresolved: 0, failed: 0, first_failed: None, min_pivot: 1.0 }
    }
}

impl SupportDiagnostics {
    /// Number of fallbacks of any kind that gave a result.
    #[must_use]
    pub fn rescued(&self) -> u64 {
        self.enlarged + self.low_rank + self.unresolved
    }

    /// Adds the diagnostics of other fits.
    pub fn add(&mut self, other: &Self) {
        self.enlarged += other.enlarged;
        self.low_rank += other.low_rank;
        self.unresolved += other.unresolved;
        self.failed += other.failed;
        self.first_failed = [self.first_failed, other.first_failed].into_iter().flatten().min();
        self.min_pivot = self.min_pivot.min(other.min_pivot);
    }
}

/// Smallest number of neighbors per basis function. With fewer, a fit interpolates noise.
pub(super) const NEIGHBORS_PER_FUNCTION: f64 = 1.4;
/// Factor of one enlargement of a support.
const GROWTH: f64 = 1.2;
/// Largest support radius, in multiples of the nominal radius.
pub const MAX_GROWTH: f64 = 2.5;
/// Smallest pivot ratio with which the moment conditions hold to enough digits.
pub(super) const MIN_PIVOT: f64 = 1e-9;
/// Largest violation of the moment conditions by a rank-revealing solution, relative to the largest value of the
/// functional.
const MAX_MOMENT_VIOLATION: f64 = 1e-6;
/// Number of points of a parallel task, a multiple of the lanes.
pub(super) const BLOCK: usize = 64;

/// Receiver of the weights of fits.
pub(super) trait RowSink<const M: usize> {
    /// Takes the nodes of point i and their weights for a functional, in the given lane; None where the moment
    /// conditions are not met.
    fn take(&mut self, functional: usize, i: usize, nodes: &[Node<M>], weights: Option<(&[Lanes], usize)>);
}

/// Results of the fits of a range of points, beside the weights.
pub(super) struct FitOutcome<const M: usize> {
    pub heights: Vec<Heights<M>>,
    pub fit_diagnostics: SupportDiagnostics,
}

impl<const M: usize> Default for FitOutcome<M> {
    fn default() -> Self {
        Self { heights: Vec::new(), fit_diagnostics: SupportDiagnostics::default() }
    }
}

/// Workspace of a thread.
#[derive(Default)]
pub(super) struct Workspace<const M: usize> {
    fit: MomentFit<M>,
    terms: Vec<([u8; M], f64)>,
    functional: Vec<f64>,
    /// Values of the present functional for the basis functions, in each lane.
    values: Vec<[f64; LANES]>,
}

/// The chart, basis and functionals of fits.
pub(super) struct Fits<'a, const M: usize> {
    pub chart: &'a dyn Chart<M>,
    pub basis: &'a Basis<M>,
    pub radius: f64,
    pub functionals: &'a [Functional<M>],
}

impl<const M: usize> Fits<'_, M> {
    /// Fits a range of points in their order. An interrupt ends the fits early.
    pub fn run(
        &self,
        points: Range<usize>,
        interrupt: &Interrupt,
        workspace: &mut Workspace<M>,
        sink: &mut dyn RowSink<M>,
        outcome: &mut FitOutcome<M>,
    ) {
        let end = points.end;
        for first in points.step_by(LANES) {
            if interrupt.is_raised() {
                return;
            }
            self.rows_of(first..(first + LANES).min(end), workspace, sink, outcome);
        }
    }

    /// Fits up to four points, one per lane.
    ///
    /// 1. Collect the neighbors, and enlarge supports with too few of them.
    /// 2. Factorize the moment matrices, and enlarge rank-deficient supports until all are sound or at their limit.
    /// 3. Solve for all functionals.
    fn rows_of(
        &self,
        points: Range<usize>,
        workspace: &mut Workspace<M>,
        sink: &mut dyn RowSink<M>,
        outcome: &mut FitOutcome<M>,
    ) {
        let number = self.basis.size();
        let wanted = (NEIGHBORS_PER_FUNCTION * number as f64).ceil() as usize;
        let last = points.end - 1;
        let nominal: [f64; LANES] =
            std::array::from_fn(|lane| self.radius * self.chart.scale((points.start + lane).min(last)));
        let mut radius = nominal;
        let can_grow =
            |lane: usize, radius: f64| self.chart.may_grow() && radius * GROWTH <= MAX_GROWTH * nominal[lane];
        for (lane, i) in points.clone().enumerate() {
            loop {
                self.chart.gather(i, radius[lane], false, &mut workspace.fit.near[lane]);
                if workspace.fit.near[lane].len() >= wanted || !can_grow(lane, radius[lane]) {
                    break;
                }
                radius[lane] *= GROWTH;
                outcome.fit_diagnostics.enlarged += 1;
            }
        }
        for lane in points.len()..LANES {
            // Spare lanes repeat the first one.
            let (first, rest) = workspace.fit.near.split_at_mut(1);
            rest[lane - 1].clone_from(&first[0]);
            radius[lane] = radius[0];
        }
        let mut is_last_resort = [!self.chart.may_grow(); LANES];
        loop {
            let pivots = workspace.fit.factorize(self.basis);
            let sound: [bool; LANES] =
                std::array::from_fn(|lane| pivots[lane] > MIN_PIVOT && workspace.fit.near[lane].len() >= number);
            let mut is_again = false;
            for (lane, i) in points.clone().enumerate().filter(|(lane, _)| !sound[*lane]) {
                if can_grow(lane, radius[lane]) && !is_last_resort[lane] {
                    radius[lane] *= GROWTH;
                    outcome.fit_diagnostics.enlarged += 1;
                } else if !is_last_resort[lane] {
                    radius[lane] = nominal[lane] * GROWTH;
                    is_last_resort[lane] = true;
                    outcome.fit_diagnostics.unresolved += 1;
                } else {
                    continue;
                }
                self.chart.gather(i, radius[lane], is_last_resort[lane], &mut workspace.fit.near[lane]);
                is_again = true;
            }
            if !is_again {
                for lane in (0..points.len()).filter(|lane| sound[*lane]) {
                    outcome.fit_diagnostics.min_pivot = outcome.fit_diagnostics.min_pivot.min(pivots[lane]);
                }
                self.finish(&points, radius, sound, workspace, sink, outcome);
                return;
            }
        }
    }

    /// Solves for all functionals with the present supports and factorization, and passes the weights to the sink.
    fn finish(
        &self,
        points: &Range<usize>,
        radius: [f64; LANES],
        sound: [bool; LANES],
        workspace: &mut Workspace<M>,
        sink: &mut dyn RowSink<M>,
        outcome: &mut FitOutcome<M>,
    ) {
        let fitted = self.chart.needs_heights().then(|| heights(self.basis, &mut workspace.fit, radius, sound));
        // Where the moments are singular, the heights are undefined, and with them the metric.
        let mut holds = sound.map(|is_sound| is_sound || fitted.is_none());
        for (k, functional) in self.functionals.iter().enumerate() {
            workspace.values.clear();
            workspace.values.resize(self.basis.size(), [0.0; LANES]);
            for lane in 0..LANES {
                let i = points.start + lane.min(points.len().saturating_sub(1));
                workspace.terms.clear();
                let lane_heights = fitted.as_ref().map(|heights| &heights[lane]);
                self.chart.terms(*functional, i, lane_heights, &mut workspace.terms);
                add_terms(self.basis, &workspace.terms, radius[lane], lane, &mut workspace.values);
            }
            workspace.fit.solution.clear();
            workspace.fit.solution.extend(workspace.values.iter().map(|values| Lanes::new(*values)));
            workspace.fit.solve();
            for (lane, i) in points.clone().enumerate() {
                if !sound[lane] && holds[lane] {
                    workspace.functional.clear();
                    workspace.functional.extend(workspace.values.iter().map(|values| values[lane]));
                    holds[lane] = workspace.fit.solve_low_rank(lane, &workspace.functional) <= MAX_MOMENT_VIOLATION;
                }
                let weights = holds[lane].then_some((workspace.fit.weights.as_slice(), lane));
                sink.take(k, i, &workspace.fit.near[lane], weights);
            }
        }
        let SupportDiagnostics { low_rank, failed, first_failed, .. } = &mut outcome.fit_diagnostics;
        for (lane, i) in points.clone().enumerate().filter(|(lane, _)| !sound[*lane]) {
            if holds[lane] {
                *low_rank += 1;
            } else {
                *failed += 1;
                first_failed.get_or_insert(i);
            }
        }
        if let Some(heights) = fitted {
            outcome.heights.extend_from_slice(&heights[..points.len()]);
        }
    }
}

/// Adds the values of a functional for the basis functions to one lane. The functional is a sum of partial derivatives, and
/// the basis functions depend on coordinates divided by the radius.
pub(super) fn add_terms<const M: usize>(
    basis: &Basis<M>,
    terms: &[([u8; M], f64)],
    radius: f64,
    lane: usize,
    values: &mut [[f64; LANES]],
) {
    for (alpha, coefficient) in terms {
        let order: u8 = alpha.iter().sum();
        let scale = coefficient * radius.powi(-i32::from(order));
        if let Some(derivative) = basis.derivative(alpha) {
            for (sum, value) in values.iter_mut().zip(derivative) {
                sum[lane] += scale * value;
            }
        }
    }
}

/// Slopes and second derivatives of the surface over the plane of each lane; NaN in lanes that are not sound.
pub(super) fn heights<const M: usize>(
    basis: &Basis<M>,
    fit: &mut MomentFit<M>,
    radius: [f64; LANES],
    sound: [bool; LANES],
) -> [Heights<M>; LANES] {
    fit.solve_heights(basis.size());
    let derivative = |alpha: [u8; M], lane: usize| -> f64 {
        if !sound[lane] {
            return f64::NAN;
        }
        let values = basis.derivative(&alpha).unwrap_or(&[]);
        values.iter().zip(&fit.solution).map(|(value, c)| value * c.as_array()[lane]).sum()
    };
    std::array::from_fn(|lane| Heights {
        first: std::array::from_fn(|a| derivative(first(a), lane)),
        second: std::array::from_fn(|a| std::array::from_fn(|b| derivative(second(a, b), lane) / radius[lane])),
    })
}
