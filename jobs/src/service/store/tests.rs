//! Properties of the store on a real file.

use super::finish_attempt::{LossCause, LossKind};
use super::import::ProgressPace;
use super::{Change, ChangeError, JobFilter, JobRow, Store};
use crate::service::found_folders;
use crate::spec::attempt_files::attempt_directory;
use crate::spec::body::{self, Allowance, NoSources};
use crate::spec::records::{CheckpointRecord, FileRecord, Progress, Record, RecordFile, RecordSink, Verdict};
use crate::spec::states::{Reason, State, Trigger};
use serde_json::json;

fn store() -> (tempfile::TempDir, Store) {
    let directory = tempfile::tempdir().unwrap();
    let store = Store::open(directory.path()).unwrap();
    (directory, store)
}

fn submit(store: &Store, extra: &serde_json::Value) -> JobRow {
    let mut spec = json!({"scene": {"kind": "redistance"}});
    spec.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    let allowance = Allowance { threads: 2, memory_bytes: 1 << 32, local_files: false };
    let body = body::parse(&spec, allowance, &NoSources).ok().unwrap();
    store.submit_row(&body)
}

fn records(store: &Store, job: &JobRow, epoch: u64) -> RecordFile {
    let directory = attempt_directory(&store.job_directory(&job.id), epoch);
    std::fs::create_dir_all(&directory).unwrap();
    RecordFile::open(&directory, epoch).unwrap()
}

fn frame(number: u64) -> Record {
    Record::File(FileRecord {
        path: format!("frames/{number:06}.vtkhdf"),
        size_bytes: 1,
        sha256: "0".into(),
        media_type: "x".into(),
        time: Some(0.0),
        step: Some(number),
    })
}

#[test]
fn a_job_survives_reopening_and_its_events_have_no_gaps() {
    let (directory, store) = store();
    let job = submit(&store, &json!({"name": "a"}));
    let claimed = store.claim(|_, _| true).unwrap().unwrap();
    assert_eq!((claimed.id.clone(), claimed.attempt, claimed.state), (job.id.clone(), 1, State::Running));
    drop(store);
    let store = Store::open(directory.path()).unwrap();
    let again = store.job(&job.id).unwrap().unwrap();
    assert_eq!(again, claimed);
    store.change(&job.id, Trigger::Cancel, &Change::because(Reason::UserCancel)).unwrap();
    let ids: Vec<u64> = store.events(&job.id, 0, 100).unwrap().iter().map(|e| e.id).collect();
    assert_eq!(ids, [1, 2, 3]);
}

#[test]
fn only_the_table_moves_a_job() {
    let (_directory, store) = store();
    let job = submit(&store, &json!({}));
    assert!(matches!(store.change(&job.id, Trigger::Finish, &Change::default()), Err(ChangeError::Illegal(..))));
    store.change(&job.id, Trigger::Cancel, &Change::because(Reason::UserCancel)).unwrap();
    for trigger in Trigger::ALL {
        assert!(store.change(&job.id, *trigger, &Change::default()).is_err(), "{trigger:?}");
    }
    assert_eq!(store.job(&job.id).unwrap().unwrap().reason, Some(Reason::UserCancel));
}

#[test]
fn records_are_taken_once_and_never_from_another_attempt() {
    let (_directory, store) = store();
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    let frames = || store.files(&job.id).unwrap().iter().filter(|file| file.step.is_some()).count();
    let mut first = records(&store, &job, 1);
    first.put(&frame(0), false).unwrap();
    first.put(&frame(1), false).unwrap();
    let mut pace = ProgressPace::default();
    assert!(store.import(&job.id, 1, &mut pace).unwrap().any);
    assert!(!store.import(&job.id, 1, &mut pace).unwrap().any);
    assert_eq!(frames(), 2);
    store.change(&job.id, Trigger::Lose, &Change::default()).unwrap();
    store.change(&job.id, Trigger::Requeue, &Change::default()).unwrap();
    store.claim(|_, _| true).unwrap();
    // The orphan of attempt 1 goes on writing; its records do not count.
    first.put(&Record::Verdict(Verdict::Succeeded), true).unwrap();
    assert!(store.import(&job.id, 1, &mut pace).unwrap().verdict.is_none());
    // Attempt 2 goes on after one frame: the second is void until it is written again.
    let mut second = records(&store, &job, 2);
    second.put(&Record::Started { step: 5, frames: 1, from_checkpoint: true, pid: 1 }, true).unwrap();
    store.import(&job.id, 2, &mut pace).unwrap();
    assert_eq!(frames(), 1);
}

