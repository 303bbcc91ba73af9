//! What has become of one attempt, judged by the cluster's table and by what the attempt's files show.

use super::files::Seen;
use super::table::{Ending, JobState, Row, Table};
use super::ticket::{ClusterJob, Stage};
use crate::service::executor::{EndCause, Eviction, Phase};
use crate::spec::requests::NOT_STARTED_CODE;
use std::time::{Duration, Instant};

/// Answers without its name after which a job that the cluster certainly had is taken for forgotten.
const FORGOTTEN: u32 = 3;
/// Answers without its name after which a submission without an answer is repeated: one right after the controller woke is no proof.
const NEVER_THERE: u32 = 5;
/// Signs of life that may be missing from a job that the cluster has forgotten.
const MISSING_HEARTBEATS: u32 = 3;
/// The signal with which the cluster ends what it was told to end.
const SIGTERM: i32 = 15;

/// Times by which an attempt is judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    /// Time that a file may take from one node to another.
    pub(super) late_files: Duration,
    /// Time between two signs of life.
    pub(super) heartbeat: Duration,
}

/// What to do about an attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Judgement {
    /// It waits or works.
    Lives,
    /// The cluster never had it: the same script is to be submitted again.
    Repeat,
    /// The cluster's job is over, and no process seems to have begun the attempt: it is over if it can be claimed.
    EndedUnclaimed(EndCause),
    /// It is over.
    Ended(EndCause),
}

/// What is known of an attempt.
#[derive(Debug)]
pub(super) struct Tracking {
    /// The last answer that was looked at.
    round: u64,
    /// Answers in a row without its name.
    absent: u32,
    /// Its row in the last answer that had one.
    row: Option<Row>,
    /// When its end was first seen.
    end_seen: Option<Instant>,
    /// Whether the service has ended it.
    pub(super) is_killed: bool,
}

impl Tracking {
    /// Nothing is known but answers up to this one.
    pub(super) fn new(round: u64) -> Self {
        Self { round, absent: 0, row: None, end_seen: None, is_killed: false }
    }

    /// Its row in the table, as last seen.
    pub(super) fn row(&self) -> Option<&Row> {
        self.row.as_ref()
    }

    /// Judges by everything that is known now.
    pub(super) fn judge(
        &mut self,
        (job, stage): (&ClusterJob, &Stage),
        table: &Table,
        seen: &Seen,
        (times, now): (Times, Instant),
    ) -> Judgement {
        // The worker's own last word comes before anything that others say of it.
        if let Some(code) = seen.heartbeat.as_ref().and_then(|last| last.exit_code) {
            let has_begun = code != i32::from(NOT_STARTED_CODE);
            return Judgement::Ended(if has_begun {
                EndCause::Exited { code }
            } else {
                EndCause::Evicted(Eviction::NotBegun)
            });
        }
        let since = match stage {
            Stage::Revoked => return Judgement::Ended(EndCause::Evicted(Eviction::Revoked)),
            Stage::InLine { .. } => return Judgement::Lives,
            Stage::Unsure { since } | Stage::Accepted { since, .. } => *since,
        };
        self.look_at(&job.name, table, seen, since);
        match &self.row {
            Some(row) if self.absent == 0 => match row.state {
                JobState::Ended(ending) if job.is_bundled() && !seen.has_begun() => {
                    // A bundle that fails by itself could not begin; another end came before the attempt's turn.
                    let is_own = ending == Ending::Failed;
                    let why = if is_own { Eviction::NotBegun } else { Eviction::Unreached };
                    Judgement::EndedUnclaimed(EndCause::Evicted(why))
                }
                JobState::Ended(ending) if !seen.has_begun() => Judgement::EndedUnclaimed(self.cause(ending, seen)),
                JobState::Ended(ending) => self.end(self.cause(ending, seen), (times, now)),
                _ => {
                    self.end_seen = None;
                    Judgement::Lives
                }
            },
            _ => self.judge_absent(seen, (times, now)),
        }
    }

