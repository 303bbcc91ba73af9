//! How often a run measures, how far it cuts its steps, and when it counts as at rest.

/// Constants of the course of a run.
pub(super) struct Pacing {
    /// The most parts that a step may be cut into; beyond it the run fails. A run that needs more has particles far faster than
    /// the speed that its time step was chosen for.
    pub most_parts: f64,
    /// Steps in a row below the speed of rest after which a run is at rest.
    pub steps_of_rest: u64,
    /// The least number of steps between two measurements: each costs about as much as a step, and takes memory of its own.
    pub least_between: u64,
    /// Measurements of a run, about: enough for the means of its last fifth and the turns of its shape.
    pub measurements: u64,
}

pub(super) const PACING: Pacing = Pacing { most_parts: 64.0, steps_of_rest: 50, least_between: 16, measurements: 400 };

/// Steps from one measurement to the next in a run of `steps`, beside those that the series asks for.
#[must_use]
pub fn measurement_interval(steps: u64) -> u64 {
    (steps / PACING.measurements).max(PACING.least_between)
}

#[cfg(test)]
mod tests {
    use super::measurement_interval;

    #[test]
    fn long_runs_are_measured_about_400_times_and_short_ones_every_16_steps() {
        assert_eq!([1, 6400, 6800, 40_000].map(measurement_interval), [16, 16, 17, 100]);
    }
}
