//! What a body may name beside itself: checkpoints, uploads and jobs.

use crate::spec::states::State;
use crate::spec::uploads::Purpose;
use meniscus::scene::{CloudReference, CloudRole, CloudSize, CloudSource};
use meniscus::spec::Violation;
use serde_json::{Value, json};
use std::convert::Infallible;

/// Where the checkpoint of a restart lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// With the job that wrote it.
    Checkpoint(String),
    /// Among the uploads.
    Upload(String),
    /// With a job that has not ended: the last one that it will have.
    Job(String),
}

impl Origin {
    /// Id of the checkpoint or of the upload.
    #[must_use]
    pub fn id(&self) -> &str {
        match self {
            Self::Checkpoint(id) | Self::Upload(id) | Self::Job(id) => id,
        }
    }
}

/// A job that a body names, as the store knows it.
#[derive(Debug, Clone)]
pub struct JobSource {
    /// State of the job.
    pub state: State,
    /// Its resolved scene.
    pub scene: Value,
    /// Its last checkpoint so far.
    pub checkpoint: Option<RestartSource>,
}

/// The checkpoint that a restart begins with, as the store knows it.
#[derive(Debug, Clone)]
pub struct RestartSource {
    /// Where it lies.
    pub origin: Origin,
    /// The resolved scene of the job that wrote it.
    pub scene: Value,
    /// Instruction set it was written on.
    pub isa: String,
    /// Step of the checkpoint.
    pub step: u64,
}

/// Looks up the checkpoints, uploads and jobs that bodies name.
pub trait Sources {
    /// Why a look-up failed. It does not say that there is no such id.
    type Error;

    /// What a restart from a checkpoint needs to know; None where there is no such checkpoint.
    ///
    /// # Errors
    /// When the look-up fails.
    fn checkpoint(&self, id: &str) -> Result<Option<RestartSource>, Self::Error>;

    /// A job; None where there is no such job.
    ///
    /// # Errors
    /// When the look-up fails.
    fn job(&self, id: &str) -> Result<Option<JobSource>, Self::Error>;

    /// The same of an uploaded checkpoint that has passed its inspection.
    ///
    /// # Errors
    /// When the look-up fails.
    fn uploaded_checkpoint(&self, id: &str) -> Result<Option<RestartSource>, Self::Error>;

    /// Purpose of an upload that has passed its inspection, and the size of the points in it.
    ///
    /// # Errors
    /// When the look-up fails.
    fn uploaded_points(&self, id: &str) -> Result<Option<(Purpose, CloudSize)>, Self::Error>;
}

/// No checkpoints, no uploads and no jobs.
#[derive(Debug, Clone, Copy)]
pub struct NoSources;

impl Sources for NoSources {
    type Error = Infallible;

    fn checkpoint(&self, _: &str) -> Result<Option<RestartSource>, Infallible> {
        Ok(None)
    }

    fn job(&self, _: &str) -> Result<Option<JobSource>, Infallible> {
        Ok(None)
    }

    fn uploaded_checkpoint(&self, _: &str) -> Result<Option<RestartSource>, Infallible> {
        Ok(None)
    }

    fn uploaded_points(&self, _: &str) -> Result<Option<(Purpose, CloudSize)>, Infallible> {
        Ok(None)
    }
}

/// Why a body was not parsed.
#[derive(Debug)]
pub enum BodyError<E> {
    /// Everything that is wrong with it.
    Invalid(Vec<Violation>),
    /// A checkpoint or an upload that it names could not be looked up.
    Lookup(E),
}

impl<E> From<Vec<Violation>> for BodyError<E> {
    fn from(violations: Vec<Violation>) -> Self {
        Self::Invalid(violations)
    }
}

impl BodyError<Infallible> {
    /// Everything that is wrong with the body, where look-ups cannot fail.
    #[must_use]
    pub fn violations(self) -> Vec<Violation> {
        match self {
            Self::Invalid(violations) => violations,
            Self::Lookup(never) => match never {},
        }
    }
}

/// How many points a scene is going to get from somewhere, where that is known.
///
/// # Errors
/// When the look-up fails; the inner error is what is wrong with the reference.
pub(super) fn size_of<S: Sources>(
    cloud: &CloudReference,
    sources: &S,
    local_files: bool,
) -> Result<Result<Option<CloudSize>, Violation>, S::Error> {
    Ok(match &cloud.source {
        CloudSource::File(_) if local_files => Ok(None),
        CloudSource::File(file) => {
            let detail = "a local file is valid for `meniscus run` alone; upload it and name the upload";
            Err(Violation::new(cloud.pointer, "not_here", detail, file.as_str(), json!({"upload": "upl_…"})))
        }
        CloudSource::Upload(upload) => {
            // Points with a level are good as places to ask about, too; places have no level.
            let wanted: &[Purpose] = match cloud.role {
                CloudRole::Queries => &[Purpose::Queries, Purpose::Points, Purpose::Surface],
                CloudRole::Surface => &[Purpose::Surface],
                CloudRole::Points => &[Purpose::Points],
                CloudRole::Mesh => &[Purpose::Mesh],
                CloudRole::Values => &[Purpose::Values],
                CloudRole::Flow => &[Purpose::Flow],
            };
            let found = sources.uploaded_points(upload)?.filter(|(purpose, _)| wanted.contains(purpose));
            let names: Vec<&str> = wanted.iter().map(|purpose| purpose.word()).collect();
            let detail = format!("there is no upload of this id that is ready and was made as {}", names.join(" or "));
            let missing = || Violation::new(cloud.pointer, "not_found", detail, upload.as_str(), Value::Null);
            found.map(|(_, size)| Some(size)).ok_or_else(missing)
        }
    })
}