    /// Takes its row from an answer that was not looked at before. Only answers that were asked for after the submission count
    /// against it.
    fn look_at(&mut self, name: &str, table: &Table, seen: &Seen, since: Instant) {
        if table.round == self.round {
            return;
        }
        self.round = table.round;
        match table.row(name, seen.owner.as_deref()) {
            Some(row) => (self.row, self.absent) = (Some(row.clone()), 0),
            None if table.asked > since => self.absent += 1,
            None => {}
        }
    }

    fn judge_absent(&mut self, seen: &Seen, (times, now): (Times, Instant)) -> Judgement {
        let was_there = self.row.is_some() || seen.has_begun();
        let gives_life = seen.changed.is_some_and(|at| now.duration_since(at) < times.heartbeat * MISSING_HEARTBEATS);
        match (was_there, self.absent) {
            // A controller that lost its memory does not end what it started: as long as it works, it may.
            (true, FORGOTTEN..) if gives_life && !self.is_killed => {
                self.end_seen = None;
                Judgement::Lives
            }
            (true, FORGOTTEN..) => self.end(self.forgotten(), (times, now)),
            (false, NEVER_THERE..) if self.is_killed => Judgement::Ended(EndCause::Evicted(Eviction::Revoked)),
            (false, NEVER_THERE..) => {
                self.absent = 0;
                Judgement::Repeat
            }
            _ => Judgement::Lives,
        }
    }

    fn forgotten(&self) -> EndCause {
        if self.is_killed { EndCause::Signaled { signal: SIGTERM } } else { EndCause::Evicted(Eviction::Forgotten) }
    }

    /// Over, once its last words have had time to come here. What was killed has none.
    fn end(&mut self, cause: EndCause, (times, now): (Times, Instant)) -> Judgement {
        let since = *self.end_seen.get_or_insert(now);
        let is_settled = self.is_killed || now.duration_since(since) >= times.late_files;
        if is_settled { Judgement::Ended(cause) } else { Judgement::Lives }
    }

    fn cause(&self, ending: Ending, seen: &Seen) -> EndCause {
        if self.is_killed {
            return EndCause::Signaled { signal: SIGTERM };
        }
        match ending {
            Ending::Completed => EndCause::Exited { code: 0 },
            // The program did not start: there is no such file, or a library is missing.
            Ending::Failed if !seen.gave_life() => EndCause::Evicted(Eviction::NotBegun),
            // It was put back into the queue by hand and came second to itself.
            Ending::Failed if seen.was_requeued => EndCause::Evicted(Eviction::Revoked),
            Ending::Failed => EndCause::Exited { code: 1 },
            Ending::Canceled | Ending::Revoked => EndCause::Evicted(Eviction::Revoked),
            Ending::TimeLimit => EndCause::Evicted(Eviction::TimeLimit),
            Ending::NodeLost => EndCause::Evicted(Eviction::NodeLost),
            Ending::Preempted => EndCause::Evicted(Eviction::Preempted),
            Ending::OutOfMemory => EndCause::OutOfMemory,
        }
    }

    /// Whether it works. A suspended job waits, and so does one behind others of its bundle.
    pub(super) fn phase(&self, seen: &Seen, is_bundled: bool) -> Phase {
        match self.row.as_ref().map(|row| row.state) {
            Some(JobState::Suspended) => Phase::Waiting,
            Some(JobState::Running) if !is_bundled => Phase::Running,
            _ if seen.has_begun() => Phase::Running,
            _ => Phase::Waiting,
        }
    }

