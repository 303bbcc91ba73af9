//! Changing the state of a job: the table of [`crate::spec::states`] applied as a compare-and-set.

use super::service_clock::AGING_S;
use super::{JobRow, Store, StoreError, dependencies, events, rows, study_limits};
use crate::spec::body::Amended;
use crate::spec::states::{Reason, State, Trigger};
use rusqlite::{OptionalExtension, Transaction, params};
use serde_json::json;

/// Why a change was not made.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// There is no such job.
    #[error("there is no such job")]
    NotFound,
    /// The table has no such row.
    #[error("a job that is {} cannot {}", .0.word(), .1.word())]
    Illegal(State, Trigger),
    /// The job's epoch or revision has moved on.
    #[error("the job has moved on")]
    Stale,
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl From<rusqlite::Error> for ChangeError {
    fn from(error: rusqlite::Error) -> Self {
        Self::Store(error.into())
    }
}

/// A change to make.
#[derive(Debug, Clone, Default)]
pub struct Change {
    /// Reason of the new state.
    pub reason: Option<Reason>,
    /// Numbers and places of a failure, in a sentence.
    pub message: Option<String>,
    /// What a user can do, where it is not the hint of the reason.
    pub hint: Option<String>,
    /// If given, the change is made only while the job is at this attempt.
    pub epoch: Option<u64>,
}

impl Change {
    /// A change with a reason.
    #[must_use]
    pub fn because(reason: Reason) -> Self {
        Self { reason: Some(reason), ..Self::default() }
    }
}

impl Store {
    /// Applies a trigger to a job.
    ///
    /// # Errors
    /// [`ChangeError`].
    pub fn change(&self, id: &str, trigger: Trigger, change: &Change) -> Result<JobRow, ChangeError> {
        self.write(|transaction| {
            apply(transaction, id, trigger, change)?;
            rows::job(transaction, id)?.ok_or(ChangeError::NotFound)
        })
    }

    /// Takes the next job of the queue whose memory and disk (in bytes) fit and whose study has a free place, as a new
    /// attempt. Durable before any worker starts.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn claim(&self, fits: impl Fn(u64, u64) -> bool) -> Result<Option<JobRow>, StoreError> {
        let next: Option<String> = {
            let connection = self.read();
            let full = study_limits::without_a_free_place(&connection)?;
            // The index of the queue has every column that is asked for.
            let mut statement = connection.prepare_cached(
                "SELECT id, study, memory_bytes, disk_bytes FROM jobs
                     WHERE state = 'queued' AND NOT EXISTS (SELECT 1 FROM dependencies WHERE job = jobs.id)
                     ORDER BY rank, id",
            )?;
            let mut found = None;
            let mut rows = statement.query([])?;
            while let Some(row) = rows.next()? {
                let study: Option<String> = row.get(1)?;
                let is_held_back = study.is_some_and(|study| full.contains(&study));
                if !is_held_back && fits(row.get::<_, i64>(2)? as u64, row.get::<_, i64>(3)? as u64) {
                    found = Some(row.get(0)?);
                    break;
                }
            }
            found
        };
        let Some(id) = next else { return Ok(None) };
        match self.change(&id, Trigger::Claim, &Change::default()) {
            Ok(job) => Ok(Some(job)),
            // Canceled or paused in between.
            Err(ChangeError::Illegal(..) | ChangeError::NotFound | ChangeError::Stale) => Ok(None),
            Err(ChangeError::Store(error)) => Err(error),
        }
    }

    /// State of a job; None where there is no such job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn state(&self, id: &str) -> Result<Option<State>, StoreError> {
        let connection = self.read();
        let word: Option<String> = connection
            .prepare_cached("SELECT state FROM jobs WHERE id = ?1")?
            .query_row([id], |row| row.get(0))
            .optional()?;
        Ok(word.as_deref().and_then(State::from_word))
    }

    /// Jobs that should have a worker, and those cut off between two states.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn unfinished_attempts(&self) -> Result<Vec<JobRow>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(&rows::select_jobs(
            "state IN ('running', 'pausing', 'canceling', 'interrupted') ORDER BY id",
        ))?;
        let rows = statement.query_map([], rows::job_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Paused jobs with a reason.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn paused_for(&self, reason: Reason) -> Result<Vec<JobRow>, StoreError> {
        let connection = self.read();
        let mut statement =
            connection.prepare_cached(&rows::select_jobs("state = 'paused' AND reason = ?1 ORDER BY id"))?;
        let rows = statement.query_map([reason.word()], rows::job_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Writes down why the worker of an attempt is about to be killed.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn note_kill(&self, id: &str, epoch: u64, reason: Reason) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction
                .prepare_cached("UPDATE jobs SET kill_reason = ?3 WHERE id = ?1 AND attempt = ?2")?
                .execute(params![id, epoch as i64, reason.word()])?;
            Ok(())
        })
    }

    /// Marks a paused job as paused on request: it must not resume by itself.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn keep_paused(&self, id: &str) -> Result<(), StoreError> {
        self.keep_paused_where("id", id)
    }

    /// Does so for every job with a value in a column.
    pub(super) fn keep_paused_where(&self, column: &str, value: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            let reason = Reason::UserPause;
            transaction.execute(
                &format!(
                    "UPDATE jobs SET rev = rev + 1, reason = ?2, hint = ?3
                     WHERE {column} = ?1 AND state = 'paused' AND reason IS NOT ?2"
                ),
                params![value, reason.word(), reason.hint()],
            )?;
            Ok(())
        })
    }

    /// Notes what an attempt waits for in its executor's queue; None once it works.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn note_waiting(&self, id: &str, epoch: u64, waiting_for: Option<&str>) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction
                .prepare_cached(
                    "UPDATE jobs SET waiting_for = ?3, progress_count = progress_count + 1 WHERE id = ?1 AND attempt = ?2",
                )?
                .execute(params![id, epoch as i64, waiting_for])?;
            Ok(())
        })
    }

    /// Notes the handle of an attempt's worker and the end of its lease.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn lease(&self, id: &str, epoch: u64, handle: &str, until: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction
                .prepare_cached("UPDATE jobs SET worker_handle = ?3, lease_until = ?4 WHERE id = ?1 AND attempt = ?2")?
                .execute(params![id, epoch as i64, handle, until])?;
            Ok(())
        })
    }
}

