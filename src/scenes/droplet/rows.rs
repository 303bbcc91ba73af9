//! The rows of `droplet`: PCP paper, sections 4.3 and 4.4.

use crate::scene::rows::Rows;
use serde_json::{Value, json};

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    Rows { document: "droplet", rows: Vec::new(), figures: Vec::new() }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    let wait = json!({"kind": "droplet", "spacing": 0.04, "end_time": 0.02});
    vec![
        wait,
        json!({"kind": "droplet", "case": "dividing", "spacing": 0.04, "end_time": 0.003}),
        json!({"kind": "droplet", "spacing": 0.05, "geometry": "colorfield", "end_time": 0.01}),
        json!({"kind": "droplet", "dimension": 3, "spacing": 0.1, "end_time": 0.005}),
    ]
}