    /// What it waits for.
    pub(super) fn waits_for(&self, stage: &Stage, table: &Table, is_bundled: bool) -> String {
        let said = match (stage, &self.row) {
            (Stage::Accepted { .. }, Some(row)) if is_bundled && row.state == JobState::Running => {
                "other jobs of its bundle".to_owned()
            }
            (Stage::InLine { said: None }, _) => "not submitted yet".to_owned(),
            (Stage::InLine { said: Some(said) }, _) => said.clone(),
            (Stage::Revoked, _) => "taken back".to_owned(),
            (_, Some(row)) if !matches!(row.reason.as_str(), "" | "None") => row.reason.clone(),
            (Stage::Unsure { .. }, None) => "whether it has the job is not known yet".to_owned(),
            (_, _) => "submitted".to_owned(),
        };
        match &table.trouble {
            Some(trouble) => format!("slurm (it gives no answer: {trouble}; before that: {said})"),
            None => format!("slurm ({said})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Judgement, Times, Tracking};
    use crate::service::executor::slurm::files::Seen;
    use crate::service::executor::slurm::table::Table;
    use crate::service::executor::slurm::ticket::{ClusterJob, Stage};
    use crate::service::executor::{EndCause, Eviction, Phase};
    use crate::spec::heartbeat::Heartbeat;
    use std::time::{Duration, Instant};

    const NAME: &str = "mns-job_1-1";
    const TIMES: Times = Times { late_files: Duration::from_secs(90), heartbeat: Duration::from_secs(15) };

    struct Trial {
        tracking: Tracking,
        table: Table,
        seen: Seen,
        stage: Stage,
        start: Instant,
        /// Place in a bundle.
        place: Option<usize>,
    }

    impl Trial {
        fn new(stage: Stage) -> Self {
            let start = Instant::now();
            Self { tracking: Tracking::new(0), table: Table::new(), seen: Seen::default(), stage, start, place: None }
        }

        fn accepted() -> Self {
            Self::new(Stage::Accepted { since: Instant::now(), id: "7".to_owned() })
        }

        /// Judges, `seconds` after the start, after an answer with these rows.
        fn at(&mut self, seconds: u64, rows: Option<&str>) -> Judgement {
            let now = self.start + Duration::from_secs(seconds);
            if let Some(rows) = rows {
                self.table.take(rows, "mns-", now);
            }
            let job = ClusterJob { name: NAME.to_owned(), place: self.place };
            self.tracking.judge((&job, &self.stage), &self.table, &self.seen, (TIMES, now))
        }

        fn has_begun(&mut self) {
            let host = "node1".to_owned();
            self.seen.heartbeat = Some(Heartbeat { count: 1, memory_bytes: None, host, exit_code: None, cause: None });
            self.seen.changed = Some(self.start);
        }
    }

    fn evicted(eviction: Eviction) -> Judgement {
        Judgement::Ended(EndCause::Evicted(eviction))
    }

    #[test]
    fn an_end_is_believed_after_its_files_had_time_to_come() {
        let mut trial = Trial::accepted();
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|RUNNING|None|node1")), Judgement::Lives);
        trial.has_begun();
        for seconds in [2, 60] {
            assert_eq!(trial.at(seconds, Some("7|mns-job_1-1|FAILED|NonZeroExitCode|node1")), Judgement::Lives);
        }
        assert_eq!(trial.at(93, None), Judgement::Ended(EndCause::Exited { code: 1 }));
    }

    #[test]
    fn the_workers_own_last_word_is_believed_at_once() {
        let mut trial = Trial::accepted();
        trial.has_begun();
        trial.seen.heartbeat.as_mut().unwrap().exit_code = Some(0);
        assert_eq!(trial.at(1, None), Judgement::Ended(EndCause::Exited { code: 0 }));
        trial.seen.heartbeat.as_mut().unwrap().exit_code = Some(75);
        assert_eq!(trial.at(1, None), evicted(Eviction::NotBegun));
    }

    #[test]
    fn a_job_that_is_killed_in_the_queue_has_no_last_words() {
        let mut trial = Trial::accepted();
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|PENDING|Priority|")), Judgement::Lives);
        assert_eq!(trial.tracking.waits_for(&trial.stage, &trial.table, false), "slurm (Priority)");
        let over = EndCause::Evicted(Eviction::Revoked);
        assert_eq!(trial.at(2, Some("7|mns-job_1-1|CANCELLED|None|")), Judgement::EndedUnclaimed(over));
    }

    #[test]
    fn an_error_is_no_answer_and_no_answer_changes_nothing() {
        let mut trial = Trial::accepted();
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|RUNNING|None|node1")), Judgement::Lives);
        for seconds in 2..1000 {
            assert_eq!(trial.at(seconds, None), Judgement::Lives);
        }
        trial.table.trouble = Some("squeue gave no answer within 60 s".to_owned());
        assert!(trial.tracking.waits_for(&trial.stage, &trial.table, false).contains("gives no answer"));
    }

    #[test]
    fn a_forgotten_job_goes_on_while_it_gives_signs_of_life() {
        let mut trial = Trial::accepted();
        trial.at(1, Some("7|mns-job_1-1|RUNNING|None|node1"));
        trial.has_begun();
        for seconds in 2..40 {
            assert_eq!(trial.at(seconds, Some("")), Judgement::Lives);
        }
        // Its last sign of life is 46 s old, and nothing more comes.
        assert_eq!(trial.at(46, Some("")), Judgement::Lives);
        assert_eq!(trial.at(137, Some("")), evicted(Eviction::Forgotten));
    }

    #[test]
    fn a_lost_answer_is_looked_for_five_times_before_the_submission_is_repeated() {
        let mut trial = Trial::new(Stage::Unsure { since: Instant::now() });
        for seconds in 1..5 {
            assert_eq!(trial.at(seconds, Some("8|mns-another-1|RUNNING|None|node1")), Judgement::Lives);
        }
        assert_eq!(trial.at(5, Some("")), Judgement::Repeat);
        assert_eq!(trial.at(6, Some("")), Judgement::Lives);
        assert_eq!(trial.at(7, Some("7|mns-job_1-1|RUNNING|None|node1")), Judgement::Lives);
        assert_eq!(trial.tracking.phase(&trial.seen, false), Phase::Running);
    }

    #[test]
    fn a_lost_answer_whose_job_has_begun_is_never_repeated() {
        let mut trial = Trial::new(Stage::Unsure { since: Instant::now() });
        trial.has_begun();
        for seconds in 1..20 {
            assert_eq!(trial.at(seconds, Some("")), Judgement::Lives);
        }
    }

    #[test]
    fn every_end_has_its_cause() {
        let cause = |word: &str, begins: bool| {
            let mut trial = Trial::accepted();
            if begins {
                trial.has_begun();
            }
            trial.at(1, Some(&format!("7|mns-job_1-1|{word}|None|node1")));
            trial.at(100, None)
        };
        for (word, eviction) in [
            ("NODE_FAIL", Eviction::NodeLost),
            ("PREEMPTED", Eviction::Preempted),
            ("TIMEOUT", Eviction::TimeLimit),
            ("CANCELLED", Eviction::Revoked),
        ] {
            assert_eq!(cause(word, true), evicted(eviction), "{word}");
        }
        assert_eq!(cause("OUT_OF_MEMORY", true), Judgement::Ended(EndCause::OutOfMemory));
        let not_begun = EndCause::Evicted(Eviction::NotBegun);
        assert_eq!(cause("FAILED", false), Judgement::EndedUnclaimed(not_begun));
    }

    #[test]
    fn a_bundle_that_ends_gives_back_what_it_has_not_begun() {
        let mut trial = Trial::accepted();
        trial.place = Some(4);
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|RUNNING|None|node1")), Judgement::Lives);
        assert_eq!(trial.tracking.phase(&trial.seen, true), Phase::Waiting);
        assert!(trial.tracking.waits_for(&trial.stage, &trial.table, true).contains("bundle"));
        let unreached = EndCause::Evicted(Eviction::Unreached);
        assert_eq!(trial.at(2, Some("7|mns-job_1-1|TIMEOUT|None|node1")), Judgement::EndedUnclaimed(unreached));
    }

    #[test]
    fn a_program_that_does_not_start_has_not_died() {
        let mut trial = Trial::accepted();
        trial.seen.owner = Some("7".to_owned());
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|FAILED|NonZeroExitCode|node1")), Judgement::Lives);
        assert_eq!(trial.at(100, None), evicted(Eviction::NotBegun));
        let mut trial = Trial::accepted();
        trial.place = Some(0);
        let not_begun = EndCause::Evicted(Eviction::NotBegun);
        assert_eq!(
            trial.at(1, Some("7|mns-job_1-1|FAILED|NonZeroExitCode|node1")),
            Judgement::EndedUnclaimed(not_begun)
        );
    }

    #[test]
    fn a_claim_without_an_owner_is_somebodys() {
        let mut trial = Trial::accepted();
        trial.seen.is_claimed = true;
        assert_eq!(trial.at(1, Some("7|mns-job_1-1|NODE_FAIL|None|node1")), Judgement::Lives);
        assert_eq!(trial.at(92, None), evicted(Eviction::NodeLost));
    }
}