pub(super) fn apply(transaction: &Transaction, id: &str, trigger: Trigger, change: &Change) -> Result<(), ChangeError> {
    let job = current(transaction, id)?.ok_or(ChangeError::NotFound)?;
    if change.epoch.is_some_and(|epoch| epoch != job.attempt) {
        return Err(ChangeError::Stale);
    }
    let to = job.state.after(trigger).ok_or(ChangeError::Illegal(job.state, trigger))?;
    let now = crate::system::clock::now();
    let is_claim = trigger == Trigger::Claim;
    // A plain state has no reason; a pause or cancellation keeps the one that it was asked with.
    let plain = matches!(to, State::Running | State::Succeeded) || trigger == Trigger::Miss && to == State::Queued;
    let reason = if plain { None } else { change.reason.or(job.reason) };
    let reason = if trigger == Trigger::Resume { None } else { reason };
    let message = if plain || trigger == Trigger::Resume { None } else { change.message.clone().or(job.message) };
    let hint = hint(transaction, id, reason, change)?;
    // An attempt whose worker could not be started does not count.
    let attempt = if is_claim { job.attempt + 1 } else { job.attempt - u64::from(trigger == Trigger::Miss) };
    // Three deaths in a row count; a person's resume begins a new row.
    let deaths = if trigger == Trigger::Resume { 0 } else { job.deaths };
    let changed = transaction
        .prepare_cached(
            "UPDATE jobs SET rev = rev + 1, state = ?3, reason = ?4, hint = ?5, message = ?6,
                 attempt = ?12, records_offset = CASE WHEN ?7 = 1 THEN 0 ELSE records_offset END,
                 verdict = CASE WHEN ?7 = 1 THEN NULL ELSE verdict END,
                 kill_reason = CASE WHEN ?7 = 1 THEN NULL ELSE kill_reason END,
                 worker_handle = CASE WHEN ?7 = 1 THEN NULL ELSE worker_handle END,
                 waiting_for = CASE WHEN ?14 THEN waiting_for ELSE NULL END, evictions = CASE WHEN ?13 THEN 0 ELSE evictions END,
                 started_at = CASE WHEN ?7 = 1 THEN COALESCE(started_at, ?8) ELSE started_at END,
                 finished_at = CASE WHEN ?9 THEN ?8 ELSE NULL END,
                 ended_s = CASE WHEN ?9 THEN (SELECT seconds FROM service_clock) ELSE NULL END, deaths = ?10, leg_wall_s = ?11
             WHERE id = ?1 AND rev = ?2",
        )?
        .execute(params![
            id,
            job.rev,
            to.word(),
            reason.map(Reason::word),
            hint,
            message,
            i64::from(is_claim),
            now,
            to.is_terminal(),
            deaths,
            if trigger == Trigger::Resume { job.wall_s } else { job.leg_wall_s },
            attempt as i64,
            trigger == Trigger::Resume,
            to.has_worker() && !is_claim,
        ])?;
    if changed != 1 {
        return Err(ChangeError::Stale);
    }
    let reason_word = reason.map_or("", Reason::word);
    metrics::counter!("meniscus_transitions_total", "to" => to.word(), "reason" => reason_word).increment(1);
    let data = json!({"from": job.state.word(), "to": to.word(), "reason": reason.map(Reason::word), "hint": hint, "message": message});
    events::append(transaction, id, job.study.as_deref(), attempt, "state", &data)?;
    if to.is_terminal() { tell_of_end(transaction, id, to, job.study.as_deref()) } else { Ok(()) }
}

