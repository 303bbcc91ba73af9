//! Differential operators on scattered points, as sparse rows.
//!
//! One construction ([`construction`]) serves all: a chart says which points lie about a point and what their
//! coordinates are ([`charts`]), polynomials of these ([`basis`]) are fitted with one factorization a point
//! ([`moment_fit`]), and every functional asked for is one more right-hand side.

mod basis;
pub mod charts;
pub mod construction;
mod moment_fit;

pub use charts::{Chart, FlatChart, Functional, NormalCopies, TangentChart};
pub use construction::{Construction, Soundness, Support, construct};
