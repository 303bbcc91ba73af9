//! Formulas that users write: read with places of errors, differentiated exactly, evaluated over many points at once.
//!
//! A text becomes an [`expression::Graph`] ([`grammar`]); equal terms are kept once. Partial derivatives are further nodes
//! of the same graph ([`derivative`]). A [`Program`] is the graph of some outputs in order; it evaluates a block of points
//! step by step, so that a step costs its arithmetic alone.

mod bound;
mod derivative;
mod error;
mod expression;
mod functions;
mod grammar;
mod lanes;
mod program;
mod scanner;
mod spec;

pub use bound::{Bound, Context, Fault};
pub use error::FormulaError;
pub use expression::Graph;
pub use functions::FUNCTIONS;
pub use grammar::{MOST_BYTES, Names, check_syntax, why_not_a_name};
pub use program::{BLOCK, Input, Program, Workspace};
pub use spec::{FormulaList, FormulaLists, FormulaText, NamedNumbers, constants};
