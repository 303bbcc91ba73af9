//! Studies that refine: which of them go on, and what their levels have come to.
//!
//! A level is a row of its own, made in one transaction with its job. What it has come to is kept there, so that neither a restart
//! nor the deletion of a job changes what the study says.

use super::points::{PointRow, point_of};
use super::submission::{NewJob, Place, insert};
use super::transitions::apply;
use super::{Change, ChangeError, JobRow, Store, StoreError, remove_directory, rows};
use crate::spec::body::Allowance;
use crate::spec::states::{Reason, State, Trigger};
use crate::spec::study::{MeasuredLevel, RefinementOutcome, RefinementState, Refines};
use meniscus::spec::Word;
use rusqlite::{Connection, OptionalExtension, Row, Transaction, params};

/// How far a study that refines has come.
#[derive(Debug, Clone, PartialEq)]
pub struct RefinementRow {
    /// Whether levels are still made.
    pub state: RefinementState,
    /// Why no further level is made.
    pub outcome: Option<RefinementOutcome>,
    /// The same in a sentence, with numbers.
    pub message: Option<String>,
    /// Number of the set-up that goes on, once it is chosen.
    pub chosen: Option<u64>,
    /// Threads that a level may have.
    pub threads: u64,
    /// Memory that a level may have, in bytes.
    pub memory_bytes: u64,
    /// Number of levels made so far, of all set-ups.
    pub levels: u64,
    /// Number of levels of all set-ups at most.
    pub most_levels: u64,
    /// Job that waits for the spacing that the study finds.
    pub job: Option<String>,
}

impl RefinementRow {
    /// What a level may ask for.
    #[must_use]
    pub fn allowance(&self) -> Allowance {
        Allowance { threads: self.threads, memory_bytes: self.memory_bytes, local_files: false }
    }
}

/// A level of a set-up.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelRow {
    /// Number among all levels of the study.
    pub number: u64,
    /// Number of the set-up.
    pub setup: u64,
    /// Number of the level within its set-up, the coarsest first.
    pub level: u64,
    /// Latest job of the level; of a level that was taken from an earlier job that one.
    pub job: Option<String>,
    /// Whether it was taken from an earlier job.
    pub is_reused: bool,
    /// Whether it is to be run anew.
    pub is_to_repeat: bool,
    /// What it has come to.
    pub measured: Option<MeasuredLevel>,
    /// State of the job; None where the job is gone.
    pub state: Option<State>,
    /// Why the job is in its state.
    pub reason: Option<Reason>,
    /// What failed, with numbers and places.
    pub message: Option<String>,
}

/// A level to be made.
#[derive(Debug, Clone)]
pub struct NewLevel {
    /// Number among all levels of the study.
    pub number: u64,
    /// Number of the set-up.
    pub setup: u64,
    /// Number of the level within its set-up.
    pub level: u64,
    /// Where its numbers come from.
    pub source: LevelSource,
}

/// Where the numbers of a level come from.
#[derive(Debug, Clone)]
pub enum LevelSource {
    /// A job that is run for it.
    Job(Box<NewJob>),
    /// An equal earlier job.
    Earlier {
        /// Id of that job.
        job: String,
        /// What it has come to.
        measured: MeasuredLevel,
    },
}

/// Jobs that are looked at as equal to a new level, at most.
const MOST_CANDIDATES: u64 = 16;

