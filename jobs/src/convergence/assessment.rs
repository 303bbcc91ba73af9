//! The whole judgement of a series of levels.
//!
//! With the finest spacing h₁, r = h₂/h₁ and the order p: the extrapolated value φ₁ + (φ₁ − φ₂)/(rᵖ − 1) (Richardson), and the grid
//! convergence index F |φ₁ − φ₂|/(rᵖ − 1), F = 1.25 with three or more levels and 3 with two (Roache 1994, Celik 2008). Where
//! values oscillate, half their range over three levels stands for the error (Stern 2001). Values that diverge have no error.

use super::order::{Order, observed};
use super::{Level, Subject};

/// How values approach their limit, by the three finest levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convergence {
    /// From one side, with differences that fall; errors that fall.
    Monotone,
    /// To and fro, with differences that fall; errors that fall on the whole.
    Oscillatory,
    /// Not at all: differences, or errors, that do not fall.
    Divergent,
}

impl Convergence {
    /// The word of reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Monotone => "monotone",
            Self::Oscillatory => "oscillatory",
            Self::Divergent => "divergent",
        }
    }
}

/// What is to be reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// What the values are.
    pub subject: Subject,
    /// The order that theory gives, where it is known.
    pub theory: Option<f64>,
    /// Bound of the uncertainty.
    pub tolerance: f64,
    /// Whether the tolerance is a share of the value: of errors a share of `scale`.
    pub is_relative: bool,
    /// Size of the exact answer that errors are compared with; 1 where errors are shares already.
    pub scale: f64,
}

/// What levels say.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// Error of every level, in the unit of the value, where it can be told.
    pub errors: Vec<Option<f64>>,
    /// The observed order.
    pub order: Option<Order>,
    /// The extrapolated value; errors have none.
    pub extrapolated: Option<f64>,
    /// Grid convergence index of the finest level, in the measure of the tolerance.
    pub gci: Option<f64>,
    /// Whether the three finest levels are in the asymptotic range: GCI₃₂/(rᵖ GCI₂₁) within 10 % of one, p from theory where it
    /// gives one. Without theory three levels fit their own order, and more than three are needed for a statement.
    pub is_asymptotic: bool,
    /// How the values approach their limit; None for too few levels.
    pub convergence: Option<Convergence>,
    /// What is compared with the tolerance: the error itself where it is known, else the grid convergence index.
    pub uncertainty: Option<f64>,
    /// Whether it is within the tolerance.
    pub is_met: bool,
    /// The spacing that would meet the tolerance; None where it is met or nothing can be told.
    pub next_spacing: Option<f64>,
}

/// Safety factor with two levels.
const SAFETY_OF_TWO: f64 = 3.0;
/// Safety factor with three or more.
const SAFETY: f64 = 1.25;
/// Order where neither levels nor theory tell one.
const LEAST_ORDER: f64 = 1.0;
/// Differences by the value below which values count as equal: sums of a million terms differ by as much.
const ROUND_OFF: f64 = 1e-13;
/// How far from one the ratio of the asymptotic range may be.
const ASYMPTOTIC: f64 = 0.1;

/// Judges levels, the coarsest first.
#[must_use]
pub fn assess(levels: &[Level], target: &Target) -> Assessment {
    let order = observed(levels, target.subject);
    let convergence = convergence(levels, target.subject, order.is_some());
    let used = order_used(order, target.theory);
    let (errors, extrapolated) = match target.subject {
        Subject::Error => (levels.iter().map(|level| Some(level.value)).collect(), None),
        Subject::Value => errors_of_values(levels, convergence, used),
    };
    let scale = match (target.is_relative, target.subject) {
        (false, _) => 1.0,
        (true, Subject::Error) => target.scale.abs(),
        (true, Subject::Value) => levels.last().map_or(f64::NAN, |finest| finest.value.abs()),
    };
    let safety = if levels.len() < 3 { SAFETY_OF_TWO } else { SAFETY };
    let gci = richardson(levels, target.subject, convergence, &errors, used).map(|error| safety * error / scale);
    let finest = errors.last().copied().flatten();
    let uncertainty = match target.subject {
        Subject::Error => finest.map(|error| error / scale),
        Subject::Value => gci,
    };
    let uncertainty = uncertainty.filter(|uncertainty| uncertainty.is_finite());
    let is_met = uncertainty.is_some_and(|uncertainty| uncertainty <= target.tolerance);
    let can_tell = convergence != Some(Convergence::Divergent) && (order.is_some() || levels.len() == 2);
    let next_spacing = (!is_met && can_tell)
        .then(|| Some(levels.last()?.spacing * (target.tolerance / uncertainty?).powf(used.recip())))
        .flatten();
    Assessment {
        is_asymptotic: is_asymptotic(levels, target, convergence, used),
        errors,
        order,
        extrapolated,
        gci: gci.filter(|gci| gci.is_finite()),
        convergence,
        uncertainty,
        is_met,
        next_spacing,
    }
}

