//! Differential operators on scattered points in space and on surfaces (DC-PSE and Surface DC-PSE).
//!
//! A chart ([`charts`]) gives the neighbors of a point and their coordinates. A fit ([`fits`]) solves the moment
//! conditions of a point with one factorization, and every operator is one more right-hand side. The weights become
//! sparse rows ([`construction`]) or are applied at once ([`evaluation`]). [`construct_star_rows`] makes rows on clouds from
//! outside, with fallbacks.

mod basis;
pub mod charts;
pub mod construction;
mod derivative_tensor;
pub mod evaluation;
pub mod fits;
mod moment_fit;
mod star_rows;

pub use charts::{Chart, FlatChart, Functional, NormalCopies, TangentChart};
pub use construction::{Construction, construct};
pub use derivative_tensor::{Tensor, derivative_tensor, divergence, sum_of_minors};
pub use evaluation::Evaluation;
pub use fits::{Support, SupportDiagnostics};
pub use star_rows::{EdgeRule, RowKind, StarCloud, StarRows, StarSupport, construct_star_rows};
