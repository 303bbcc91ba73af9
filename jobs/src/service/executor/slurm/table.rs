//! The table of the cluster's jobs, as `squeue` answers.

use std::collections::{BTreeMap, HashMap};
use std::time::Instant;

/// What `squeue` is asked for: id, name, state, reason, nodes, nodes that are left out.
pub const FORMAT: &str = "%i|%j|%T|%r|%N|%x";

/// Beginnings of the reasons for which a job waits where no node that it may run on works.
const NO_NODES: [&str; 4] = ["ReqNodeNotAvail", "Nodes required for job are DOWN", "BadConstraints", "PartitionConfig"];

/// A line of `squeue`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The cluster's number of the job. It is neither durable nor unique.
    pub id: String,
    /// Its name, which is the key.
    pub name: String,
    /// Its state.
    pub state: JobState,
    /// Why it is in its state.
    pub reason: String,
    /// Where it runs.
    pub nodes: String,
    /// Nodes that it must not run on.
    pub excluded: String,
}

/// What the cluster's words for states say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobState {
    /// In the queue.
    Waiting,
    /// On a node.
    Running,
    /// On a node, stopped for a while.
    Suspended,
    /// Over.
    Ended(Ending),
}

/// How the cluster says that a job ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// With exit code 0.
    Completed,
    /// With another exit code, or by a signal.
    Failed,
    /// By `scancel`.
    Canceled,
    /// By its limit of time.
    TimeLimit,
    /// With its node.
    NodeLost,
    /// For another job.
    Preempted,
    /// By its limit of memory.
    OutOfMemory,
    /// By another cluster of a federation.
    Revoked,
}

impl JobState {
    /// The state of a word. A word that is not known is of a job that is still there: ends are believed only when they are known.
    #[must_use]
    pub fn from_word(word: &str) -> Self {
        match word {
            "PENDING" | "CONFIGURING" | "REQUEUED" | "REQUEUE_FED" | "REQUEUE_HOLD" | "RESV_DEL_HOLD"
            | "SPECIAL_EXIT" => Self::Waiting,
            "SUSPENDED" | "STOPPED" => Self::Suspended,
            "COMPLETED" => Self::Ended(Ending::Completed),
            "FAILED" => Self::Ended(Ending::Failed),
            "CANCELLED" => Self::Ended(Ending::Canceled),
            "TIMEOUT" | "DEADLINE" => Self::Ended(Ending::TimeLimit),
            "NODE_FAIL" | "BOOT_FAIL" | "LAUNCH_FAILED" | "RECONFIG_FAIL" => Self::Ended(Ending::NodeLost),
            "PREEMPTED" => Self::Ended(Ending::Preempted),
            "OUT_OF_MEMORY" => Self::Ended(Ending::OutOfMemory),
            "REVOKED" => Self::Ended(Ending::Revoked),
            _ => Self::Running,
        }
    }

    /// Whether the job is not over.
    #[must_use]
    pub fn is_alive(self) -> bool {
        !matches!(self, Self::Ended(_))
    }
}

impl Row {
    /// Whether it waits for nodes that are not to be had, and not for its turn.
    #[must_use]
    pub fn waits_for_nodes(&self) -> bool {
        let has = |word: &&str| self.reason.starts_with(*word);
        self.state == JobState::Waiting && NO_NODES.iter().any(has)
    }

    /// A row of a line; None where the line is none, such as a warning of the cluster.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let mut parts = line.trim_end().split('|');
        let (id, name, state, reason, nodes) =
            (parts.next()?, parts.next()?, parts.next()?, parts.next()?, parts.next()?);
        let is_id = !id.is_empty() && id.starts_with(|c: char| c.is_ascii_digit());
        let is_word =
            !state.is_empty() && state.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_');
        let excluded = parts.next().unwrap_or_default();
        (is_id && is_word && parts.next().is_none()).then(|| Self {
            id: id.to_owned(),
            name: name.to_owned(),
            state: JobState::from_word(state),
            reason: reason.to_owned(),
            nodes: nodes.to_owned(),
            excluded: excluded.to_owned(),
        })
    }
}

/// The last answer, and how old it is.
#[derive(Debug, Clone)]
pub struct Table {
    rows: HashMap<String, Vec<Row>>,
    /// Number of answers so far.
    pub round: u64,
    /// When the command of the last answer was started.
    pub asked: Instant,
    /// What stands in the way of an answer since then.
    pub trouble: Option<String>,
}

impl Table {
    /// The table before the first answer.
    #[must_use]
    pub fn new() -> Self {
        Self { rows: HashMap::new(), round: 0, asked: Instant::now(), trouble: None }
    }

    /// Takes an answer. Only rows whose names begin with the prefix are kept: the user may have other jobs.
    pub fn take(&mut self, answer: &str, prefix: &str, asked: Instant) {
        self.rows.clear();
        for row in answer.lines().filter_map(Row::parse).filter(|row| row.name.starts_with(prefix)) {
            self.rows.entry(row.name.clone()).or_default().push(row);
        }
        self.round += 1;
        self.asked = asked;
        self.trouble = None;
    }

