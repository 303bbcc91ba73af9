//! Ground that all processes share: files, digests, the clock, what the operating system says.

pub mod artifacts;
pub mod breakpoints;
pub mod build;
pub mod clock;
pub mod digest;
pub mod lock;
pub mod process;
