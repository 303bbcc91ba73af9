//! Studies: sweeps of jobs as one object. Its state is that of its jobs.

use super::idempotency::{IdempotencyKey, Made, Receipt};
use super::points::{PointRow, point_of};
use super::refinements::{self, RefinementRow};
use super::submission::{NewJob, Place, insert};
use super::transitions::apply;
use super::{Change, ChangeError, Store, StoreError, deletion, remove_directory, rows};
use crate::spec::states::{Reason, State, Trigger};
use crate::spec::study::{RefinementState, Refines, Study, StudyForecast};
use rusqlite::{Connection, OptionalExtension, Transaction, params};
use serde_json::Value;
use std::collections::{BTreeMap, HashSet};

/// A study as the store has it.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyRow {
    /// Id of the study.
    pub id: String,
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// Body that all points share.
    pub base: Value,
    /// The sweep as sent.
    pub sweep: Value,
    /// Pointers that vary.
    pub axes: Vec<String>,
    /// Number of points.
    pub points: u64,
    /// Most jobs that run at once.
    pub max_parallel: Option<u64>,
    /// `continue` or `stop`.
    pub on_failure: String,
    /// Whether a failure stops, or has stopped, the rest.
    pub is_stopping: bool,
    /// Forecast of all points together.
    pub forecast: StudyForecast,
    /// Time at which it was made.
    pub created_at: String,
    /// Name of the token that made it; None without tokens.
    pub owner: Option<String>,
    /// Points by the state of their latest job.
    pub counts: BTreeMap<State, u64>,
    /// How far it has come, where it refines.
    pub refinement: Option<RefinementRow>,
}

/// A study to be made.
#[derive(Debug, Clone)]
pub struct NewStudy {
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// Body that all points share.
    pub base: Value,
    /// The sweep as sent.
    pub sweep: Value,
    /// Pointers that vary.
    pub axes: Vec<String>,
    /// Most jobs that run at once.
    pub max_parallel: Option<u64>,
    /// `continue` or `stop`.
    pub on_failure: &'static str,
    /// Forecast of all points together.
    pub forecast: StudyForecast,
    /// Jobs, one for each point; of a study that refines none, since its levels come one after another.
    pub jobs: Vec<NewJob>,
    /// How far it may go, where it refines.
    pub refines: Option<Refines>,
    /// Name of the token that makes it; None without tokens.
    pub owner: Option<String>,
}

impl From<Study<NewJob>> for NewStudy {
    fn from(study: Study<NewJob>) -> Self {
        let Study { name, labels, base, sweep, axes, max_parallel, on_failure, forecast, jobs, refines, .. } = study;
        Self { name, labels, base, sweep, axes, max_parallel, on_failure, forecast, jobs, refines, owner: None }
    }
}

/// Jobs changed in one transaction: between two of them others get their turn.
const CHUNK: usize = 500;

