//! What a series of levels, each finer than the one before, says of its limit: observed order, extrapolated value, grid
//! convergence index, kind of convergence, and what a smaller error will cost.
//!
//! Sources (docs/bibliography.md): Roache 1994 for the grid convergence index and its safety factors; Celik 2008 for the order of
//! three levels of any ratio; Stern 2001 for the estimate where values oscillate; Eça 2014 for weighted fits over more levels.
//!
//! Levels are plain numbers here: a spacing, a value, CPU seconds. Which run they came from is not known.

mod assessment;
mod cost;
mod fits;
mod order;

pub use assessment::{Assessment, Convergence, Target, assess};
pub use cost::Cost;
pub use fits::Parabola;
pub use order::Order;

/// What the values of the levels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// Errors against an exact answer: their limit is zero.
    Error,
    /// Values whose limit is not known.
    Value,
}

/// One level that was run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Spacing h.
    pub spacing: f64,
    /// The value, or the error.
    pub value: f64,
    /// CPU seconds of the run.
    pub cpu_s: f64,
}