impl Store {
    /// Studies that refine and of which no job is waiting or running.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn refinements_to_advance(&self) -> Result<Vec<String>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT study FROM refinements WHERE state = 'open' AND NOT EXISTS (
                 SELECT 1 FROM jobs WHERE jobs.study = refinements.study
                     AND jobs.state NOT IN ('succeeded', 'failed', 'canceled'))
             ORDER BY study",
        )?;
        let rows = statement.query_map([], |row| row.get(0))?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Studies whose job has ended, or is gone, before they could tell its spacing.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn refinements_of_ended_jobs(&self) -> Result<Vec<String>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT study FROM refinements WHERE job IS NOT NULL AND state <> 'ended' AND NOT EXISTS (
                 SELECT 1 FROM jobs WHERE jobs.id = refinements.job AND jobs.state IN ('queued', 'paused'))",
        )?;
        let rows = statement.query_map([], |row| row.get(0))?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// The levels of a study in the order of their making.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn levels(&self, study: &str) -> Result<Vec<LevelRow>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT levels.*, jobs.id AS job_id, jobs.state AS job_state, jobs.reason AS job_reason,
                 jobs.message AS job_message FROM levels
                 LEFT JOIN jobs ON jobs.id = CASE WHEN is_reused THEN levels.job ELSE (SELECT id FROM jobs AS own
                     WHERE own.study = levels.study AND own.study_index = levels.number AND own.superseded = 0) END
             WHERE levels.study = ?1 ORDER BY number",
        )?;
        let rows = statement.query_map([study], level_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Makes a level, or repeats one, if the study is still open and nothing else made the level in the meantime.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn make_level(&self, study: &str, owner: Option<&String>, new: NewLevel) -> Result<(), StoreError> {
        let NewLevel { number, setup, level, source } = new;
        let prepared = match source {
            LevelSource::Earlier { job, measured } => Err((job, serde_json::to_string(&measured)?)),
            LevelSource::Job(mut job) => {
                let id = format!("job_{}", self.next_id());
                job.study = Some((study.to_owned(), number));
                job.owner = owner.cloned();
                let start = self.prepare_start(&id, &job)?;
                Ok((id, job, start))
            }
        };
        let made = self.write(|transaction| -> Result<bool, StoreError> {
            if !is_open(transaction, study)? {
                return Ok(false);
            }
            let is_new = transaction
                .prepare_cached(
                    "SELECT NOT EXISTS (SELECT 1 FROM levels WHERE study = ?1 AND number = ?2 AND NOT is_to_repeat)",
                )?
                .query_row(params![study, number as i64], |row| row.get::<_, bool>(0))?;
            if !is_new {
                return Ok(false);
            }
            let (job, measured) = match &prepared {
                Err((job, measured)) => (Some(job), Some(measured)),
                Ok((id, job, start)) => {
                    // Levels wait no longer than the study does.
                    let clock_s =
                        transaction.query_row("SELECT made_s FROM studies WHERE id = ?1", [study], |row| row.get(0))?;
                    insert(transaction, &Place { id, clock_s }, job, start.as_deref())?;
                    (None, None)
                }
            };
            transaction.execute(
                "INSERT OR REPLACE INTO levels (study, number, setup, level, job, is_reused, is_to_repeat, measured)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, 0, ?7)",
                params![study, number as i64, setup as i64, level as i64, job, job.is_some(), measured],
            )?;
            Ok(true)
        });
        if let (Ok((id, _, Some(_))), false) = (&prepared, matches!(made, Ok(true))) {
            remove_directory(&self.job_directory(id))?;
        }
        made.map(|_| ())
    }

    /// Keeps what a level has come to.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn keep_measured(&self, study: &str, number: u64, measured: &MeasuredLevel) -> Result<(), StoreError> {
        let text = serde_json::to_string(measured)?;
        self.write(|transaction| {
            transaction.execute(
                "UPDATE levels SET measured = ?3 WHERE study = ?1 AND number = ?2",
                params![study, number as i64, text],
            )?;
            Ok(())
        })
    }

    /// Notes which set-up goes on.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn choose_setup(&self, study: &str, setup: u64) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "UPDATE refinements SET chosen = ?2 WHERE study = ?1 AND chosen IS NULL",
                params![study, setup as i64],
            )?;
            Ok(())
        })
    }

    /// Ends a study that is still open: no further level is made.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn end_refinement(&self, study: &str, outcome: RefinementOutcome, message: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "UPDATE refinements SET state = 'ended', outcome = ?2, message = ?3 WHERE study = ?1 AND state = 'open'",
                params![study, outcome.word(), message],
            )?;
            Ok(())
        })
    }

    /// CPU seconds of all jobs of a study, repeated ones included.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn spent_cpu_s(&self, study: &str) -> Result<f64, StoreError> {
        let connection = self.read();
        let spent = connection
            .prepare_cached("SELECT COALESCE(SUM(json_extract(usage, '$.cpu_s')), 0.0) FROM jobs WHERE study = ?1")?
            .query_row([study], |row| row.get(0))?;
        Ok(spent)
    }

    /// Succeeded jobs that began afresh with a scene of this digest, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn jobs_of_scene(&self, scene_sha256: &str) -> Result<Vec<JobRow>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(&rows::select_jobs(
            "scene_sha256 = ?1 AND state = 'succeeded' AND restarted_from IS NULL ORDER BY id DESC LIMIT ?2",
        ))?;
        let rows = statement.query_map(params![scene_sha256, MOST_CANDIDATES as i64], rows::job_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// The levels of a study as points of its table.
    pub(super) fn level_points(
        &self,
        study: &str,
        axes: &[String],
        after: Option<u64>,
        limit: u64,
    ) -> Result<Vec<PointRow>, StoreError> {
        let levels = self.levels(study)?.into_iter().filter(|level| after.is_none_or(|after| level.number > after));
        let connection = self.read();
        let mut points = Vec::new();
        for level in levels.take(usize::try_from(limit).unwrap_or(usize::MAX)) {
            let found = connection
                .prepare_cached(
                    "SELECT ?2 AS study_index, id, state, reason, spec, resolved, usage, progress, estimate, results, health
                     FROM jobs WHERE id = ?1",
                )?
                .query_row(params![level.job, level.number as i64], |row| point_of(row, axes))
                .optional()?;
            let point = found.or_else(|| Some(deleted_point(axes, &level, level.measured.as_ref()?)));
            points.extend(point.map(|point| PointRow { level: Some(level.level), ..point }));
        }
        Ok(points)
    }
}

