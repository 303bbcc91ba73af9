//! The worker of one attempt on the cluster.

use super::Cluster;
use super::errands::Errand;
use super::files::Seen;
use super::submission::Submitter;
use super::table::JobState;
use super::ticket::{Order, Stage};
use super::tracking::{Judgement, Times, Tracking};
use crate::service::executor::{EndCause, Eviction, Phase, Worker, WorkerUsage};
use crate::spec::attempt_files;
use crate::spec::requests::Request;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Owner of a claim by which the service takes an attempt back.
const CLAIMED_BY_SERVICE: &str = "service\n";
/// Time that a worker has to end after it was told to, beside that for its files to come.
const TIME_TO_STOP: Duration = Duration::from_secs(10);
/// The signal with which a worker ends itself when it is told to stop.
const SIGKILL: i32 = 9;
/// Time between two calls that end the same job.
const KILL_INTERVAL: Duration = Duration::from_secs(5);

/// One attempt on the cluster, from its submission to its end.
pub(super) struct SlurmWorker {
    name: String,
    order: Order,
    cluster: Arc<Cluster>,
    submitter: Submitter,
    tracking: Tracking,
    /// When it was first seen at work.
    at_work: Option<Instant>,
    /// When it was first told to end at once, and when the cluster was last told so.
    killed: Option<Instant>,
    kill_sent: Option<Instant>,
    /// Whether another process has the claim.
    is_claimed_elsewhere: bool,
    end: Option<EndCause>,
}

impl SlurmWorker {
    pub(super) fn new(name: String, order: Order, cluster: Arc<Cluster>, submitter: Submitter) -> Self {
        let tracking = Tracking::new(cluster.table().round);
        Self {
            name,
            order,
            cluster,
            submitter,
            tracking,
            at_work: None,
            killed: None,
            kill_sent: None,
            is_claimed_elsewhere: false,
            end: None,
        }
    }

    /// Puts it into the line of submissions.
    pub(super) fn submit(&self) {
        self.submitter.submit(&self.order);
    }

    /// The cluster's number, where it is known.
    fn id(&self) -> Option<String> {
        match (self.tracking.row(), self.order.ticket.stage()) {
            (Some(row), _) => Some(row.id.clone()),
            (None, Stage::Accepted { id, .. }) => Some(id),
            (None, _) => None,
        }
    }

    /// Appends a request to the attempt's file of requests.
    fn write_request(&self, request: Request) -> io::Result<()> {
        let path = self.order.attempt.directory.join(attempt_files::CONTROL);
        let mut file = OpenOptions::new().create(true).append(true).open(path)?;
        file.write_all(format!("{}\n", request.word()).as_bytes())?;
        file.sync_data()
    }

    fn tell(&self, request: Request) {
        if let Err(error) = self.write_request(request) {
            tracing::warn!(name = self.name, request = request.word(), %error, "a request could not be written");
        }
    }

    /// Takes an attempt that no process has begun: the service claims it itself, so that none ever will. It does not need the
    /// cluster's answer, which may take a while.
    fn take_back(&mut self) -> bool {
        if self.cluster.files.seen(&self.name).has_begun() || !self.claim() {
            return false;
        }
        // A submission that is under way must not be repeated.
        self.order.ticket.take_back();
        self.end = Some(EndCause::Evicted(Eviction::Revoked));
        self.end_own_job();
        true
    }

    /// Lets the cluster end a job that is this attempt's alone.
    fn end_own_job(&self) {
        let job = self.order.ticket.job();
        if !job.is_bundled() {
            self.cluster.errands.send(Errand::End { name: job.name, id: self.id() });
        }
    }

    /// Claims an attempt that no process has begun; false where one has.
    fn claim(&mut self) -> bool {
        let claim = self.order.attempt.directory.join(attempt_files::CLAIM);
        let is_ours = std::fs::create_dir(&claim).is_ok();
        self.is_claimed_elsewhere = !is_ours;
        if is_ours {
            // A claim without an owner holds as well.
            let _ = std::fs::write(claim.join(attempt_files::CLAIM_OWNER), CLAIMED_BY_SERVICE);
        }
        is_ours
    }

    fn is_bundled(&self) -> bool {
        self.order.ticket.job().is_bundled()
    }

    /// What follows from its end.
    fn note_end(&self, cause: EndCause) {
        let EndCause::Evicted(eviction) = cause else { return };
        metrics::counter!("meniscus_slurm_evictions_total", "cause" => eviction.word()).increment(1);
        if matches!(eviction, Eviction::NodeLost | Eviction::NotBegun) {
            let heartbeat = self.cluster.files.seen(&self.name).heartbeat;
            let node = self.tracking.row().map(|row| row.nodes.clone()).filter(|node| !node.is_empty());
            if let Some(node) = node.or(heartbeat.map(|last| last.host)) {
                self.cluster.note_loss(&node);
            }
        }
        if eviction != Eviction::Revoked {
            // Whatever is left of it is believed no longer.
            self.tell(Request::Stop);
        }
    }
}

