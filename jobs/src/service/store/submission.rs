//! Making jobs: one, or all of a study, together with the answer to the request.

use super::idempotency::{self, IdempotencyKey, Made, Receipt};
use super::service_clock::AGING_S;
use super::transitions::{self, ChangeError};
use super::{JobRow, Store, StoreError, dependencies, events, remove_directory, rows};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::attempt_spec::{AttemptSpec, Submission};
use crate::spec::body::{JobBody, JobSpec, Origin, ResolvedBody};
use crate::spec::states::State;
use crate::spec::work_precision;
use crate::system::digest;
use meniscus::spec::Given;
use rusqlite::{Transaction, params};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::Path;

/// A job to be made, as it will stand in the store.
#[derive(Debug, Clone)]
pub struct NewJob {
    pub(super) name: Option<String>,
    pub(super) labels: String,
    pub(super) kind: String,
    pub(super) spec: String,
    pub(super) resolved: String,
    /// Digest of the resolved scene.
    pub(super) scene_sha256: Option<String>,
    pub(super) estimate: String,
    /// What is doubtful before it runs.
    pub(super) warnings: String,
    pub(super) memory_bytes: u64,
    /// Bytes that its files will take.
    pub disk_bytes: u64,
    pub(super) priority: i64,
    pub(super) origin: Option<Origin>,
    pub(super) uploads: Vec<String>,
    /// The study that it is a point of, with the point's number.
    pub study: Option<(String, u64)>,
    /// The job that it repeats.
    pub retry_of: Option<String>,
    /// Name of the token that makes it; None without tokens.
    pub owner: Option<String>,
    /// Jobs that must have succeeded before it starts.
    pub predecessors: Vec<String>,
    /// The study of its own that finds its spacing; it has no resolved body before.
    pub awaits: Option<String>,
    /// Digest of the scene without its spacing, and the spacing, where that is known.
    pub(super) problem: Option<(String, f64)>,
}

impl NewJob {
    /// A job that is no point of a study, from its parsed body.
    #[must_use]
    pub fn from_body(body: &JobBody) -> Self {
        Self {
            name: body.resolved.name.clone(),
            labels: json!(body.resolved.labels).to_string(),
            kind: body.kind.clone(),
            spec: body.spec.to_string(),
            resolved: body.resolved.to_json().to_string(),
            scene_sha256: Some(scene_sha256(&body.resolved.scene)),
            estimate: json!(body.forecast.record()).to_string(),
            warnings: json!(body.scene.warnings()).to_string(),
            memory_bytes: body.forecast.memory_bytes,
            disk_bytes: body.forecast.disk_bytes,
            priority: body.resolved.priority,
            origin: body.origin.clone(),
            uploads: body.uploads.clone(),
            study: None,
            retry_of: None,
            owner: None,
            predecessors: body.predecessors.clone(),
            awaits: None,
            problem: problem_of(body),
        }
    }

    /// A job whose spacing a study is to find. What follows from the spacing is not known yet.
    #[must_use]
    pub fn waiting(body: &JobBody) -> Self {
        Self {
            resolved: "null".to_owned(),
            scene_sha256: None,
            estimate: "{}".to_owned(),
            warnings: "[]".to_owned(),
            memory_bytes: 0,
            disk_bytes: 0,
            ..Self::from_body(body)
        }
    }

    /// The job of an attempt whose database was lost.
    ///
    /// # Errors
    /// When the resolved body cannot be read.
    pub(super) fn from_attempt(spec: &AttemptSpec) -> Result<Self, StoreError> {
        let body = ResolvedBody::deserialize(&spec.body)?;
        let Submission { spec: sent, forecast, warnings, owner, study, retry_of, .. } =
            spec.submission.clone().unwrap_or_default();
        let sent = if sent.is_null() { &spec.body } else { &sent };
        Ok(Self {
            name: body.name,
            labels: json!(body.labels).to_string(),
            kind: SceneWord::deserialize(&body.scene)?.kind,
            spec: sent.to_string(),
            resolved: spec.body.to_string(),
            scene_sha256: Some(scene_sha256(&body.scene)),
            estimate: json!(forecast).to_string(),
            warnings: json!(warnings).to_string(),
            memory_bytes: forecast.memory_bytes,
            disk_bytes: forecast.disk_bytes,
            priority: body.priority,
            origin: None,
            uploads: spec.inputs.keys().cloned().collect(),
            study,
            retry_of,
            owner,
            predecessors: Vec::new(),
            awaits: None,
            problem: None,
        })
    }
}

