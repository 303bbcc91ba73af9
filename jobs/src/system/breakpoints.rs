//! Named places where tests end a process, to show that nothing is lost between any two operations. Only builds with
//! debug assertions have them.

use std::fs::OpenOptions;
use std::sync::atomic::{AtomicU64, Ordering};

/// Passages of the place that is wanted, so far.
static PASSED: AtomicU64 = AtomicU64::new(0);

/// Passes a place. `MENISCUS_BREAK=NAME:N:FILE` ends the process, as `kill -9` would, at the N-th passage of NAME, once:
/// FILE is made then, and where it is there already nothing happens any more.
pub fn pass(name: &str) {
    if !cfg!(debug_assertions) {
        return;
    }
    let Ok(wanted) = std::env::var("MENISCUS_BREAK") else { return };
    let mut parts = wanted.splitn(3, ':');
    let (Some(place), Some(number), Some(file)) = (parts.next(), parts.next(), parts.next()) else { return };
    if place != name || Some(PASSED.fetch_add(1, Ordering::Relaxed) + 1) != number.parse().ok() {
        return;
    }
    if OpenOptions::new().write(true).create_new(true).open(file).is_ok() {
        let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    }
}