impl Worker for SlurmWorker {
    fn handle(&self) -> &str {
        &self.name
    }

    fn send(&mut self, request: Request) {
        // What has not begun has nothing to keep.
        if request != Request::Checkpoint && (self.order.ticket.revoke() || self.take_back()) {
            return;
        }
        self.tell(request);
        // The workers of a bundle look for themselves.
        if let (Phase::Running, Some(id), false) = (self.phase(), self.id(), self.is_bundled()) {
            self.cluster.errands.send(Errand::Hint { name: self.name.clone(), id });
        }
    }

    fn time_since_heartbeat(&self) -> Duration {
        // Silence counts as far as a sign of life could have been seen: a file system that did not answer here says nothing of a worker.
        let seen = self.cluster.files.seen(&self.name);
        let since = seen.changed.into_iter().chain(self.at_work).max();
        seen.looked.zip(since).map_or(Duration::ZERO, |(looked, since)| looked.saturating_duration_since(since))
    }

    fn phase(&self) -> Phase {
        self.tracking.phase(&self.cluster.files.seen(&self.name), self.is_bundled())
    }

    fn waits_for(&self) -> Option<String> {
        let is_waiting = self.phase() == Phase::Waiting && self.end.is_none();
        is_waiting
            .then(|| self.tracking.waits_for(&self.order.ticket.stage(), &self.cluster.table(), self.is_bundled()))
    }

    fn has_news(&mut self) -> bool {
        self.cluster.files.take_news(&self.name)
    }

    fn usage(&self) -> WorkerUsage {
        let heartbeat = self.cluster.files.seen(&self.name).heartbeat;
        WorkerUsage { memory_bytes: heartbeat.and_then(|last| last.memory_bytes) }
    }

    fn poll(&mut self) -> io::Result<Option<EndCause>> {
        if self.end.is_some() {
            return Ok(self.end);
        }
        let seen = self.cluster.files.seen(&self.name);
        let (stage, settings) = (self.order.ticket.stage(), &self.cluster.settings);
        let times = Times { late_files: settings.late_files, heartbeat: settings.heartbeat };
        let job = self.order.ticket.job();
        let judged = {
            let table = self.cluster.table();
            let seen = Seen { is_claimed: self.is_claimed_elsewhere, ..seen.clone() };
            self.tracking.judge((&job, &stage), &table, &seen, (times, Instant::now()))
        };
        if self.at_work.is_none() && self.tracking.phase(&seen, job.is_bundled()) == Phase::Running {
            self.at_work = Some(Instant::now());
        }
        match judged {
            // A process that the node cannot end, or of which the cluster says nothing any more: its records are believed no longer.
            Judgement::Lives if self.killed.is_some_and(|at| at.elapsed() > TIME_TO_STOP + times.late_files) => {
                self.end = Some(EndCause::Signaled { signal: SIGKILL });
            }
            Judgement::Lives => {}
            Judgement::EndedUnclaimed(cause) => {
                if self.claim() {
                    self.end = Some(cause);
                    self.note_end(cause);
                }
            }
            Judgement::Repeat => {
                tracing::warn!(
                    name = self.name,
                    "the cluster never had this attempt; the same script is submitted again"
                );
                self.order.ticket.line_up();
                self.submit();
            }
            Judgement::Ended(cause) => {
                self.end = Some(cause);
                self.note_end(cause);
            }
        }
        Ok(self.end)
    }

    fn kill(&mut self) {
        self.tracking.is_killed = true;
        if self.end.is_some() || self.order.ticket.revoke() || self.take_back() {
            return;
        }
        if self.killed.is_none() {
            self.killed = Some(Instant::now());
            self.tell(Request::Stop);
        }
        if self.kill_sent.is_some_and(|at| at.elapsed() < KILL_INTERVAL) {
            return;
        }
        self.kill_sent = Some(Instant::now());
        let is_over = self.tracking.row().is_some_and(|row| matches!(row.state, JobState::Ended(_)));
        if !is_over {
            self.end_own_job();
            self.cluster.poll_soon();
        }
    }
}

impl Drop for SlurmWorker {
    /// One that has not ended goes on without this service.
    fn drop(&mut self) {
        self.cluster.forget(&self.name, self.end.is_some());
    }
}
