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

/// Pauses between tries that fail: each is twice as long as the one before.
#[derive(Debug, Default)]
pub(super) struct GrowingPause {
    length: Duration,
    until: Option<Instant>,
}

/// The first pause.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

impl GrowingPause {
    /// Whether the next try has to wait.
    pub(super) fn is_on(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() < until)
    }

    /// A try has failed; the length of the pause that begins.
    pub(super) fn begin(&mut self) -> Duration {
        self.length = (self.length * 2).clamp(SHORTEST_PAUSE, LONGEST_PAUSE);
        self.until = Some(Instant::now() + self.length);
        self.length
    }

    /// A try has succeeded.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::{GrowingPause, PatientClock};
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

    #[test]
    fn pauses_grow_to_a_minute_and_begin_anew() {
        let mut pause = GrowingPause::default();
        let lengths: Vec<u64> = (0..8).map(|_| pause.begin().as_secs()).collect();
        assert_eq!(lengths, [1, 2, 4, 8, 16, 32, 60, 60]);
        assert!(pause.is_on());
        pause.reset();
        assert!(!pause.is_on());
    }
}
