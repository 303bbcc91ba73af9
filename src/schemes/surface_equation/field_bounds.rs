//! What an evolving field must keep: the bounds of diffusion, positive concentrations, and its integral.

use super::reactions::{Reaction, Terms};
use crate::simulation::{Check, Finding};
use crate::time::Clock;

/// Of max|u| by that at the start, without reactions: a sound operator of high order overshoots by far less.
const MOST_GROWTH: f64 = 10.0;
/// Growth without reactions that is a doubt: diffusion makes nothing larger.
const DOUBTFUL_GROWTH: f64 = 1.01;
/// Of concentrations by the largest at the start or at rest: patterns stay below ten.
const MOST_REACTION: f64 = 100.0;
/// Concentrations below minus this share of the largest at the start are no solution: reactions and diffusion keep them positive.
const NEGATIVE: f64 = 1e-2;
/// Change of the integral by that of |u| at the start that is a doubt. Sound operators of second order stay below 1e-3.
const DOUBTFUL_DRIFT: f64 = 1e-2;

/// Bounds of a field, or of two concentrations.
#[derive(Debug, Clone)]
pub(super) struct FieldBounds {
    /// Largest value of each field at the start, or at rest.
    sizes: Vec<f64>,
    /// Diffusion alone: nothing makes or takes the substance.
    is_plain: bool,
    is_reaction: bool,
    /// Whether large values cannot be a solution. What formulas make may grow.
    is_bounded: bool,
    /// Whether concentrations must stay positive.
    is_positive: bool,
    /// Change of the integral by that of |u| at the start; NaN where it is not known.
    pub drift: f64,
}

/// Largest size of a value.
fn largest_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

impl FieldBounds {
    /// Bounds from the fields at the start, one after another.
    pub fn new(initial: &[f64], reaction: Option<&Reaction>, has_source: bool) -> Self {
        let fields = reaction.map_or(1, Reaction::species);
        let mut sizes: Vec<f64> = initial.chunks(initial.len() / fields).map(largest_of).collect();
        let model = reaction.and_then(|reaction| match &reaction.terms {
            Terms::Model(model) => Some(*model),
            Terms::Formulas(_) => None,
        });
        if let Some(model) = model {
            sizes.iter_mut().zip(model.rest()).for_each(|(size, rest)| *size = size.max(rest));
        }
        // What is absent at the start is measured by what is there.
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        for size in sizes.iter_mut().filter(|size| **size == 0.0) {
            *size = if largest > 0.0 { largest } else { 1.0 };
        }
        let is_positive = model.is_some() && reaction.is_some_and(|reaction| reaction.manufactured.is_none());
        let is_positive = is_positive && initial.iter().all(|value| *value >= 0.0);
        let is_bounded = model.is_some() || reaction.is_none() && !has_source;
        Self {
            sizes,
            is_plain: reaction.is_none() && !has_source,
            is_reaction: reaction.is_some(),
            is_bounded,
            is_positive,
            drift: f64::NAN,
        }
    }

    /// Growth of the field that grew most.
    fn growth(&self, values: &[f64]) -> f64 {
        let fields = values.chunks(values.len() / self.sizes.len()).zip(&self.sizes);
        fields.map(|(field, size)| largest_of(field) / size).fold(0.0, f64::max)
    }

    /// The lowest value of all fields by the largest one at the start.
    fn least(&self, values: &[f64]) -> f64 {
        let fields = values.chunks(values.len() / self.sizes.len()).zip(&self.sizes);
        fields
            .map(|(field, size)| field.iter().copied().fold(f64::INFINITY, f64::min) / size)
            .fold(f64::INFINITY, f64::min)
    }

    fn most_growth(&self) -> f64 {
        if self.is_reaction { MOST_REACTION } else { MOST_GROWTH }
    }

    /// Why values cannot be a solution, if they cannot. Numbers that are none are left to others.
    pub fn violation(&self, values: &[f64]) -> Option<String> {
        let (growth, bound) = (self.growth(values), self.most_growth());
        if self.is_bounded && growth > bound && growth.is_finite() {
            return Some(format!(
                "max|u| is {growth:.3e} times that at the start, above {bound}: the operator has growing modes, or Δt is too \
                 long for steps without a tolerance; the method `conservative` has no growing modes, and a larger cutoff_dn or \
                 relaxed sampling helps others"
            ));
        }
        let least = self.least(values);
        (self.is_positive && least < -NEGATIVE).then(|| {
            format!(
                "a concentration fell to {least:.2e} of its size at the start, below {:.0e}: it must stay positive; the method \
                 `conservative`, a lower tolerance or more points help",
                -NEGATIVE
            )
        })
    }

