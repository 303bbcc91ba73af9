//! How good the rows by stars are: their kinds, and whether an operator of them has growing modes.

use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::{Interruptible, ritz};
use crate::operators::{RowKind, StarRows};
use crate::parallel::Interrupt;
use crate::simulation::{Check, Component, Diagnostic, Finding, LoadError, Section};

/// Share of positive and Voronoi rows beyond which the conservative form is better. Measured: 0 to 0.22 % on clouds that are
/// resolved, 1.3 to 45 % on others.
const MOST_FALLBACKS: f64 = 0.01;
/// Share of points with open stars beyond which the conservative form is better where it has the order of the fits. It keeps the
/// integral, and a rim that is too sharp for its points is no edge to it: on a disc 3.5 spacings thick its Poisson solution is off by
/// 1.6 %, that of fits by 5.0 %.
const MOST_OPEN: f64 = 0.01;
/// Largest real part of a Ritz value by the largest weight of a row that is no growing mode.
const GROWING: f64 = 1e-4;
/// Steps of Arnoldi's method.
const STEPS: usize = 60;

/// Kinds of rows, and the largest real part of the Ritz values.
#[derive(Debug, Clone, PartialEq)]
pub struct RowQuality {
    /// Number of points.
    count: u64,
    /// Points whose support grew.
    grown: u64,
    /// Rows of lower order.
    lower_order: u64,
    /// Positive rows.
    positive: u64,
    /// Voronoi rows.
    voronoi: u64,
    /// Share of positive and Voronoi rows.
    fallback_share: f64,
    /// Share of points with open stars, of fits with the order of the conservative form; else zero.
    open_share: f64,
    /// Largest R_i.
    largest_ratio: f64,
    /// Largest real part of a Ritz value by the largest weight; NaN where it was not computed.
    growth: f64,
    /// The first few points with Voronoi rows.
    first_voronoi: Vec<usize>,
}

/// Points with Voronoi rows that are named.
const NAMED: usize = 8;

impl RowQuality {
    /// Counts rows. With `judged`, the operator that an equation is solved with, growing modes are looked for where rows are not
    /// bounded fits.
    pub(super) fn new<const M: usize>(built: &StarRows<M>, judged: Option<&SparseRows>, interrupt: &Interrupt) -> Self {
        let number = |kind: RowKind| built.kinds.iter().filter(|found| **found == kind).count() as u64;
        let is_fallback = |i: &usize| matches!(built.kinds[*i], RowKind::Positive | RowKind::Voronoi);
        let count = built.kinds.len();
        let fallbacks = (0..count).filter(is_fallback).count();
        // Operators of bounded rows alone have no growing modes (measured on 120 of them), which saves the search.
        let growth = judged.filter(|_| fallbacks > 0).map_or(f64::NAN, |rows| {
            let largest = |i: usize| rows.row(i).1.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
            let size = (0..rows.rows()).map(largest).fold(f64::MIN_POSITIVE, f64::max);
            ritz::largest_real_part(&Interruptible { map: rows, interrupt }, STEPS) / size
        });
        let voronoi = (0..count).filter(|i| built.kinds[*i] == RowKind::Voronoi);
        Self {
            count: count as u64,
            grown: built.grown,
            lower_order: number(RowKind::LowerOrder),
            positive: number(RowKind::Positive),
            voronoi: number(RowKind::Voronoi),
            fallback_share: fallbacks as f64 / count.max(1) as f64,
            open_share: 0.0,
            largest_ratio: built.largest_ratio,
            growth,
            first_voronoi: voronoi.take(NAMED).collect(),
        }
    }

    /// The same with the number of points that have open stars, where fits have no more than the order of the conservative form.
    pub(super) fn with_open_points(mut self, number: usize) -> Self {
        self.open_share = number as f64 / self.count.max(1) as f64;
        self
    }

    /// Whether the operator has modes that grow.
    #[must_use]
    pub fn has_growing_modes(&self) -> bool {
        self.growth > GROWING
    }

    /// The largest real part of a Ritz value by the largest weight of a row; NaN where it was not computed.
    #[must_use]
    pub fn growth(&self) -> f64 {
        self.growth
    }

