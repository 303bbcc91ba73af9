//! The spacing that levels tell: the one with which a run reaches a tolerance, not much finer than it needs to be.

use super::Plan;
use super::decision::{Setup, judge, target};
use crate::convergence::{Assessment, Convergence};
use crate::spec::accuracy::{ChosenAccuracy, KnownLevel};
use crate::spec::study::MeasuredLevel;

/// How much finer than the finest level the spacing may be that is told: orders are not known to the last digit.
const FARTHEST: f64 = 2.2;
/// The same of values without an exact answer, whose errors are not known either.
const FARTHEST_OF_VALUES: f64 = 1.5;
/// How much smaller than the tolerance the predicted error is.
pub(super) const SAFETY: f64 = 1.25;
/// Uncertainty of an order: with it the safety grows by the distance over which it is used.
const ORDER_UNCERTAINTY: f64 = 0.2;

/// A spacing for a job, by that of the first level, and the error that is predicted with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// Spacing by that of the study's first level, the ones that were passed over included.
    pub share: f64,
    /// Predicted error, in the measure of the tolerance.
    pub predicted: f64,
}

/// The spacing that the levels of a set-up tell; None where a further level is needed for that.
#[must_use]
pub fn tell(plan: &Plan, setup: &Setup, is_last: bool) -> Option<Told> {
    let told = by_levels(plan, &setup.levels, is_last)?;
    Some(Told { share: told.share * setup.first_share(plan.spec.ratio), ..told })
}

/// The same by the first of the levels.
fn by_levels(plan: &Plan, levels: &[MeasuredLevel], is_last: bool) -> Option<Told> {
    let (first, finest) = (levels.first()?, levels.last()?);
    let judged = judge(&plan.spec, &plan.quantity, levels);
    let tolerance = plan.spec.until.tolerance;
    if judged.is_met {
        return Some(among(plan, levels, &judged));
    }
    let theory = target(&plan.spec, &plan.quantity, levels).theory;
    let order = judged.order.map(|order| order.value).into_iter().chain(theory).reduce(f64::min)?;
    let uncertainty = judged.uncertainty?;
    let distance = finest.spacing / judged.next_spacing?;
    let farthest = if plan.quantity.is_error() { FARTHEST } else { FARTHEST_OF_VALUES };
    let is_near = distance <= farthest && judged.convergence == Some(Convergence::Monotone);
    if levels.len() < plan.spec.levels.least as usize || !(is_near || is_last) {
        return None;
    }
    let safe = SAFETY * distance.powf(ORDER_UNCERTAINTY);
    let spacing = finest.spacing * (tolerance / safe / uncertainty).powf(order.recip());
    Some(Told { share: spacing / first.spacing, predicted: tolerance / safe })
}

/// A spacing among those of the levels, one of which meets the tolerance: between it and the one before it, where errors are powers.
fn among(plan: &Plan, levels: &[MeasuredLevel], judged: &Assessment) -> Told {
    let first = levels.first().map_or(1.0, |first| first.spacing);
    let uncertainty = |k: usize| judge(&plan.spec, &plan.quantity, &levels[..=k]).uncertainty;
    // The error of a value is known by the levels before it alone: the run has the spacing of a level.
    let is_error = plan.quantity.is_error();
    let goal = plan.spec.until.tolerance / if is_error { SAFETY } else { 1.0 };
    let is_good = |k: &usize| (*k..levels.len()).all(|k| uncertainty(k).is_some_and(|error| error <= goal));
    let Some(k) = (0..levels.len()).find(is_good) else {
        let finest = levels.last().map_or(1.0, |finest| finest.spacing);
        return Told { share: finest / first, predicted: judged.uncertainty.unwrap_or(goal) };
    };
    let here = (levels[k].spacing, uncertainty(k).unwrap_or(goal));
    let before =
        k.checked_sub(1).filter(|_| is_error).and_then(|before| Some((levels[before].spacing, uncertainty(before)?)));
    let between = before.filter(|(_, error)| *error > here.1).map(|(spacing, error)| {
        let order = (error / here.1).ln() / (spacing / here.0).ln();
        (here.0 * (goal / here.1).powf(order.recip())).clamp(here.0, spacing)
    });
    match between {
        Some(spacing) => Told { share: spacing / first, predicted: goal },
        None => Told { share: here.0 / first, predicted: here.1 },
    }
}

