//! Surfaces that are known by level functions: sampled finely once, then closest points by Newton's method from near samples.
//!
//! Each patch is a small piece of the surface about a seed: a face where one level is zero, or in space an edge where two
//! are, or a corner. A bound tells which patches can hold the closest point. Newton's method finds it to round-off.

pub(super) mod line_volume;
pub(super) mod newton;
pub(super) mod patches;
pub(super) mod trace;
pub(super) mod volume;

pub(super) use newton::{LocalFoot, local_foot};
pub(super) use patches::{BULGE, Found, LEAST_BULGE, Patch, PatchSet, medial_distance, radius_in_ball};

use super::Vector;