#[test]
fn progress_never_falls_and_deaths_count_only_without_checkpoints() {
    let (_directory, store) = store();
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    let mut sink = records(&store, &job, 1);
    let mut pace = ProgressPace::default();
    for fraction in [0.5, 0.2] {
        sink.put(&Record::Progress(Progress { fraction, ..Progress::default() }), false).unwrap();
        store.import(&job.id, 1, &mut pace).unwrap();
        assert!((store.job(&job.id).unwrap().unwrap().progress.fraction - 0.5).abs() < 1e-15);
    }
    let die = |epoch: u64| {
        let loss = LossCause::new(Reason::WorkerCrash, LossKind::Death);
        store.finish_attempt(&job.id, epoch, &loss).unwrap();
        let row = store.job(&job.id).unwrap().unwrap();
        assert_eq!(row.state, State::Queued);
        store.claim(|_, _| true).unwrap();
        row.deaths
    };
    assert_eq!(die(1), 1);
    assert_eq!(die(2), 2);
    let mut sink = records(&store, &job, 3);
    let checkpoint = CheckpointRecord {
        id: "ckpt_1".into(),
        path: "checkpoints/1.h5".into(),
        step: 1,
        time: 0.0,
        size_bytes: 1,
        sha256: String::new(),
        isa: String::new(),
        build: String::new(),
    };
    sink.put(&Record::Checkpoint(checkpoint), true).unwrap();
    store.import(&job.id, 3, &mut pace).unwrap();
    assert_eq!(die(3), 0);
    assert_eq!(die(4), 1);
}

#[test]
fn the_queue_goes_by_priority_then_age_and_skips_what_does_not_fit() {
    let (_directory, store) = store();
    let low = submit(&store, &json!({"priority": -1}));
    let old = submit(&store, &json!({}));
    let new = submit(&store, &json!({}));
    let high = submit(&store, &json!({"priority": 5}));
    let order: Vec<String> = std::iter::from_fn(|| store.claim(|_, _| true).unwrap().map(|job| job.id)).collect();
    assert_eq!(order, [high.id, old.id, new.id, low.id]);
    submit(&store, &json!({}));
    assert!(store.claim(|_, _| false).unwrap().is_none());
}

#[test]
fn pages_are_not_shifted_by_inserts() {
    let (_directory, store) = store();
    let ids: Vec<String> = (0..5).map(|k| submit(&store, &json!({"labels": {"k": k.to_string()}})).id).collect();
    let page = store.list(&JobFilter { limit: 2, ..JobFilter::default() }).unwrap();
    assert_eq!(page.iter().map(|j| &j.id).collect::<Vec<_>>(), [&ids[4], &ids[3]]);
    submit(&store, &json!({}));
    let next = JobFilter { limit: 2, cursor: Some(page[1].id.clone()), ..JobFilter::default() };
    assert_eq!(store.list(&next).unwrap().iter().map(|j| &j.id).collect::<Vec<_>>(), [&ids[2], &ids[1]]);
    let labelled = JobFilter { limit: 9, labels: vec![("k".into(), "3".into())], ..JobFilter::default() };
    assert_eq!(store.list(&labelled).unwrap()[0].id, ids[3]);
}

#[test]
fn deletion_takes_terminal_jobs_only() {
    let (_directory, store) = store();
    let job = submit(&store, &json!({}));
    assert!(!store.delete(&job.id).unwrap());
    store.change(&job.id, Trigger::Cancel, &Change::default()).unwrap();
    std::fs::create_dir_all(store.job_directory(&job.id)).unwrap();
    assert!(store.delete(&job.id).unwrap());
    assert!(store.job(&job.id).unwrap().is_none());
    assert!(!store.job_directory(&job.id).exists());
}