/// The point of a level whose job was deleted.
fn deleted_point(axes: &[String], level: &LevelRow, measured: &MeasuredLevel) -> PointRow {
    PointRow {
        index: level.number,
        level: Some(level.level),
        job: level.job.clone().unwrap_or_default(),
        state: State::Succeeded,
        reason: None,
        values: vec![serde_json::Value::Null; axes.len()],
        spacing: Some(measured.spacing),
        spent: [measured.cpu_s, measured.wall_s],
        particles: measured.particles,
        steps: measured.steps,
        health: measured.health,
        errors: None,
    }
}

/// Enters a new study that refines.
pub(super) fn enter(transaction: &Transaction, study: &str, refines: Refines) -> rusqlite::Result<()> {
    let Refines { allowance, most_levels } = refines;
    transaction.execute(
        "INSERT INTO refinements (study, state, threads, memory_bytes, most_levels) VALUES (?1, 'open', ?2, ?3, ?4)",
        params![
            study,
            allowance.threads as i64,
            i64::try_from(allowance.memory_bytes).unwrap_or(i64::MAX),
            most_levels as i64
        ],
    )?;
    Ok(())
}

/// How far a study has come, if it refines.
pub(super) fn of_study(connection: &Connection, study: &str) -> Result<Option<RefinementRow>, StoreError> {
    let found = connection
        .prepare_cached(
            "SELECT *, (SELECT COUNT(*) FROM levels WHERE levels.study = refinements.study) AS levels
             FROM refinements WHERE study = ?1",
        )?
        .query_row([study], |row| {
            let (state, outcome): (String, Option<String>) = (row.get("state")?, row.get("outcome")?);
            Ok(RefinementRow {
                state: RefinementState::from_word(&state).ok_or(rusqlite::Error::InvalidQuery)?,
                outcome: outcome.as_deref().and_then(RefinementOutcome::from_word),
                message: row.get("message")?,
                chosen: row.get::<_, Option<i64>>("chosen")?.map(|chosen| chosen as u64),
                threads: row.get::<_, i64>("threads")? as u64,
                memory_bytes: row.get::<_, i64>("memory_bytes")? as u64,
                levels: row.get::<_, i64>("levels")? as u64,
                most_levels: row.get::<_, i64>("most_levels")? as u64,
                job: row.get("job")?,
            })
        })
        .optional()?;
    Ok(found)
}