/// The order that estimates use: the observed one, but not more than theory gives.
fn order_used(order: Option<Order>, theory: Option<f64>) -> f64 {
    match (order, theory) {
        (Some(order), Some(theory)) => order.value.min(theory),
        (Some(order), None) => order.value,
        (None, Some(theory)) => theory,
        (None, None) => LEAST_ORDER,
    }
}

fn convergence(levels: &[Level], subject: Subject, has_order: bool) -> Option<Convergence> {
    let finite = levels.iter().all(|level| level.value.is_finite());
    if !finite {
        return Some(Convergence::Divergent);
    }
    match (subject, levels) {
        (_, [] | [_]) | (Subject::Value, [_, _]) => None,
        (Subject::Error, [coarse, fine]) => {
            Some(if fine.value < coarse.value { Convergence::Monotone } else { Convergence::Divergent })
        }
        (Subject::Error, [.., coarse, middle, fine]) => Some(if fine.value >= coarse.value {
            Convergence::Divergent
        } else if coarse.value > middle.value && middle.value > fine.value {
            Convergence::Monotone
        } else {
            Convergence::Oscillatory
        }),
        (Subject::Value, [.., coarse, middle, fine]) => {
            let size = [coarse, middle, fine].iter().map(|level| level.value.abs()).fold(0.0, f64::max);
            let rate = |a: &Level, b: &Level| (b.value - a.value) / (a.spacing / b.spacing).ln();
            if (fine.value - middle.value).abs() <= ROUND_OFF * size {
                return Some(Convergence::Monotone);
            }
            // Differences of a logarithm, the limit of powers whose order goes to zero, have the ratio one.
            let ratio = rate(middle, fine) / rate(coarse, middle);
            Some(if !ratio.is_finite() || ratio.abs() >= 1.0 || (ratio > 0.0 && !has_order) {
                Convergence::Divergent
            } else if ratio > 0.0 {
                Convergence::Monotone
            } else {
                Convergence::Oscillatory
            })
        }
    }
}

/// The errors of values, and the extrapolated value.
fn errors_of_values(levels: &[Level], convergence: Option<Convergence>, order: f64) -> (Vec<Option<f64>>, Option<f64>) {
    let unknown = || vec![None; levels.len()];
    match (convergence, levels) {
        (None | Some(Convergence::Monotone), [.., middle, fine]) => {
            let growth = (middle.spacing / fine.spacing).powf(order) - 1.0;
            let limit = fine.value + (fine.value - middle.value) / growth;
            let least = ROUND_OFF * fine.value.abs();
            (levels.iter().map(|level| Some((level.value - limit).abs().max(least))).collect(), Some(limit))
        }
        (Some(Convergence::Oscillatory), [.., coarse, middle, fine]) => {
            let values = [coarse.value, middle.value, fine.value];
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
            let mut errors = unknown();
            if let Some(last) = errors.last_mut() {
                *last = Some(0.5 * (high - low));
            }
            (errors, None)
        }
        _ => (unknown(), None),
    }
}

/// The estimated error of the finest level without a safety factor.
fn richardson(
    levels: &[Level],
    subject: Subject,
    convergence: Option<Convergence>,
    errors: &[Option<f64>],
    order: f64,
) -> Option<f64> {
    match (subject, levels) {
        (Subject::Value, _) => errors.last().copied().flatten(),
        (Subject::Error, [.., middle, fine]) if convergence != Some(Convergence::Divergent) => {
            Some((middle.value - fine.value).abs() / ((middle.spacing / fine.spacing).powf(order) - 1.0))
        }
        (Subject::Error, _) => None,
    }
}

fn is_asymptotic(levels: &[Level], target: &Target, convergence: Option<Convergence>, used: f64) -> bool {
    let [.., coarse, middle, fine] = levels else { return false };
    if convergence != Some(Convergence::Monotone) {
        return false;
    }
    let order = target.theory.unwrap_or(used);
    let ratio = match target.subject {
        Subject::Error => middle.value / fine.value / (middle.spacing / fine.spacing).powf(order),
        Subject::Value if target.theory.is_none() && levels.len() == 3 => return false,
        Subject::Value => {
            let index = |a: &Level, b: &Level| (a.value - b.value).abs() / ((a.spacing / b.spacing).powf(order) - 1.0);
            index(coarse, middle) / index(middle, fine) / (middle.spacing / fine.spacing).powf(order)
        }
    };
    (ratio - 1.0).abs() <= ASYMPTOTIC
}

#[cfg(test)]
mod tests {
    use super::{Convergence, Target, assess};
    use crate::convergence::{Level, Subject};

    const ERROR: Target =
        Target { subject: Subject::Error, theory: None, tolerance: 1e-3, is_relative: false, scale: 1.0 };
    const VALUE: Target = Target { subject: Subject::Value, ..ERROR };

    fn levels(count: i32, value: impl Fn(f64, i32) -> f64) -> Vec<Level> {
        (0..count)
            .map(|k| (0.2 / 1.5_f64.powi(k), k))
            .map(|(spacing, k)| Level { spacing, value: value(spacing, k), cpu_s: 1.0 })
            .collect()
    }

