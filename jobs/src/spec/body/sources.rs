//! What a body may name beside itself: checkpoints and uploads.

use super::RestartSource;
use crate::spec::uploads::Purpose;
use meniscus::scene::{CloudReference, CloudSource};
use meniscus::spec::Violation;
use serde_json::{Value, json};

/// Knows checkpoints and uploads.
pub trait Sources {
    /// What a restart from a checkpoint needs to know.
    fn checkpoint(&self, id: &str) -> Option<RestartSource>;

    /// The same of an uploaded checkpoint that has passed its check.
    fn uploaded_checkpoint(&self, id: &str) -> Option<RestartSource>;

    /// Purpose of an upload that has passed its check, and the number of points in it.
    fn uploaded_points(&self, id: &str) -> Option<(Purpose, u64)>;
}

/// Knows nothing.
#[derive(Debug, Clone, Copy)]
pub struct NoSources;

impl Sources for NoSources {
    fn checkpoint(&self, _: &str) -> Option<RestartSource> {
        None
    }

    fn uploaded_checkpoint(&self, _: &str) -> Option<RestartSource> {
        None
    }

    fn uploaded_points(&self, _: &str) -> Option<(Purpose, u64)> {
        None
    }
}

/// How many points a scene is going to get from somewhere, where that is known.
pub(super) fn size_of(
    cloud: &CloudReference,
    sources: &dyn Sources,
    local_files: bool,
) -> Result<Option<u64>, Violation> {
    match &cloud.source {
        CloudSource::File(_) if local_files => Ok(None),
        CloudSource::File(file) => {
            let detail = "a local file is valid for `meniscus run` alone; POST /v1/uploads takes files";
            Err(Violation::new(cloud.pointer, "not_here", detail, file.as_str(), json!({"upload": "upl_…"})))
        }
        CloudSource::Upload(upload) => {
            // Points with a level are good as places to ask about, too; places have no level.
            let wanted: &[Purpose] = match cloud.pointer {
                "/queries" => &[Purpose::Queries, Purpose::Points, Purpose::Surface],
                "/surface" => &[Purpose::Surface],
                _ => &[Purpose::Points],
            };
            let found = sources.uploaded_points(upload).filter(|(purpose, _)| wanted.contains(purpose));
            let names: Vec<String> = wanted.iter().map(|purpose| format!("?as={}", purpose.word())).collect();
            let detail =
                format!("there is no upload of this id that is ready and was made with {}", names.join(" or "));
            let missing = || Violation::new(cloud.pointer, "not_found", detail, upload.as_str(), Value::Null);
            found.map(|(_, points)| Some(points)).ok_or_else(missing)
        }
    }
}
