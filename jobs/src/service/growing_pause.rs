//! Pauses between tries that fail.

use std::time::{Duration, Instant};

/// Pauses between tries that fail: each is twice as long as the one before.
#[derive(Debug, Default)]
pub struct GrowingPause {
    length: Duration,
    until: Option<Instant>,
}

/// The first pause.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

impl GrowingPause {
    /// Whether the next try has to wait.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() < until)
    }

    /// A try has failed; the length of the pause that begins.
    pub fn begin(&mut self) -> Duration {
        self.length = (self.length * 2).clamp(SHORTEST_PAUSE, LONGEST_PAUSE);
        self.until = Some(Instant::now() + self.length);
        self.length
    }

    /// A try has succeeded.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::GrowingPause;

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
