//! The embedding closest-point method (Ruuth and Merriman): the baseline that the Surface DC-PSE paper compares with (section
//! 4.1). A field is extended to a band of grid nodes by interpolation at their closest points, differentiated there, and
//! interpolated back to the points of the surface.

mod band;
mod format_1;
mod frame_fields;
pub mod quantities;
mod simulation;
mod surface_data;

pub use simulation::{EmbeddingClosestPoint, EmbeddingParts};
pub use surface_data::SurfaceData;
