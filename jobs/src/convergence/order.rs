//! The observed order p of convergence.

use super::fits::{Fitted, ORDERS, power_law, slope, student_95};
use super::{Level, Subject};

/// An order with the interval in which it lies with a confidence of 95 %, where there are levels enough to tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// The order p.
    pub value: f64,
    /// Lower end of the interval.
    pub low: Option<f64>,
    /// Upper end of the interval.
    pub high: Option<f64>,
}

impl From<Fitted> for Order {
    fn from(fitted: Fitted) -> Self {
        let width = fitted.deviation.map(|deviation| student_95(fitted.degrees_of_freedom) * deviation);
        let value = fitted.value;
        Self { value, low: width.map(|width| value - width), high: width.map(|width| value + width) }
    }
}

/// The order of levels, the coarsest first. None where they do not tell: fewer than two errors or three values, or no power law.
///
/// Errors: the slope of ln e over ln h. Four or more values: φ₀ + C hᵖ by least squares. Three values: [`of_three`].
#[must_use]
pub fn observed(levels: &[Level], subject: Subject) -> Option<Order> {
    match subject {
        Subject::Error => {
            let is_positive = |level: &&Level| level.value > 0.0 && level.value.is_finite();
            let points: Vec<(f64, f64, f64)> = levels
                .iter()
                .filter(is_positive)
                .map(|level| (level.spacing.ln(), level.value.ln(), level.spacing.recip()))
                .collect();
            slope(&points).map(Order::from)
        }
        Subject::Value => {
            let points: Vec<(f64, f64)> = levels.iter().map(|level| (level.spacing, level.value)).collect();
            let is_one_way = levels
                .windows(3)
                .all(|three| (three[2].value - three[1].value) * (three[1].value - three[0].value) > 0.0);
            let fitted = if is_one_way { power_law(&points).map(Order::from) } else { None };
            // At an end of the range there is no power law.
            let fitted = fitted.filter(|order| order.value > 1.02 * ORDERS.0 && order.value < 0.98 * ORDERS.1);
            fitted.or_else(|| {
                let three: &[Level; 3] = levels.last_chunk()?;
                of_three(three).map(|value| Order { value, low: None, high: None })
            })
        }
    }
}

/// The order of three values, the coarsest first (Celik 2008, eqs. 3): p ln r₂₁ = ln |ε₃₂/ε₂₁| + ln((r₂₁ᵖ − s)/(r₃₂ᵖ − s)) with
/// s = sign(ε₃₂/ε₂₁), found by bisection. None where there is no such p: equal values, or differences that do not fall.
#[must_use]
pub fn of_three(levels: &[Level; 3]) -> Option<f64> {
    let [coarse, middle, fine] = levels;
    let ratio = (coarse.value - middle.value) / (middle.value - fine.value);
    let (r21, r32) = (middle.spacing / fine.spacing, coarse.spacing / middle.spacing);
    if !ratio.is_finite() || ratio == 0.0 || r21 <= 1.0 || r32 <= 1.0 {
        return None;
    }
    let sign = ratio.signum();
    let excess = |p: f64| p * r21.ln() - ratio.abs().ln() - ((r21.powf(p) - sign) / (r32.powf(p) - sign)).ln();
    let (mut low, mut high) = ORDERS;
    if excess(low) >= 0.0 || excess(high) <= 0.0 {
        return None;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::{observed, of_three};
    use crate::convergence::{Level, Subject};

    fn levels(spacings: &[f64], value: impl Fn(f64) -> f64) -> Vec<Level> {
        spacings.iter().map(|h| Level { spacing: *h, value: value(*h), cpu_s: 1.0 }).collect()
    }

    #[test]
    fn three_levels_of_any_ratio_give_the_order() {
        for p in [0.7, 1.0, 2.0, 4.3] {
            for spacings in [[0.4, 0.2, 0.1], [0.4, 0.25, 0.2], [0.4, 0.3, 0.1]] {
                let three: [Level; 3] = levels(&spacings, |h| 1.0 + 3.0 * h.powf(p)).try_into().unwrap();
                assert!((of_three(&three).unwrap() - p).abs() < 1e-8, "{p} {spacings:?}");
            }
        }
    }

    #[test]
    fn what_does_not_converge_has_no_order() {
        for value in [|h: f64| h.ln(), |h: f64| 1.0 / h, |_: f64| 1.0] {
            let three: [Level; 3] = levels(&[0.4, 0.2, 0.1], value).try_into().unwrap();
            assert_eq!(of_three(&three), None);
        }
        assert_eq!(observed(&levels(&[0.4, 0.2], |h| h), Subject::Value), None);
        assert_eq!(observed(&levels(&[0.4], |h| h), Subject::Error), None);
    }

    #[test]
    fn second_terms_widen_the_interval_about_the_order() {
        let spacings: Vec<f64> = (0..5).map(|k| 0.2 / 1.5_f64.powi(k)).collect();
        for (subject, limit) in [(Subject::Error, 0.0), (Subject::Value, 7.0)] {
            let found = observed(&levels(&spacings, |h| limit + 2.0 * h.powi(2) + 1.5 * h.powi(3)), subject).unwrap();
            let (low, high) = (found.low.unwrap(), found.high.unwrap());
            assert!((found.value - 2.0).abs() < 0.15, "{found:?}");
            assert!(low < found.value && found.value < high && high - low < 0.5, "{found:?}");
        }
    }
}
