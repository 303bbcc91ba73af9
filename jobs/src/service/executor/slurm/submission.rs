//! Submissions: one thread that runs `sbatch`, one attempt after another.

use super::command::{self, NoAnswer};
use super::errands::Errand;
use super::ticket::{Order, Stage, Submission};
use super::{Cluster, Settings, bundling};
use crate::service::growing_pause::GrowingPause;
use crate::system::breakpoints::pass;
use std::collections::VecDeque;
use std::io;
use std::sync::Weak;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// Time that `sbatch` has to answer.
const TIME_LIMIT: Duration = Duration::from_secs(60);
/// Time between two looks for new orders while others wait for the end of a pause.
const TICK: Duration = Duration::from_millis(100);

/// What `sbatch` says before it sleeps and tries again by itself.
const IT_REPEATS: &str = "sleeping and retrying";

/// What an answer of `sbatch` means.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Answer {
    /// It has the job, under this number.
    Accepted(String),
    /// It takes no job at the moment, or none of ours.
    NotNow(String),
    /// It does not take this job.
    Refused(String),
    /// It may have it.
    Unsure(String),
}

/// Words of answers by which the cluster certainly has not taken a job, and takes none for the moment.
const NOT_NOW: [&str; 11] = [
    IT_REPEATS,
    "authentication",
    "temporarily unable",
    "submit limit",
    "submitjob",
    "job submit limit",
    "violates accounting/qos policy",
    "connect failure",
    "connection refused",
    "cannot be run",
    "reached configured",
];

/// Words of answers to which the cluster may have taken the job all the same.
const UNSURE: [&str; 5] = ["timed out", "timeout", "zero bytes", "communication", "unexpected message"];

fn answer(said: Result<String, NoAnswer>) -> Answer {
    let text = match said {
        Ok(output) => {
            let id = output.lines().next_back().unwrap_or_default().split(';').next().unwrap_or_default().trim();
            let is_id = !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit());
            return if is_id {
                Answer::Accepted(id.to_owned())
            } else {
                Answer::Unsure(format!("sbatch said {output:?} instead of a number"))
            };
        }
        Err(error @ NoAnswer::NotRun(_)) => return Answer::NotNow(error.to_string()),
        Err(error @ NoAnswer::TimedOut { .. }) => return Answer::Unsure(error.to_string()),
        Err(NoAnswer::Failed(text)) => text,
    };
    let lower = text.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    // The last line is the reason; those before are tries that the command made by itself.
    let reason = text.lines().next_back().unwrap_or_default().trim_start_matches("sbatch: ").trim().to_owned();
    if has(&NOT_NOW) {
        Answer::NotNow(reason)
    } else if has(&UNSURE) {
        Answer::Unsure(reason)
    } else if lower.contains("batch job submission failed") || lower.contains("error:") {
        Answer::Refused(reason)
    } else {
        Answer::Unsure(reason)
    }
}

/// Runs `sbatch` once. It repeats by itself what the cluster does not take, for minutes: the first refusal is the answer.
fn ask(settings: &Settings, arguments: &[String], excluded: &[String]) -> Answer {
    let by_site = settings.excluded().filter(|nodes| !nodes.is_empty()).map(str::to_owned);
    let nodes: Vec<String> = by_site.into_iter().chain(excluded.iter().cloned()).collect();
    // The last of several counts.
    let exclude = (!nodes.is_empty()).then(|| format!("--exclude={}", nodes.join(",")));
    let asked = Instant::now();
    let (options, script) = arguments.split_at(arguments.len().saturating_sub(1));
    let all = options.iter().chain(&exclude).chain(script);
    let said = command::run(settings.command("sbatch"), all, TIME_LIMIT, Some(IT_REPEATS));
    pass("slurm/submitted");
    metrics::histogram!("meniscus_slurm_sbatch_seconds").record(asked.elapsed().as_secs_f64());
    answer(said)
}

/// Takes orders.
#[derive(Debug, Clone)]
pub(super) struct Submitter(Sender<Order>);

impl Submitter {
    /// Starts the thread; it ends with the cluster.
    pub(super) fn start(cluster: Weak<Cluster>) -> io::Result<Self> {
        let (sender, receiver) = channel();
        std::thread::Builder::new()
            .name("slurm-submit".to_owned())
            .spawn(move || Line::new(cluster).work(&receiver))?;
        Ok(Self(sender))
    }

    /// Puts an order into the line.
    pub(super) fn submit(&self, order: &Order) {
        // Without a thread the order stays in line, which is what its ticket says.
        let _ = self.0.send(order.clone());
    }
}

/// The line of orders.
struct Line {
    cluster: Weak<Cluster>,
    orders: VecDeque<Order>,
    /// When the line was last empty, and when the last order came.
    begun: Instant,
    grown: Instant,
    /// No call before its end, and none right after another.
    pause: GrowingPause,
    not_before: Instant,
    /// Refusals in a row.
    refused: usize,
}

impl Line {
    fn new(cluster: Weak<Cluster>) -> Self {
        let now = Instant::now();
        Self {
            cluster,
            orders: VecDeque::new(),
            begun: now,
            grown: now,
            pause: GrowingPause::default(),
            not_before: now,
            refused: 0,
        }
    }

