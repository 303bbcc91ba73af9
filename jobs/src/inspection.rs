//! A short-lived process that looks into one uploaded file, under limits.

pub mod look;
pub mod sandbox;
