//! Differential operators on scattered points, as sparse rows.
//!
//! One kind of fit ([`fits`]) serves all: a chart says which points lie about a point and what their
//! coordinates are ([`charts`]), polynomials of these ([`basis`]) are fitted with one factorization a point
//! ([`moment_fit`]), and every functional asked for is one more
//! right-hand side. Weights become rows ([`construction`]), or are used at once ([`evaluation`]).

mod basis;
pub mod charts;
pub mod construction;
mod derivative_tensor;
pub mod evaluation;
pub mod fits;
mod moment_fit;

pub use charts::{Chart, FlatChart, Functional, NormalCopies, TangentChart};
pub use construction::{Construction, construct};
pub use derivative_tensor::{Tensor, derivative_tensor, divergence, sum_of_minors};
pub use evaluation::Evaluation;
pub use fits::{Support, SupportDiagnostics};
