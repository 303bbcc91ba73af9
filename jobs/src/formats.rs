//! Files that others read or write: VTKHDF frames, CSV series, SVG pictures, meshes and points.

pub mod chart;
pub mod checkpoint;
pub mod cloud_file;
pub mod csv;
mod file_bytes;
mod flow_file;
pub mod frame_index;
pub mod frame_view;
pub mod hdf5_file;
mod image;
pub mod measured_level;
pub mod mesh;
pub mod operator_files;
pub mod outside_file;
pub mod picture;
mod points_file;
pub mod quantity_reader;
pub mod speed_error;
pub mod structure;
pub mod surface_view;
mod values_file;
mod vti;
pub mod vtkhdf;
mod vtkhdf_image;
pub mod vtkhdf_points;
