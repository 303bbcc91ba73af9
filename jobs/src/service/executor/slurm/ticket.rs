//! Tickets: how far the submission of an attempt is, and where in the cluster it is looked for.

use crate::service::executor::{AttemptPlace, Needs};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// An attempt to submit.
#[derive(Debug, Clone)]
pub(super) struct Order {
    pub(super) attempt: AttemptPlace,
    pub(super) needs: Needs,
    pub(super) ticket: Ticket,
}

/// How far a submission is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Stage {
    /// In this service's line, with what the cluster said when it was last asked.
    InLine { said: Option<String> },
    /// The cluster may or may not have it.
    Unsure { since: Instant },
    /// The cluster took it.
    Accepted { since: Instant, id: String },
    /// Taken back before the cluster had it.
    Revoked,
}

/// Where in the cluster an attempt is looked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ClusterJob {
    /// The name of the cluster's job.
    pub(super) name: String,
    /// The attempt's place in a bundle; None where the job is the attempt's alone.
    pub(super) place: Option<usize>,
}

impl ClusterJob {
    /// A job of the attempt's own.
    pub(super) fn own(name: String) -> Self {
        Self { name, place: None }
    }

    /// Whether it shares its job with others.
    pub(super) fn is_bundled(&self) -> bool {
        self.place.is_some()
    }
}

/// A submission, seen by the worker and by the thread that submits.
#[derive(Debug, Clone)]
pub(super) struct Ticket(Arc<Mutex<Held>>);

#[derive(Debug)]
struct Held {
    stage: Stage,
    job: ClusterJob,
    /// Running time that is forecast, in seconds, of an attempt that may be bundled.
    short_s: Option<f64>,
}

impl Ticket {
    pub(super) fn new(stage: Stage, job: ClusterJob, short_s: Option<f64>) -> Self {
        Self(Arc::new(Mutex::new(Held { stage, job, short_s })))
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn stage(&self) -> Stage {
        self.held().stage.clone()
    }

    /// Where in the cluster it is looked for.
    pub(super) fn job(&self) -> ClusterJob {
        self.held().job.clone()
    }

    /// Running time that is forecast, of an attempt that may be bundled.
    pub(super) fn short_s(&self) -> Option<f64> {
        self.held().short_s
    }

    /// Moves on, unless it was taken back.
    pub(super) fn set(&self, stage: Stage) {
        let mut held = self.held();
        if held.stage != Stage::Revoked {
            held.stage = stage;
        }
    }

    /// Takes back what is in line; false where the cluster may have it.
    pub(super) fn revoke(&self) -> bool {
        let mut held = self.held();
        let is_in_line = matches!(held.stage, Stage::InLine { .. } | Stage::Revoked);
        if is_in_line {
            held.stage = Stage::Revoked;
        }
        is_in_line
    }

    /// Takes back what the cluster may have: nothing is submitted or repeated for it any more.
    pub(super) fn take_back(&self) {
        self.held().stage = Stage::Revoked;
    }

    /// Begins the submission as a job of the cluster; false where it was taken back. From here on the cluster may have it.
    pub(super) fn begin(&self, job: ClusterJob) -> bool {
        let mut held = self.held();
        let is_wanted = held.stage != Stage::Revoked;
        if is_wanted {
            held.stage = Stage::Unsure { since: Instant::now() };
            held.job = job;
        }
        is_wanted
    }

    /// Back into the line.
    pub(super) fn line_up(&self) {
        self.set(Stage::InLine { said: None });
    }
}

/// One call of `sbatch`.
pub(super) struct Submission {
    /// Name of the cluster's job.
    pub(super) name: String,
    /// The attempts that it works on.
    pub(super) orders: Vec<Order>,
    /// Arguments of `sbatch`.
    pub(super) arguments: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::{ClusterJob, Stage, Ticket};

    #[test]
    fn what_was_taken_back_is_never_submitted() {
        let job = || ClusterJob::own("mns-job_1-1".to_owned());
        let ticket = Ticket::new(Stage::InLine { said: None }, job(), None);
        assert!(ticket.revoke() && !ticket.begin(job()));
        ticket.line_up();
        assert_eq!(ticket.stage(), Stage::Revoked);
        let ticket = Ticket::new(Stage::InLine { said: None }, job(), None);
        assert!(ticket.begin(job()) && !ticket.revoke());
    }
}
