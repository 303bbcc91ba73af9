//! Time as the supervisor experiences it, by which leases and grace periods are judged.
//!
//! Where this process or the whole machine stood still (SIGSTOP, a suspended laptop, a frozen virtual machine), no heartbeat
//! could be sent and no request followed. A round that comes late counts as one second.

use std::time::{Duration, Instant};

/// Time that a round counts for at most.
const LONGEST_ROUND: Duration = Duration::from_secs(1);

/// A clock that counts rounds of the supervisor.
#[derive(Debug)]
pub(super) struct PatientClock {
    now: Duration,
    last_round: Instant,
}

impl PatientClock {
    /// A clock at zero.
    pub(super) fn new() -> Self {
        Self { now: Duration::ZERO, last_round: Instant::now() }
    }

    /// Begins a round.
    pub(super) fn begin_round(&mut self) {
        self.now += self.last_round.elapsed().min(LONGEST_ROUND);
        self.last_round = Instant::now();
    }

    /// Its reading at the present round.
    pub(super) fn now(&self) -> Duration {
        self.now
    }
}

#[cfg(test)]
mod tests {
    use super::PatientClock;
    use std::time::Duration;

    #[test]
    fn a_round_that_comes_late_counts_as_a_second() {
        let mut clock = PatientClock::new();
        std::thread::sleep(Duration::from_millis(1300));
        clock.begin_round();
        assert_eq!(clock.now(), Duration::from_secs(1));
        clock.begin_round();
        assert!(clock.now() < Duration::from_millis(1300));
    }
}
