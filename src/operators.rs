//! Differential operators on scattered points, as sparse rows.

pub mod stencil_operator;
pub mod surface_dcpse;
mod tangent_basis;

pub use stencil_operator::StencilOperator;
pub use surface_dcpse::{Soundness, Support, SurfaceDcpse};