#[test]
fn a_deletion_that_was_cut_short_is_done_later_and_is_no_loss() {
    let (directory, store) = store();
    let job = submit(&store, &json!({}));
    store.change(&job.id, Trigger::Cancel, &Change::default()).unwrap();
    let folder = store.job_directory(&job.id);
    // A file where the folder should be cannot be deleted as a folder.
    std::fs::write(&folder, "").unwrap();
    assert!(store.delete(&job.id).unwrap());
    assert_eq!(store.intended_deletions().unwrap(), [format!("jobs/{}", job.id)]);
    std::fs::remove_file(&folder).unwrap();
    std::fs::create_dir(&folder).unwrap();
    assert!(found_folders::compare(directory.path(), Some(&store)).unwrap().orphans.is_empty());
    store.delete_intended().unwrap();
    assert!(!folder.exists() && store.intended_deletions().unwrap().is_empty());
}

#[test]
fn a_verdict_survives_the_crash_between_import_and_end_of_attempt() {
    let (directory, store) = store();
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    records(&store, &job, 1).put(&Record::Verdict(Verdict::Succeeded), true).unwrap();
    store.import(&job.id, 1, &mut ProgressPace::default()).unwrap();
    drop(store);
    let store = Store::open(directory.path()).unwrap();
    store.finish_attempt(&job.id, 1, &LossCause::new(Reason::ServerRestart, LossKind::Harmless)).unwrap();
    assert_eq!(store.job(&job.id).unwrap().unwrap().state, State::Succeeded);
}

#[test]
fn requests_that_come_while_a_worker_ends_are_kept() {
    let (_directory, store) = store();
    let loss = LossCause::new(Reason::WorkerCrash, LossKind::Death);
    // A cancellation before the end of a successful attempt.
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    records(&store, &job, 1).put(&Record::Verdict(Verdict::Succeeded), true).unwrap();
    store.import(&job.id, 1, &mut ProgressPace::default()).unwrap();
    store.change(&job.id, Trigger::Cancel, &Change::because(Reason::UserCancel)).unwrap();
    store.finish_attempt(&job.id, 1, &loss).unwrap();
    assert_eq!(store.job(&job.id).unwrap().unwrap().state, State::Canceled);
    // A pause whose worker had to be killed: the job is paused, and no death counts.
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    store.change(&job.id, Trigger::Pause, &Change::because(Reason::UserPause)).unwrap();
    store.finish_attempt(&job.id, 1, &loss).unwrap();
    let row = store.job(&job.id).unwrap().unwrap();
    assert_eq!((row.state, row.reason, row.deaths), (State::Paused, Some(Reason::UserPause), 0));
    // A drain whose service was killed before it imported the verdict.
    let job = submit(&store, &json!({}));
    store.claim(|_, _| true).unwrap();
    store.change(&job.id, Trigger::Pause, &Change::because(Reason::ServerRestart)).unwrap();
    records(&store, &job, 1).put(&Record::Verdict(Verdict::Paused { reason: None }), true).unwrap();
    store.import(&job.id, 1, &mut ProgressPace::default()).unwrap();
    store.finish_attempt(&job.id, 1, &loss).unwrap();
    assert_eq!(store.job(&job.id).unwrap().unwrap().state, State::Queued);
    // A full disk during a person's pause does not make it go on by itself.
    let job = submit(&store, &json!({"priority": 9}));
    store.claim(|_, _| true).unwrap();
    store.change(&job.id, Trigger::Pause, &Change::because(Reason::UserPause)).unwrap();
    let verdict = Verdict::Paused { reason: Some(Reason::StorageEnospc) };
    records(&store, &job, 1).put(&Record::Verdict(verdict), true).unwrap();
    store.import(&job.id, 1, &mut ProgressPace::default()).unwrap();
    store.finish_attempt(&job.id, 1, &loss).unwrap();
    assert_eq!(store.job(&job.id).unwrap().unwrap().reason, Some(Reason::UserPause));
}