    /// Why the conservative form is better, if it is.
    #[must_use]
    pub fn reason_to_switch(&self) -> Option<String> {
        if self.fallback_share > MOST_FALLBACKS {
            let share = 100.0 * self.fallback_share;
            return Some(format!(
                "{share:.2} % of the {} points have no bounded fit (limit {} %)",
                self.count,
                100.0 * MOST_FALLBACKS
            ));
        }
        if self.open_share > MOST_OPEN {
            let share = 100.0 * self.open_share;
            return Some(format!(
                "{share:.2} % of the {} points lie at edges (limit {} %), and it keeps the integral there",
                self.count,
                100.0 * MOST_OPEN
            ));
        }
        self.has_growing_modes().then(|| {
            format!("fits have a growing mode: the largest Ritz value is {:.1e} of the largest weight", self.growth)
        })
    }

    /// Number of Voronoi rows, and the first few of their points.
    #[must_use]
    pub fn voronoi(&self) -> (u64, &[usize]) {
        (self.voronoi, &self.first_voronoi)
    }

    /// Share of positive and Voronoi rows, held against its limit where the rows are kept.
    pub(super) fn check_of_fallbacks(&self, are_kept: bool) -> Check {
        let share = Some(self.fallback_share);
        if are_kept {
            Check::at_most("fallback_rows", share, MOST_FALLBACKS, "")
        } else {
            Check::watched("fallback_rows", share, "")
        }
    }

    /// A finding where more rows that are kept are no bounded fits than a result can rely on.
    pub(super) fn finding_of_fallbacks(&self, at: (u64, f64)) -> Option<Finding> {
        let count = self.positive + self.voronoi;
        let message = format!(
            "{count} of {} points have no bounded fit, {:.2} % (limit {} %)",
            self.count,
            100.0 * self.fallback_share,
            100.0 * MOST_FALLBACKS
        );
        let advice = "more points help; in equations `auto` and `conservative` take another form";
        let finding = Finding::warning("operator.fallback_rows", message, at).with_count(count).with_advice(advice);
        (self.fallback_share > MOST_FALLBACKS).then_some(finding)
    }

    /// Counts for the report.
    pub(super) fn diagnostics(&self) -> Vec<Diagnostic> {
        vec![
            Diagnostic::count("supports.grown", self.grown, "Points whose support grew until their row was bounded."),
            Diagnostic::count("supports.lower_order", self.lower_order, "Points with a fit of lower degree."),
            Diagnostic::count("supports.positive", self.positive, "Points with a quadratic fit of positive weights."),
            Diagnostic::count("supports.voronoi", self.voronoi, "Points with the row of their Voronoi cell."),
            Diagnostic::new(
                "supports.largest_ratio",
                self.largest_ratio,
                "Largest sum of the sizes of the weights of neighbors by that of the weight of the point.",
            ),
        ]
    }
}

impl Component for RowQuality {
    fn save(&self, section: &mut Section) {
        section.put_count("count", self.count);
        section.put_count("grown", self.grown);
        section.put_count("lower_order", self.lower_order);
        section.put_count("positive", self.positive);
        section.put_count("voronoi", self.voronoi);
        section.put_real("fallback_share", self.fallback_share);
        section.put_real("open_share", self.open_share);
        section.put_real("largest_ratio", self.largest_ratio);
        section.put_optional("growth", crate::simulation::section::known(self.growth));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            count: section.count("count")?,
            grown: section.count("grown")?,
            lower_order: section.count("lower_order")?,
            positive: section.count("positive")?,
            voronoi: section.count("voronoi")?,
            fallback_share: section.real("fallback_share")?,
            open_share: section.real("open_share")?,
            largest_ratio: section.real("largest_ratio")?,
            growth: section.optional("growth")?.unwrap_or(f64::NAN),
            // Findings name them when the operators are made.
            first_voronoi: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::RowQuality;

    #[test]
    fn many_fallbacks_are_doubtful_where_rows_are_kept() {
        let quality = |positive: u64| RowQuality {
            count: 1000,
            grown: 0,
            lower_order: 0,
            positive,
            voronoi: 0,
            fallback_share: positive as f64 / 1000.0,
            open_share: 0.0,
            largest_ratio: 1.0,
            growth: f64::NAN,
            first_voronoi: Vec::new(),
        };
        let told = |positive: u64| quality(positive).finding_of_fallbacks((1, 0.0)).map(|finding| finding.count);
        assert_eq!((told(10), told(11)), (None, Some(11)));
        let holds = |positive: u64, are_kept: bool| quality(positive).check_of_fallbacks(are_kept).holds;
        assert_eq!((holds(10, true), holds(11, true), holds(11, false)), (Some(true), Some(false), None));
    }
}
