//! Where the CPU time goes. The engine reads no clock of its own: it is handed a counter of CPU seconds.

use std::collections::BTreeMap;

/// A counter of CPU seconds of the whole process; the engine takes differences only.
#[derive(Debug, Clone, Copy)]
pub struct CpuClock(pub fn() -> f64);

impl CpuClock {
    /// A counter that stands still, for tests.
    #[must_use]
    pub fn still() -> Self {
        Self(|| 0.0)
    }
}

/// Exclusive CPU seconds by phase, under path-like names.
#[derive(Debug, Clone)]
pub struct Phases {
    clock: CpuClock,
    seconds: BTreeMap<&'static str, f64>,
}

impl Phases {
    /// No CPU seconds spent yet.
    #[must_use]
    pub fn new(clock: CpuClock) -> Self {
        Self { clock, seconds: BTreeMap::new() }
    }

    /// Runs work and books its CPU time. Phases must not nest.
    pub fn measure<R>(&mut self, name: &'static str, work: impl FnOnce() -> R) -> R {
        let start = (self.clock.0)();
        let result = work();
        self.book(name, (self.clock.0)() - start);
        result
    }

    /// Books CPU seconds that were measured by [`Self::clock`].
    pub fn book(&mut self, name: &'static str, seconds: f64) {
        *self.seconds.entry(name).or_insert(0.0) += seconds;
    }

    /// The counter of CPU seconds.
    #[must_use]
    pub fn clock(&self) -> fn() -> f64 {
        self.clock.0
    }

    /// Names and seconds in the order of names.
    #[must_use]
    pub fn seconds(&self) -> &BTreeMap<&'static str, f64> {
        &self.seconds
    }
}