/// Digest of the scene as sent without its spacing, and the spacing; None of a restart, which begins in the middle.
fn problem_of(body: &JobBody) -> Option<(String, f64)> {
    let sent = body.spec.as_object().map(|spec| Given::new(spec).raw(JobSpec::scene()))?;
    work_precision::problem_of(&sent).zip(body.scene.spacing())
}

/// Digest of a resolved scene, as the provenance of reports has it.
#[must_use]
pub fn scene_sha256(scene: &Value) -> String {
    digest::of_bytes(scene.to_string().as_bytes())
}

/// The kind of a scene.
#[derive(Deserialize)]
struct SceneWord {
    kind: String,
}

/// Name of a restart's checkpoint in the new job's directory.
pub const START_CHECKPOINT: &str = "start.h5";

impl Store {
    /// Makes a job; it is durable when this returns. The receipt of the new job is kept under the client's key in the same
    /// transaction.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn submit(
        &self,
        job: NewJob,
        key: Option<IdempotencyKey>,
        receipt: impl FnOnce(JobRow) -> Receipt + Send + 'static,
    ) -> Result<Made, StoreError> {
        let (number, clock_s) = self.next_submission();
        let id = format!("job_{number}");
        let start = self.prepare_start(&id, &job)?;
        let (sha256, new) = (start.clone(), id.clone());
        let made = self.write_in_group(Box::new(move |transaction| {
            idempotency::make_once(transaction, key.as_ref(), |transaction| {
                insert(transaction, &Place { id: &new, clock_s }, &job, sha256.as_deref())?;
                let row = rows::job(transaction, &new)?.ok_or(rusqlite::Error::QueryReturnedNoRows)?;
                Ok(receipt(row))
            })
        }));
        if start.is_some() && !matches!(made, Ok(Made::New(_))) {
            remove_directory(&self.job_directory(&id))?;
        }
        made
    }

    /// Links the checkpoint that a job begins with into its directory, so that deleting the source takes nothing away;
    /// its digest. None for a job that begins afresh.
    pub(super) fn prepare_start(&self, id: &str, job: &NewJob) -> Result<Option<String>, StoreError> {
        let (source, sha256) = match &job.origin {
            // The last checkpoint of a job that has not ended is linked when this job starts.
            None | Some(Origin::Job(_)) => return Ok(None),
            Some(Origin::Checkpoint(checkpoint)) => {
                let row = self.checkpoint(checkpoint)?.ok_or(StoreError::CheckpointGone)?;
                let attempt = attempt_directory(&self.job_directory(&row.job), row.attempt);
                (attempt.join(&row.path), row.sha256)
            }
            Some(Origin::Upload(upload)) => {
                let row = self.upload(upload)?.ok_or(StoreError::CheckpointGone)?;
                (self.upload_directory(upload).join(super::uploads::CONTENT), row.sha256)
            }
        };
        self.link_start(id, &source)?;
        Ok(Some(sha256))
    }

    /// Links a checkpoint into the directory of the job that begins with it.
    fn link_start(&self, id: &str, source: &Path) -> Result<(), StoreError> {
        let folder = self.job_directory(id);
        std::fs::create_dir_all(&folder)?;
        let target = folder.join(START_CHECKPOINT);
        // Its row may have been there a moment ago and its file be gone by now.
        if std::fs::hard_link(source, &target).is_err() && std::fs::copy(source, &target).is_err() {
            remove_directory(&folder)?;
            return Err(StoreError::CheckpointGone);
        }
        Ok(crate::system::artifacts::sync_directory(&folder)?)
    }

    /// Gives a job that begins with the last checkpoint of another one that checkpoint, when it starts.
    ///
    /// # Errors
    /// [`StoreError::CheckpointGone`] where there is none any more.
    pub fn take_last_checkpoint(&self, job: &JobRow) -> Result<JobRow, StoreError> {
        let Some(predecessor) = job.restart_job.as_ref().filter(|_| job.restarted_from.is_none()) else {
            return Ok(job.clone());
        };
        let newest = self.checkpoints(predecessor)?.into_iter().next().ok_or(StoreError::CheckpointGone)?;
        let target = self.job_directory(&job.id).join(START_CHECKPOINT);
        if target.exists() {
            std::fs::remove_file(&target)?;
        }
        self.link_start(
            &job.id,
            &attempt_directory(&self.job_directory(predecessor), newest.attempt).join(&newest.path),
        )?;
        self.write(|transaction| -> Result<(), StoreError> {
            transaction.execute(
                "UPDATE jobs SET restarted_from = ?2, restart_sha256 = ?3 WHERE id = ?1",
                params![job.id, newest.id, newest.sha256],
            )?;
            Ok(())
        })?;
        self.job(&job.id)?.ok_or(StoreError::CheckpointGone)
    }
}