/// The accuracy of the body of a run with a spacing that was told; `basis` says what it rests on.
#[must_use]
pub fn chosen(plan: &Plan, levels: Vec<KnownLevel>, told: Told, basis: String) -> ChosenAccuracy {
    ChosenAccuracy {
        quantity: plan.spec.quantity.as_given(),
        tolerance: plan.spec.until.tolerance,
        relative: plan.spec.until.relative,
        predicted: told.predicted,
        basis,
        levels,
    }
}

#[cfg(test)]
mod tests {
    use super::{Told, tell};
    use crate::refinement::Plan;
    use crate::refinement::decision::Setup;
    use crate::spec::study::MeasuredLevel;
    use serde_json::json;

    fn plan(tolerance: f64) -> Plan {
        let sweep = json!({"mode": "refine", "axis": "/scene/spacing", "from": 0.2, "ratio": 1.4, "levels": {"least": 3, "most": 10},
            "quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "until": {"tolerance": tolerance}});
        Plan::new(&sweep, &json!({"scene": {"kind": "redistance"}})).unwrap()
    }

    fn levels(count: i32, error: impl Fn(f64) -> f64) -> Setup {
        let level = |spacing: f64| MeasuredLevel {
            spacing,
            value: error(spacing),
            scale: 1.0,
            theory: None,
            cpu_s: spacing.powi(-2),
            forecast_cpu_s: None,
            wall_s: 0.0,
            particles: 0,
            steps: 0,
            health: None,
        };
        Setup { levels: (0..count).map(|k| level(0.2 / 1.4_f64.powi(k))).collect(), ..Setup::default() }
    }

    /// The first spacing that is told, and after how many levels.
    fn told(tolerance: f64, error: impl Fn(f64) -> f64 + Copy) -> (Told, i32) {
        let plan = plan(tolerance);
        (1..10).find_map(|count| Some((tell(&plan, &levels(count, error), false)?, count))).unwrap()
    }

    #[test]
    fn a_spacing_meets_the_tolerance_and_is_not_much_finer_than_it_needs_to_be() {
        for (order, tolerance) in [(1.0, 0.02), (2.0, 1e-3), (4.0, 1e-6), (6.0, 1e-10)] {
            let error = |h: f64| 3.0 * h.powf(order) * (1.0 + h);
            let (told, count) = told(tolerance, error);
            let reached = error(0.2 * told.share);
            assert!(reached <= tolerance && reached > 0.4 * tolerance, "{order}: {told:?} after {count}: {reached}");
            // Levels cost little beside the run: they end well before its spacing.
            assert!(0.2 / 1.4_f64.powi(count - 1) > 0.2 * told.share || count == 3, "{told:?} after {count}");
        }
    }

    #[test]
    fn where_the_first_levels_are_good_enough_the_coarsest_good_one_is_told() {
        let (told, count) = told(0.05, |h| h * h);
        assert!(count == 1 && (told.share - 1.0).abs() < 1e-12, "{told:?}");
        let plan = plan(1e-3);
        let error = |h: f64| h * h;
        let between = tell(&plan, &levels(8, error), true).unwrap();
        let reached = error(0.2 * between.share);
        assert!(reached <= 1e-3 && reached > 0.7e-3, "{between:?}");
    }

    #[test]
    fn a_spacing_goes_by_the_first_level_of_all_that_was_passed_over() {
        let passed = Setup { passed: 2, ..levels(3, |h| 3.0 * h * h) };
        let all = Setup { passed: 0, ..passed.clone() };
        let (of_passed, of_all) = (tell(&plan(1e-3), &passed, true).unwrap(), tell(&plan(1e-3), &all, true).unwrap());
        assert!((of_passed.share / of_all.share - 1.4_f64.powi(-2)).abs() < 1e-12);
    }

    #[test]
    fn levels_that_do_not_converge_tell_nothing() {
        assert_eq!(tell(&plan(1e-3), &levels(5, |h| 0.1 + 1e-3 / h), true), None);
        assert_eq!(tell(&plan(1e-3), &levels(2, |h| h), false), None, "two levels are too few");
    }
}
