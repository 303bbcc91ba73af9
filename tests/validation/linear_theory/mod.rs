//! Exact linear theory of oscillating drops, independent of the project's methods.
//!
//! All fluids are viscous and incompressible, amplitudes are small, and the outer fluid has no walls unless a
//! function says so. The module uses nothing but `nalgebra::Complex`; units are those of the caller.

mod bessel_ratios;
pub mod drop_mode;