impl Store {
    /// Makes a study with all its jobs, or nothing.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn make_study(
        &self,
        study: NewStudy,
        key: Option<&IdempotencyKey>,
        receipt: impl FnOnce(&StudyRow) -> Receipt,
    ) -> Result<Made, StoreError> {
        let id = format!("std_{}", self.next_id());
        let mut study = study;
        let jobs = std::mem::take(&mut study.jobs);
        let mut prepared = Vec::with_capacity(jobs.len());
        for (index, mut job) in jobs.into_iter().enumerate() {
            let (number, clock_s) = self.next_submission();
            let job_id = format!("job_{number}");
            let start = self.prepare_start(&job_id, &job)?;
            job.study = Some((id.clone(), index as u64));
            job.owner.clone_from(&study.owner);
            prepared.push((job_id, clock_s, job, start));
        }
        let made = self.make_once(key, |transaction| {
            enter_study(transaction, (&id, prepared.len(), self.clock.seconds()), &study)?;
            for (job_id, clock_s, job, start) in &prepared {
                insert(transaction, &Place { id: job_id, clock_s: *clock_s }, job, start.as_deref())?;
            }
            Ok(receipt(&study_of(transaction, &id)?.ok_or(rusqlite::Error::QueryReturnedNoRows)?))
        });
        if !matches!(made, Ok(Made::New(_))) {
            for (job_id, ..) in prepared.iter().filter(|(.., start)| start.is_some()) {
                remove_directory(&self.job_directory(job_id))?;
            }
        }
        made
    }

    /// Makes new jobs for points, in place of their latest ones.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn retry_study(
        &self,
        study: &str,
        jobs: &[NewJob],
        key: Option<&IdempotencyKey>,
        receipt: impl FnOnce(&StudyRow) -> Receipt,
    ) -> Result<Made, StoreError> {
        let mut prepared = Vec::with_capacity(jobs.len());
        for job in jobs {
            let (number, clock_s) = self.next_submission();
            let id = format!("job_{number}");
            let start = self.prepare_start(&id, job)?;
            prepared.push((id, clock_s, job, start));
        }
        let made = self.make_once(key, |transaction| {
            transaction.execute("UPDATE studies SET stopping = 0 WHERE id = ?1", [study])?;
            refinements::reopen(transaction, study)?;
            for (id, clock_s, job, start) in &prepared {
                // Another request may have repeated it in the meantime.
                let is_latest: bool = transaction
                    .prepare_cached("SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?1 AND superseded = 0)")?
                    .query_row([&job.retry_of], |row| row.get(0))?;
                if is_latest {
                    insert(transaction, &Place { id, clock_s: *clock_s }, job, start.as_deref())?;
                }
            }
            Ok(receipt(&study_of(transaction, study)?.ok_or(rusqlite::Error::QueryReturnedNoRows)?))
        });
        // Directories of jobs that were not made after all.
        for (id, ..) in prepared.iter().filter(|(.., start)| start.is_some()) {
            if self.job(id)?.is_none() {
                remove_directory(&self.job_directory(id))?;
            }
        }
        made
    }

    /// A study by id.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn study(&self, id: &str) -> Result<Option<StudyRow>, StoreError> {
        study_of(&self.read(), id)
    }

    /// A page of studies, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn studies(&self, cursor: Option<&str>, limit: u64) -> Result<Vec<StudyRow>, StoreError> {
        let connection = self.read();
        let ids: Vec<String> = {
            let mut statement = connection
                .prepare_cached("SELECT id FROM studies WHERE ?1 IS NULL OR id < ?1 ORDER BY id DESC LIMIT ?2")?;
            let rows = statement.query_map(params![cursor, limit as i64], |row| row.get(0))?;
            rows.collect::<Result<_, _>>()?
        };
        ids.iter().filter_map(|id| study_of(&connection, id).transpose()).collect()
    }

    /// Points of a study after a number, with their latest jobs.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn points(&self, study: &StudyRow, after: Option<u64>, limit: u64) -> Result<Vec<PointRow>, StoreError> {
        if study.refinement.is_some() {
            return self.level_points(&study.id, &study.axes, after, limit);
        }
        let mut points = Vec::new();
        let mut after = after.map_or(-1, |after| i64::try_from(after).unwrap_or(i64::MAX));
        // A reader is held for a chunk, not for the whole: others read, too.
        while (points.len() as u64) < limit {
            let many = (limit - points.len() as u64).min(CHUNK as u64);
            let connection = self.read();
            let mut statement = connection.prepare_cached(
                "SELECT study_index, id, state, reason, spec, resolved, usage, progress, estimate, results, health FROM jobs
                 WHERE study = ?1 AND superseded = 0 AND study_index > ?2 ORDER BY study_index LIMIT ?3",
            )?;
            let rows = statement.query_map(params![study.id, after, many as i64], |row| point_of(row, &study.axes))?;
            let before = points.len();
            for row in rows {
                let point = row?;
                after = point.index as i64;
                points.push(point);
            }
            if ((points.len() - before) as u64) < many {
                break;
            }
        }
        Ok(points)
    }

    /// Applies a trigger to every latest job of a study that the table lets it apply to.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn change_study(&self, study: &str, trigger: Trigger, change: &Change) -> Result<(), StoreError> {
        if refinements::of_study(&self.read(), study)?.is_some() {
            if trigger == Trigger::Pause {
                self.keep_paused_where("study", study)?;
            }
            return self.write(|transaction| refinements::steer(transaction, study, trigger, change));
        }
        let from: HashSet<&str> =
            State::ALL.iter().filter(|state| state.after(trigger).is_some()).map(|state| state.word()).collect();
        let ids: Vec<String> = {
            let connection = self.read();
            let mut statement =
                connection.prepare_cached("SELECT id, state FROM jobs WHERE study = ?1 ORDER BY study_index, id")?;
            let rows = statement.query_map([study], |row| Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?)))?;
            let all = rows.collect::<Result<Vec<_>, _>>()?;
            all.into_iter().filter(|(_, state)| from.contains(state.as_str())).map(|(id, _)| id).collect()
        };
        if trigger == Trigger::Pause {
            // Jobs that were paused for lack of space must not resume by themselves any more.
            self.keep_paused_where("study", study)?;
        }
        for chunk in ids.chunks(CHUNK) {
            self.write(|transaction| {
                for id in chunk {
                    match apply(transaction, id, trigger, change) {
                        // It has moved on since it was listed.
                        Ok(_) | Err(ChangeError::Illegal(..) | ChangeError::NotFound | ChangeError::Stale) => {}
                        Err(ChangeError::Store(error)) => return Err(error),
                    }
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Cancels the remaining jobs of studies that stop at their first failure.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn stop_failed_studies(&self) -> Result<(), StoreError> {
        let ids: Vec<String> = {
            let connection = self.read();
            let mut statement = connection.prepare_cached("SELECT id FROM studies WHERE stopping = 1")?;
            let rows = statement.query_map([], |row| row.get(0))?;
            rows.collect::<Result<_, _>>()?
        };
        for id in ids {
            let message =
                "another point of the study failed, and on_failure is \"stop\"; retry the study to run it anew";
            let change = Change { message: Some(message.to_owned()), ..Change::because(Reason::UserCancel) };
            self.change_study(&id, Trigger::Cancel, &change)?;
            self.write(|transaction| -> Result<(), StoreError> {
                transaction.execute("UPDATE studies SET stopping = 2 WHERE id = ?1 AND stopping = 1", [&id])?;
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Deletes a study and all its jobs, if all of them have ended; false where one has not.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_study(&self, id: &str) -> Result<bool, StoreError> {
        let deleted = self.write(|transaction| -> Result<Option<Vec<String>>, StoreError> {
            let jobs: Vec<(String, String)> = {
                let mut statement = transaction.prepare_cached("SELECT id, state FROM jobs WHERE study = ?1")?;
                let rows = statement.query_map([id], |row| Ok((row.get(0)?, row.get(1)?)))?;
                rows.collect::<Result<_, _>>()?
            };
            let goes_on =
                refinements::of_study(transaction, id)?.is_some_and(|row| row.state != RefinementState::Ended);
            if goes_on || jobs.iter().any(|(_, state)| !State::from_word(state).is_some_and(State::is_terminal)) {
                return Ok(None);
            }
            refinements::delete(transaction, id)?;
            for (job, _) in &jobs {
                super::delete_rows(transaction, job)?;
                deletion::intend(transaction, &super::job_folder(job))?;
            }
            transaction.execute("DELETE FROM study_events WHERE study = ?1", [id])?;
            transaction.execute("DELETE FROM studies WHERE id = ?1", [id])?;
            Ok(Some(jobs.into_iter().map(|(job, _)| job).collect()))
        })?;
        let Some(jobs) = deleted else { return Ok(false) };
        for job in jobs {
            self.delete_folder(&super::job_folder(&job))?;
        }
        Ok(true)
    }
}

/// Writes the row of a study with a number of points, at a reading of the clock.
pub(super) fn enter_study(
    transaction: &Transaction,
    (id, points, clock_s): (&str, usize, f64),
    study: &NewStudy,
) -> Result<(), StoreError> {
    transaction.execute(
        "INSERT INTO studies (id, name, labels, base, sweep, axes, points, max_parallel, on_failure, estimate, created_at,
             made_s, owner)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
        params![
            id,
            study.name,
            serde_json::to_string(&study.labels)?,
            study.base.to_string(),
            study.sweep.to_string(),
            serde_json::to_string(&study.axes)?,
            points as i64,
            study.max_parallel.map(|most| most as i64),
            study.on_failure,
            serde_json::to_string(&study.forecast)?,
            crate::system::clock::now(),
            clock_s,
            study.owner,
        ],
    )?;
    if let Some(refines) = study.refines {
        refinements::enter(transaction, id, refines)?;
    }
    Ok(())
}

fn study_of(connection: &Connection, id: &str) -> Result<Option<StudyRow>, StoreError> {
    let found = connection
        .prepare_cached("SELECT * FROM studies WHERE id = ?1")?
        .query_row([id], |row| {
            Ok(StudyRow {
                id: row.get("id")?,
                name: row.get("name")?,
                labels: rows::json(row, "labels")?,
                base: rows::json(row, "base")?,
                sweep: rows::json(row, "sweep")?,
                axes: rows::json(row, "axes")?,
                points: row.get::<_, i64>("points")? as u64,
                max_parallel: row.get::<_, Option<i64>>("max_parallel")?.map(|most| most as u64),
                on_failure: row.get("on_failure")?,
                is_stopping: row.get::<_, i64>("stopping")? != 0,
                forecast: rows::json(row, "estimate")?,
                created_at: row.get("created_at")?,
                owner: row.get("owner")?,
                counts: BTreeMap::new(),
                refinement: None,
            })
        })
        .optional()?;
    let Some(mut study) = found else { return Ok(None) };
    study.refinement = refinements::of_study(connection, id)?;
    if let Some(refinement) = &study.refinement {
        study.points = refinement.levels;
    }
    let mut statement = connection
        .prepare_cached("SELECT state, COUNT(*) FROM jobs WHERE study = ?1 AND superseded = 0 GROUP BY state")?;
    let counts = statement.query_map([id], |row| Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)? as u64)))?;
    for count in counts {
        let (word, many) = count?;
        if let Some(state) = State::from_word(&word) {
            study.counts.insert(state, many);
        }
    }
    Ok(Some(study))
}
