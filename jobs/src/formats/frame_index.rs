//! ParaView's index of a job's frames: which file shows which time.

use serde_json::json;

/// Path among the job's files.
pub const PATH: &str = "frames.vtkhdf.series";
/// Media type of the index.
pub const MEDIA_TYPE: &str = "application/json";

/// The index of frames given by path and time, in order.
pub fn text<'a>(frames: impl Iterator<Item = (&'a str, Option<f64>)>) -> String {
    let files: Vec<_> = frames.map(|(path, time)| json!({"name": path, "time": time})).collect();
    json!({"file-series-version": "1.0", "files": files}).to_string()
}