    /// The bounds for the report.
    pub fn checks(&self, values: &[f64]) -> Vec<Check> {
        let growth = Some(self.growth(values));
        let mut checks = vec![if self.is_bounded {
            Check::at_most("field_growth", growth, self.most_growth(), "")
        } else {
            Check::watched("field_growth", growth, "")
        }];
        if self.is_positive {
            checks.push(Check::at_most("negative_concentration", Some(-self.least(values)), NEGATIVE, ""));
        }
        if self.is_plain {
            checks.push(Check::watched("mass_drift", Some(self.drift.abs()), ""));
        }
        checks
    }

    /// Doubts about values, each told when it first comes up; `before` is the drift before the step, and `earlier` the values.
    pub fn findings(&self, before: f64, (values, earlier): (&[f64], &[f64]), clock: Clock) -> Vec<Finding> {
        let at = (clock.step, clock.time);
        let mut findings = Vec::new();
        let growth = self.growth(values);
        if !self.is_bounded && growth > MOST_REACTION && self.growth(earlier) <= MOST_REACTION {
            let message = format!("a field is {growth:.3e} times that at the start");
            let advice = "the formulas may make it grow; where they do not, a lower tolerance or the method `conservative` helps";
            findings.push(Finding::warning("field_growth", message, at).with_advice(advice));
        }
        if !self.is_plain {
            return findings;
        }
        if growth > DOUBTFUL_GROWTH && self.growth(earlier) <= DOUBTFUL_GROWTH {
            let message = format!("max|u| is {growth:.4} times that at the start, but diffusion makes nothing larger");
            let advice = "the method `conservative` keeps the maximum, and so do shorter steps";
            findings.push(Finding::warning("maximum_principle", message, at).with_advice(advice));
        }
        if self.drift.abs() > DOUBTFUL_DRIFT && (before.is_nan() || before.abs() <= DOUBTFUL_DRIFT) {
            let message = format!("the integral has changed by {:.1e} of that of |u| at the start", self.drift);
            let advice = "the method `conservative` keeps the integral";
            findings.push(Finding::warning("mass_drift", message, at).with_advice(advice));
        }
        findings
    }
}

#[cfg(test)]
mod tests {
    use super::FieldBounds;
    use crate::schemes::surface_equation::reactions::{Model, Reaction, Terms};
    use crate::time::Clock;

    const NOW: Clock = Clock { step: 1, time: 0.1 };

    #[test]
    fn growth_is_a_doubt_and_then_the_end() {
        let bounds = FieldBounds::new(&[1.0, -0.5], None, false);
        let codes = |values: &[f64], earlier: &[f64]| {
            bounds.findings(f64::NAN, (values, earlier), NOW).iter().map(|f| f.code.clone()).collect::<Vec<_>>()
        };
        assert!(codes(&[1.005, 0.0], &[1.0, 0.0]).is_empty() && bounds.violation(&[1.005, 0.0]).is_none());
        assert_eq!(codes(&[-1.5, 0.0], &[1.0, 0.0]), ["maximum_principle"]);
        assert!(codes(&[-1.6, 0.0], &[1.5, 0.0]).is_empty(), "told once");
        assert!(bounds.violation(&[11.0, 0.0]).unwrap().contains("growing modes"));
        assert_eq!(bounds.checks(&[11.0, 0.0])[0].holds, Some(false));
        let drifted = FieldBounds { drift: -0.02, ..bounds.clone() };
        assert_eq!(drifted.findings(0.0, (&[1.0, 0.0], &[1.0, 0.0]), NOW)[0].code, "mass_drift");
    }

    #[test]
    fn concentrations_stay_positive_and_bounded() {
        let model = Model::GrayScott { feed: 0.04, kill: 0.06 };
        let reaction = Reaction { terms: Terms::Model(model), diffusivity: vec![1.0; 2], manufactured: None };
        let bounds = FieldBounds::new(&[1.0, 0.5, 0.0, 0.25], Some(&reaction), false);
        assert!(bounds.violation(&[1.0, 0.5, -1e-4, 0.9]).is_none());
        assert!(bounds.violation(&[1.0, 0.5, -0.1, 0.9]).unwrap().contains("positive"));
        assert!(bounds.violation(&[1.0, 0.5, 0.1, 1e9]).is_some());
    }
}