/// Applies a trigger to a study that refines and to its jobs, all in one transaction: no level comes in between.
pub(super) fn steer(
    transaction: &Transaction,
    study: &str,
    trigger: Trigger,
    change: &Change,
) -> Result<(), StoreError> {
    let set = match trigger {
        Trigger::Cancel => {
            "state = 'ended', outcome = 'canceled', message = 'the study was canceled' WHERE state <> 'ended'"
        }
        Trigger::Pause => "state = 'paused' WHERE state = 'open'",
        Trigger::Resume => "state = 'open' WHERE state = 'paused'",
        _ => return Ok(()),
    };
    transaction.execute(&format!("UPDATE refinements SET {set} AND study = ?1"), [study])?;
    if trigger == Trigger::Cancel
        && let Some(job) = of_study(transaction, study)?.and_then(|row| row.job)
    {
        give_up_waiting(transaction, study, &job)?;
    }
    let jobs: Vec<String> = {
        let mut statement = transaction.prepare_cached(
            "SELECT id FROM jobs WHERE study = ?1 AND state NOT IN ('succeeded', 'failed', 'canceled') ORDER BY id",
        )?;
        let rows = statement.query_map([study], |row| row.get(0))?;
        rows.collect::<Result<_, _>>()?
    };
    for job in jobs {
        match apply(transaction, &job, trigger, change) {
            Ok(()) | Err(ChangeError::Illegal(..) | ChangeError::NotFound | ChangeError::Stale) => {}
            Err(ChangeError::Store(error)) => return Err(error),
        }
    }
    Ok(())
}

/// Cancels the job that waits for a study that was canceled; one that has its body goes on.
fn give_up_waiting(transaction: &Transaction, study: &str, job: &str) -> Result<(), StoreError> {
    let waits: bool = transaction
        .prepare_cached("SELECT EXISTS (SELECT 1 FROM dependencies WHERE job = ?1 AND predecessor = ?2)")?
        .query_row([job, study], |row| row.get(0))?;
    let message = Some(format!("{study}, which was to find its spacing, was canceled"));
    let change = Change { message, ..Change::because(Reason::DependencyFailed) };
    match if waits { apply(transaction, job, Trigger::Cancel, &change) } else { Ok(()) } {
        Err(ChangeError::Store(error)) => Err(error),
        _ => Ok(()),
    }
}

/// Opens a study again that ended because a level failed or was canceled; those levels are run anew.
pub(super) fn reopen(transaction: &Transaction, study: &str) -> Result<(), StoreError> {
    let opened = transaction.execute(
        "UPDATE refinements SET state = 'open', outcome = NULL, message = NULL
         WHERE study = ?1 AND state = 'ended' AND outcome IN ('failed', 'canceled')",
        [study],
    )?;
    if opened > 0 {
        transaction.execute(
            "UPDATE levels SET is_to_repeat = 1 WHERE study = ?1 AND measured IS NULL AND NOT EXISTS (
                 SELECT 1 FROM jobs WHERE jobs.study = levels.study AND study_index = number AND superseded = 0
                     AND state NOT IN ('failed', 'canceled'))",
            [study],
        )?;
    }
    Ok(())
}

/// Removes what belongs to a study that is deleted.
pub(super) fn delete(transaction: &Transaction, study: &str) -> rusqlite::Result<()> {
    transaction.execute("DELETE FROM levels WHERE study = ?1", [study])?;
    transaction.execute("DELETE FROM refinements WHERE study = ?1", [study])?;
    Ok(())
}

fn is_open(transaction: &Transaction, study: &str) -> rusqlite::Result<bool> {
    transaction
        .prepare_cached("SELECT EXISTS (SELECT 1 FROM refinements WHERE study = ?1 AND state = 'open')")?
        .query_row([study], |row| row.get(0))
}

fn level_of(row: &Row) -> rusqlite::Result<LevelRow> {
    let state: Option<String> = row.get("job_state")?;
    let reason: Option<String> = row.get("job_reason")?;
    let is_reused: bool = row.get("is_reused")?;
    let kept: Option<String> = row.get("job")?;
    Ok(LevelRow {
        number: row.get::<_, i64>("number")? as u64,
        setup: row.get::<_, i64>("setup")? as u64,
        level: row.get::<_, i64>("level")? as u64,
        job: row.get::<_, Option<String>>("job_id")?.or(kept),
        is_reused,
        is_to_repeat: row.get("is_to_repeat")?,
        measured: rows::json(row, "measured")?,
        state: state.as_deref().and_then(State::from_word),
        reason: reason.as_deref().and_then(Reason::from_word),
        message: row.get("job_message")?,
    })
}