/// Tells a study and the jobs that wait for one that it has ended.
fn tell_of_end(transaction: &Transaction, id: &str, state: State, study: Option<&str>) -> Result<(), ChangeError> {
    tell_waiting_jobs(transaction, id, state)?;
    if state == State::Failed
        && let Some(study) = study
    {
        study_limits::note_failure(transaction, study)?;
    }
    Ok(())
}

/// What a user can do: the hint of the change, or that of the reason.
fn hint(
    transaction: &Transaction,
    id: &str,
    reason: Option<Reason>,
    change: &Change,
) -> Result<Option<String>, ChangeError> {
    let (None, Some(reason)) = (&change.hint, reason) else { return Ok(change.hint.clone()) };
    let has_checkpoint: bool = transaction
        .prepare_cached(
            "SELECT EXISTS (SELECT 1 FROM checkpoints WHERE job = ?1)
                 OR EXISTS (SELECT 1 FROM jobs WHERE id = ?1 AND restarted_from IS NOT NULL)",
        )?
        .query_row([id], |row| row.get(0))?;
    let hint = if has_checkpoint { reason.hint() } else { reason.hint_without_checkpoint() };
    Ok(Some(hint.to_owned()))
}

/// Lets the jobs that wait for one start, or cancels them where it has not succeeded.
fn tell_waiting_jobs(transaction: &Transaction, id: &str, state: State) -> Result<(), ChangeError> {
    for dependent in dependencies::release(transaction, id)? {
        if state == State::Succeeded {
            continue;
        }
        match give_up(transaction, &dependent, id) {
            // It has ended before.
            Ok(()) | Err(ChangeError::Illegal(..)) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Cancels a job because one that it waits for has not succeeded.
pub(super) fn give_up(transaction: &Transaction, job: &str, predecessor: &str) -> Result<(), ChangeError> {
    let message = Some(format!("{predecessor} of `after` has not succeeded"));
    apply(transaction, job, Trigger::Cancel, &Change { message, ..Change::because(Reason::DependencyFailed) })
}

/// The columns of a job that a transition reads: a study changes ten thousand jobs at once.
struct Current {
    rev: i64,
    state: State,
    reason: Option<Reason>,
    message: Option<String>,
    attempt: u64,
    deaths: u32,
    wall_s: f64,
    leg_wall_s: f64,
    study: Option<String>,
}

fn current(transaction: &Transaction, id: &str) -> Result<Option<Current>, ChangeError> {
    let found = transaction
        .prepare_cached(
            "SELECT rev, state, reason, message, attempt, deaths, leg_wall_s, study,
                 COALESCE(json_extract(usage, '$.wall_s'), 0.0) AS wall_s FROM jobs WHERE id = ?1",
        )?
        .query_row([id], |row| {
            let (state, reason): (String, Option<String>) = (row.get("state")?, row.get("reason")?);
            Ok(Current {
                rev: row.get("rev")?,
                state: State::from_word(&state).ok_or(rusqlite::Error::InvalidQuery)?,
                reason: reason.as_deref().and_then(Reason::from_word),
                message: row.get("message")?,
                attempt: row.get::<_, i64>("attempt")? as u64,
                deaths: row.get("deaths")?,
                wall_s: row.get("wall_s")?,
                leg_wall_s: row.get("leg_wall_s")?,
                study: row.get("study")?,
            })
        })
        .optional()?;
    Ok(found)
}

impl Store {
    /// Changes name, labels, priority and limits of a job that waits; `rev` is the revision that the change was made for.
    ///
    /// # Errors
    /// [`ChangeError::Stale`] where the job has another revision or does not wait any more.
    pub fn amend(&self, id: &str, rev: i64, amended: &Amended) -> Result<JobRow, ChangeError> {
        let Amended { spec, resolved } = amended;
        self.write(|transaction| {
            let changed = transaction
                .prepare_cached(
                    "UPDATE jobs SET rev = rev + 1, name = ?3, labels = ?4, spec = ?5, resolved = ?6,
                         rank = rank + (priority - ?7) * ?8, priority = ?7
                     WHERE id = ?1 AND rev = ?2 AND state IN ('queued', 'paused')",
                )?
                .execute(params![
                    id,
                    rev,
                    resolved.name,
                    json!(resolved.labels).to_string(),
                    spec.to_string(),
                    resolved.to_json().to_string(),
                    resolved.priority,
                    AGING_S,
                ])?;
            if changed != 1 {
                return Err(ChangeError::Stale);
            }
            rows::job(transaction, id)?.ok_or(ChangeError::NotFound)
        })
    }
}