    /// The row of a name that counts: that of the owner of the claim, else one that is alive, else the last.
    #[must_use]
    pub fn row(&self, name: &str, owner: Option<&str>) -> Option<&Row> {
        let rows = self.rows.get(name)?;
        let owned = owner.and_then(|owner| rows.iter().find(|row| row.id == owner));
        owned.or_else(|| rows.iter().find(|row| row.state.is_alive())).or_else(|| rows.last())
    }

    /// All rows of a name.
    #[must_use]
    pub fn rows(&self, name: &str) -> &[Row] {
        self.rows.get(name).map_or(&[], Vec::as_slice)
    }

    /// How many jobs each node runs.
    #[must_use]
    pub fn jobs_by_node(&self) -> BTreeMap<String, u64> {
        let mut jobs = BTreeMap::new();
        for row in self.all().filter(|row| row.state.is_alive() && !row.nodes.is_empty()) {
            *jobs.entry(row.nodes.clone()).or_default() += 1;
        }
        jobs
    }

    /// Every row.
    pub fn all(&self) -> impl Iterator<Item = &Row> {
        self.rows.values().flatten()
    }

    /// Numbers of waiting and of running jobs.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        let alive = self.all().filter(|row| row.state.is_alive()).count();
        let running = self.all().filter(|row| row.state == JobState::Running).count();
        (alive - running, running)
    }
}

#[cfg(test)]
mod tests {
    use super::{Ending, JobState, Row, Table};
    use std::time::Instant;

    fn table(answer: &str) -> Table {
        let mut table = Table::new();
        table.take(answer, "mns-", Instant::now());
        table
    }

    #[test]
    fn jobs_that_wait_for_their_turn_do_not_wait_for_nodes() {
        let waits = |line: &str| Row::parse(line).unwrap().waits_for_nodes();
        assert!(waits("2|mns-a-1|PENDING|ReqNodeNotAvail, UnavailableNodes:node1||node2"));
        assert!(!waits("2|mns-a-1|PENDING|Resources||node2"));
        assert!(!waits("2|mns-a-1|RUNNING|None|node1|node2"));
        assert_eq!(Row::parse("2|mns-a-1|PENDING|Priority||node2").unwrap().excluded, "node2");
    }

    #[test]
    fn nodes_have_the_jobs_that_live_on_them() {
        let mut table = Table::new();
        let answer = "1|mns-a-1|RUNNING|None|node1\n2|mns-b-1|RUNNING|None|node2\n3|mns-c-1|RUNNING|None|node1\n\
                      4|mns-d-1|PENDING|Resources|\n5|mns-e-1|FAILED|NonZeroExitCode|node2\n";
        table.take(answer, "mns-", Instant::now());
        let found: Vec<(String, u64)> = table.jobs_by_node().into_iter().collect();
        assert_eq!(found, [("node1".to_owned(), 2), ("node2".to_owned(), 1)]);
    }

    #[test]
    fn lines_that_are_no_rows_and_jobs_of_others_are_left_out() {
        let answer = "slurm_load_jobs error: Unable to contact\n\
                      12|mns-a-1|RUNNING|None|node1\n13|my own job|RUNNING|None|node1\n\
                      x|mns-b-1|RUNNING|None|\n14|mns-b-1|\n15|mns-c-1|PENDING|(Resources|held)||node3\n16|mns-c-1|PENDING|Priority|\n";
        let table = table(answer);
        assert_eq!(table.all().count(), 2);
        assert_eq!(table.counts(), (1, 1));
        assert_eq!(table.row("mns-c-1", None).unwrap().reason, "Priority");
        assert!(table.row("mns-b-1", None).is_none());
    }

    #[test]
    fn of_several_rows_the_owner_counts_then_the_living_then_the_last() {
        let table = table(
            "7|mns-a-1|FAILED|NonZeroExitCode|node1\n8|mns-a-1|RUNNING|None|node2\n9|mns-a-1|FAILED|NonZeroExitCode|node2\n",
        );
        let id = |owner| table.row("mns-a-1", owner).unwrap().id.clone();
        assert_eq!(id(Some("7")), "7");
        assert_eq!(id(None), "8");
        // The owner has left the table.
        assert_eq!(id(Some("6")), "8");
    }

    #[test]
    fn an_end_is_believed_only_when_its_word_is_known() {
        let state = |word: &str| Row::parse(&format!("1|mns-a-1|{word}|None|node1")).unwrap().state;
        assert_eq!(state("NODE_FAIL"), JobState::Ended(Ending::NodeLost));
        assert_eq!(state("COMPLETING"), JobState::Running);
        assert_eq!(state("SOMETHING_OF_2031"), JobState::Running);
        assert_eq!(state("CONFIGURING"), JobState::Waiting);
    }
}