/// Place of a new job among all jobs.
pub(super) struct Place<'a> {
    /// Id of the job.
    pub(super) id: &'a str,
    /// Reading of the clock of the data directory at its submission, in seconds.
    pub(super) clock_s: f64,
}

/// Writes the row, the first event and the inputs of a job.
pub(super) fn insert(
    transaction: &Transaction,
    place: &Place,
    job: &NewJob,
    start_sha256: Option<&str>,
) -> Result<(), StoreError> {
    let id = place.id;
    let (study, index) = job.study.as_ref().map_or((None, None), |(study, index)| (Some(study), Some(*index as i64)));
    transaction
        .prepare_cached(
            "INSERT INTO jobs (id, rev, state, name, labels, kind, spec, resolved, estimate, priority, created_at,
                 restarted_from, restart_sha256, study, study_index, retry_of, rank, memory_bytes, disk_bytes, warnings,
                 owner, predecessors, restart_job, scene_sha256, awaits, problem, spacing)
             VALUES (?1, 1, 'queued', ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19,
                 ?20, ?21, ?22, ?23, ?24, ?25)",
        )?
        .execute(params![
            id,
            job.name,
            job.labels,
            job.kind,
            job.spec,
            job.resolved,
            job.estimate,
            job.priority,
            crate::system::clock::now(),
            job.origin.as_ref().filter(|origin| !matches!(origin, Origin::Job(_))).map(Origin::id),
            start_sha256,
            study,
            index,
            job.retry_of,
            place.clock_s - job.priority as f64 * AGING_S,
            i64::try_from(job.memory_bytes).unwrap_or(i64::MAX),
            i64::try_from(job.disk_bytes).unwrap_or(i64::MAX),
            job.warnings,
            job.owner,
            serde_json::to_string(&job.predecessors)?,
            job.origin.as_ref().filter(|origin| matches!(origin, Origin::Job(_))).map(Origin::id),
            job.scene_sha256,
            job.awaits,
            job.problem.as_ref().map(|(problem, _)| problem),
            job.problem.as_ref().map(|(_, spacing)| spacing),
        ])?;
    enter_inputs(transaction, id, &job.uploads)?;
    if let Some(old) = &job.retry_of {
        transaction.execute("UPDATE jobs SET superseded = 1 WHERE id = ?1", [old])?;
    }
    let data = json!({"from": Value::Null, "to": State::Queued.word()});
    events::append(transaction, id, study.map(String::as_str), 0, "state", &data)?;
    if let Some(lost) = dependencies::enter(transaction, id, &job.predecessors)?
        && let Err(ChangeError::Store(error)) = transitions::give_up(transaction, id, &lost)
    {
        return Err(error);
    }
    Ok(())
}

/// Enters the uploads that a job takes points from.
fn enter_inputs(transaction: &Transaction, id: &str, uploads: &[String]) -> Result<(), StoreError> {
    for upload in uploads {
        let known = transaction
            .prepare_cached("INSERT OR IGNORE INTO inputs SELECT ?1, id FROM uploads WHERE id = ?2")?
            .execute(params![id, upload])?;
        if known == 0 {
            return Err(StoreError::UploadGone);
        }
    }
    Ok(())
}

#[cfg(test)]
impl Store {
    /// Makes a job for a test.
    pub(crate) fn submit_row(&self, body: &JobBody) -> JobRow {
        let receipt = |row: JobRow| Receipt(row.id.into_bytes());
        match self.submit(NewJob::from_body(body), None, receipt).unwrap() {
            Made::New(Receipt(id)) => self.job(&String::from_utf8(id).unwrap()).unwrap().unwrap(),
            other => panic!("{other:?}"),
        }
    }
}
