//! Step number and scene time.
//!
//! With a fixed step, t = n·dt is a product, so that rounding does not accumulate.

/// Step and time that a simulation has reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Number of steps done.
    pub step: u64,
    /// Scene time reached.
    pub time: f64,
}

/// A sequence of equal time steps.
///
/// ```
/// use meniscus::time::FixedStep;
///
/// let fixed = FixedStep::from_limit(1.0, 0.3);
/// assert_eq!((fixed.steps, fixed.time_step), (4, 0.25));
/// assert_eq!(fixed.clock(4).time, 1.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedStep {
    /// Time step Δt.
    pub time_step: f64,
    /// Number of steps to the end.
    pub steps: u64,
}

/// Steps of one length from an origin: the start of a run, or the restart that changed the length of its steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Δt.
    pub time_step: f64,
    /// Clock at which steps of this length began.
    pub origin: Clock,
    /// Number of the last step.
    pub last: u64,
}

impl Pace {
    /// Steps of a length from an origin to the first that reaches the end.
    #[must_use]
    pub fn new(time_step: f64, end_time: f64, origin: Clock) -> Self {
        let steps = ((end_time - origin.time) / time_step - TIME_SLACK).ceil().max(0.0) as u64;
        Self { time_step, origin, last: origin.step + steps }
    }

    /// The clock after `step` steps.
    #[must_use]
    pub fn clock(&self, step: u64) -> Clock {
        let since = step.saturating_sub(self.origin.step) as f64;
        Clock { step, time: self.origin.time + since * self.time_step }
    }
}

impl From<FixedStep> for Pace {
    fn from(fixed: FixedStep) -> Self {
        Self { time_step: fixed.time_step, origin: Clock { step: 0, time: 0.0 }, last: fixed.steps }
    }
}

/// Fraction of a step by which a time may be missed through rounding and still counts as reached.
pub const TIME_SLACK: f64 = 1e-9;

impl FixedStep {
    /// Steps of a given length. The run ends at the first n with n·dt ≥ end − dt·1e-9 and may overshoot.
    #[must_use]
    pub fn from_time_step(end_time: f64, time_step: f64) -> Self {
        let steps = (end_time / time_step - TIME_SLACK).ceil().max(0.0) as u64;
        Self { time_step, steps }
    }

    /// A given number of equal steps that land on the end.
    #[must_use]
    pub fn from_steps(end_time: f64, steps: u64) -> Self {
        Self { time_step: end_time / steps.max(1) as f64, steps }
    }

    /// The longest equal steps not above `limit` that land on the end.
    #[must_use]
    pub fn from_limit(end_time: f64, limit: f64) -> Self {
        let steps = (end_time / limit - TIME_SLACK).ceil().max(1.0) as u64;
        Self::from_steps(end_time, steps)
    }

    /// The clock after `step` steps.
    #[must_use]
    pub fn clock(&self, step: u64) -> Clock {
        Clock { step, time: step as f64 * self.time_step }
    }

    /// Whether `step` is the first step with t ≥ `time`, up to [`TIME_SLACK`].
    #[must_use]
    pub fn reaches(&self, step: u64, time: f64) -> bool {
        let has_reached = |n: u64| n as f64 * self.time_step >= time - self.time_step * TIME_SLACK;
        has_reached(step) && (step == 0 || !has_reached(step - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::FixedStep;

    #[test]
    fn rounding_adds_no_step_and_loses_none() {
        assert_eq!(FixedStep::from_time_step(8.0, 1.0 / 30.0).steps, 240);
        assert_eq!(FixedStep::from_time_step(1.0, 0.3).steps, 4);
        assert_eq!(FixedStep::from_time_step(0.3, 0.1).steps, 3);
        assert_eq!(FixedStep::from_limit(1.0, 0.3).steps, 4);
        assert!((FixedStep::from_limit(1.0, 0.3).time_step - 0.25).abs() < 1e-16);
        assert_eq!(FixedStep::from_time_step(0.0, 0.1).steps, 0);
    }

    #[test]
    fn a_time_is_reached_once() {
        let fixed = FixedStep::from_steps(8.0, 240);
        let reached: Vec<u64> = (0..=240).filter(|&n| fixed.reaches(n, 4.0)).collect();
        assert_eq!(reached, [120]);
        let late: Vec<u64> = (0..=240).filter(|&n| fixed.reaches(n, 4.01)).collect();
        assert_eq!(late, [121]);
    }
}
