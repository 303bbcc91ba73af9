//! The rows of `front`, and of `vortex` with grid-based particles: GBPM paper, section 4.

use crate::scene::rows::Rows;
use serde_json::{Value, json};

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    Rows { document: "front", rows: Vec::new(), figures: Vec::new() }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    vec![json!({"kind": "front"})]
}