    fn work(mut self, receiver: &Receiver<Order>) {
        loop {
            match receiver.recv_timeout(TICK) {
                Ok(order) => self.take(order),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            receiver.try_iter().for_each(|order| self.take(order));
            let Some(cluster) = self.cluster.upgrade() else { return };
            self.orders.retain(|order| order.ticket.stage() != Stage::Revoked);
            let places = cluster.free_places();
            if Instant::now() >= self.not_before
                && !self.pause.is_on()
                && places > 0
                && !bundling::is_gathering(&self.orders, (self.begun, self.grown))
            {
                let orders = bundling::take_next(&mut self.orders, places);
                if !orders.is_empty() {
                    self.submit(&cluster, orders);
                }
            }
        }
    }

    fn take(&mut self, order: Order) {
        self.grown = Instant::now();
        if self.orders.is_empty() {
            self.begun = self.grown;
        }
        self.orders.push_back(order);
    }

    /// Submits one order, or several as a bundle.
    fn submit(&mut self, cluster: &Cluster, orders: Vec<Order>) {
        let settings = &cluster.settings;
        let submission = match bundling::prepare(orders, cluster) {
            Ok(submission) => submission,
            Err((orders, error)) => {
                let pause = self.pause.begin();
                tracing::error!(%error, pause_s = pause.as_secs(), "a bundle could not be written");
                self.give_back(orders, &error.to_string());
                return;
            }
        };
        let Submission { name, orders, arguments } = submission;
        if orders.is_empty() {
            return;
        }
        let excluded = cluster.excluded();
        let mut said = ask(settings, &arguments, &excluded);
        if matches!(said, Answer::Refused(_)) && !excluded.is_empty() {
            // What is left without the nodes that failed may not do: a doubtful node is better than none.
            said = ask(settings, &arguments, &[]);
        }
        self.not_before = Instant::now() + settings.submission_interval;
        let set = |stage: &Stage| orders.iter().for_each(|order| order.ticket.set(stage.clone()));
        match said {
            Answer::Accepted(id) => {
                tracing::info!(name, id, attempts = orders.len(), "submitted to the cluster");
                self.pause.reset();
                self.refused = 0;
                set(&Stage::Accepted { since: Instant::now(), id: id.clone() });
                if orders.iter().all(|order| order.ticket.stage() == Stage::Revoked) {
                    // All of it was taken back while the cluster thought about it.
                    cluster.errands.send(Errand::End { name, id: Some(id) });
                }
            }
            Answer::NotNow(said) => {
                let pause = self.pause.begin();
                tracing::warn!(name, said, pause_s = pause.as_secs(), "the cluster takes no job at the moment");
                bundling::remove(&cluster.shared, &name);
                self.give_back(orders, &said);
            }
            Answer::Refused(said) => {
                // Others may be taken before this one is tried again; where all are refused, the line rests.
                self.refused += 1;
                let pause = if self.refused > self.orders.len() { self.pause.begin() } else { Duration::ZERO };
                bundling::remove(&cluster.shared, &name);
                tracing::warn!(name, said, pause_s = pause.as_secs(), "the cluster refused a job; it is tried again");
                set(&Stage::InLine { said: Some(said) });
                self.orders.extend(orders);
            }
            Answer::Unsure(said) => {
                tracing::warn!(name, said, "whether the cluster has a job is not known; it is looked for by its name");
                set(&Stage::Unsure { since: Instant::now() });
                cluster.poll_soon();
            }
        }
    }

    /// Puts orders back to where they were.
    fn give_back(&mut self, orders: Vec<Order>, said: &str) {
        for order in orders.into_iter().rev() {
            order.ticket.set(Stage::InLine { said: Some(said.to_owned()) });
            self.orders.push_front(order);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::command::NoAnswer;
    use super::{Answer, answer};

    fn failed(text: &str) -> Answer {
        answer(Err(NoAnswer::Failed(text.to_owned())))
    }

    #[test]
    fn a_number_is_an_acceptance_and_nothing_else_is() {
        assert_eq!(answer(Ok("123\n".to_owned())), Answer::Accepted("123".to_owned()));
        assert_eq!(answer(Ok("a warning of the site\n124;cluster2\n".to_owned())), Answer::Accepted("124".to_owned()));
        assert!(matches!(answer(Ok("Submitted batch job 7\n".to_owned())), Answer::Unsure(_)));
        assert!(matches!(answer(Ok(String::new())), Answer::Unsure(_)));
    }

    #[test]
    fn refusals_of_policy_are_not_now() {
        for text in [
            "sbatch: error: QOSMaxSubmitJobPerUserLimit\nsbatch: error: Batch job submission failed: Job violates accounting/QOS policy (job submit limit, user's size and/or time limits)",
            "sbatch: error: Slurm temporarily unable to accept job, sleeping and retrying\nsbatch: error: Batch job submission failed: Resource temporarily unavailable",
            "sbatch: error: Batch job submission failed: Unable to contact slurm controller (connect failure)",
        ] {
            assert!(matches!(failed(text), Answer::NotNow(_)), "{text}");
        }
    }

    #[test]
    fn what_cannot_run_at_all_is_refused_with_the_clusters_words() {
        let said = failed(
            "sbatch: error: invalid partition specified: gpu\nsbatch: error: Batch job submission failed: Invalid partition name specified",
        );
        assert_eq!(
            said,
            Answer::Refused("error: Batch job submission failed: Invalid partition name specified".to_owned())
        );
    }

    #[test]
    fn whatever_may_have_arrived_is_unsure() {
        for text in [
            "sbatch: error: Batch job submission failed: Socket timed out on send/recv operation",
            "sbatch: error: Batch job submission failed: Zero Bytes were transmitted or received",
            "Killed",
            "",
        ] {
            assert!(matches!(failed(text), Answer::Unsure(_)), "{text}");
        }
    }
}