    #[test]
    fn an_exact_series_is_extrapolated_exactly_and_its_index_bounds_the_error() {
        for p in [1.0, 2.0, 4.0] {
            for count in 3..7 {
                let series = levels(count, |h, _| 3.0 - 0.4 * h.powf(p));
                let found = assess(&series, &VALUE);
                let error = 0.4 * series.last().unwrap().spacing.powf(p);
                assert_eq!(found.convergence, Some(Convergence::Monotone));
                assert!((found.order.unwrap().value - p).abs() < 1e-4, "{p} {count}: {found:?}");
                assert!((found.extrapolated.unwrap() - 3.0).abs() < 1e-3 * error, "{found:?}");
                assert!((found.gci.unwrap() / error - 1.25).abs() < 1e-3);
                assert!((found.errors[0].unwrap() - (3.0 - series[0].value)).abs() < 1e-3 * error);
                assert_eq!(found.is_asymptotic, count > 3, "three values fit their own order");
                assert!(assess(&series, &Target { theory: Some(p), ..VALUE }).is_asymptotic);
                assert!(!assess(&series, &Target { theory: Some(p + 0.5), ..VALUE }).is_asymptotic);
            }
        }
    }

    #[test]
    fn two_levels_take_the_order_of_theory_and_a_safety_of_three() {
        let series = levels(2, |h, _| 1.0 + h * h);
        let found = assess(&series, &Target { theory: Some(2.0), ..VALUE });
        assert!((found.extrapolated.unwrap() - 1.0).abs() < 1e-12 && found.order.is_none());
        assert!((found.gci.unwrap() / series[1].spacing.powi(2) - 3.0).abs() < 1e-9);
        assert!(found.next_spacing.is_some() && !found.is_asymptotic);
        assert!(found.gci.unwrap() < assess(&series, &VALUE).gci.unwrap(), "order one is the careful guess");
    }

    #[test]
    fn oscillating_and_diverging_values_are_told_apart() {
        let swinging = levels(5, |h, k| 1.0 + h * h * f64::from(1 - 2 * (k % 2)));
        let found = assess(&swinging, &VALUE);
        assert_eq!(found.convergence, Some(Convergence::Oscillatory));
        let last = swinging.last().unwrap().value;
        assert!(found.extrapolated.is_none() && found.errors[4].unwrap() > (last - 1.0).abs(), "{found:?}");
        let growing = levels(5, |h, k| 1.0 + f64::from(1 - 2 * (k % 2)) / h);
        for series in [levels(4, |h, _| h.ln()), levels(4, |h, _| 1.0 / h), growing] {
            let found = assess(&series, &VALUE);
            assert_eq!(found.convergence, Some(Convergence::Divergent), "{found:?}");
            assert!(found.uncertainty.is_none() && found.next_spacing.is_none() && !found.is_met);
        }
        let broken = levels(3, |h, k| if k == 1 { f64::NAN } else { h });
        assert_eq!(assess(&broken, &VALUE).convergence, Some(Convergence::Divergent));
    }

    #[test]
    fn errors_need_no_extrapolation() {
        let found = assess(&levels(4, |h, _| 2.0 * h.powi(3)), &ERROR);
        assert!((found.order.unwrap().value - 3.0).abs() < 1e-9 && found.extrapolated.is_none());
        assert_eq!(found.convergence, Some(Convergence::Monotone));
        let finest = 0.2 / 1.5_f64.powi(3);
        assert!((found.uncertainty.unwrap() - 2.0 * finest.powi(3)).abs() < 1e-15);
        let next = found.next_spacing.unwrap_or(finest);
        assert!((2.0 * next.powi(3)).min(2.0 * finest.powi(3)) <= 1.000_001e-3);
        let shares = assess(&levels(4, |h, _| h), &Target { is_relative: true, scale: 100.0, ..ERROR });
        assert!(shares.is_met, "{shares:?}");
        let rising = assess(&levels(3, |h, _| 1.0 / h), &ERROR);
        assert_eq!((rising.convergence, rising.next_spacing), (Some(Convergence::Divergent), None));
        let odd = assess(&levels(3, |h, k| if k == 1 { 0.5 } else { h }), &ERROR);
        assert_eq!(odd.convergence, Some(Convergence::Oscillatory));
    }

    #[test]
    fn the_spacing_that_is_asked_for_next_meets_the_tolerance() {
        for (target, limit) in [(ERROR, 0.0), (VALUE, 2.0)] {
            let target = Target { tolerance: 1e-6, ..target };
            let value = |h: f64| limit + 0.3 * h * h;
            let next = assess(&levels(4, |h, _| value(h)), &target).next_spacing.unwrap();
            let mut series = levels(4, |h, _| value(h));
            series.push(Level { spacing: 0.999 * next, value: value(0.999 * next), cpu_s: 1.0 });
            assert!(assess(&series, &target).is_met, "{limit}");
        }
    }

    #[test]
    fn values_that_agree_to_round_off_are_done() {
        let found = assess(&levels(3, |_, _| 4.0), &VALUE);
        assert!(found.is_met && found.convergence == Some(Convergence::Monotone), "{found:?}");
    }
}
