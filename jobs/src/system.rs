//! What all processes share: files, digests, the clock, facts of the operating system.

pub mod artifacts;
pub mod breakpoints;
pub mod build;
pub mod clock;
pub mod digest;
pub mod lock;
pub mod process;
