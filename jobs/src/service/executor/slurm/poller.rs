//! One `squeue` for all jobs, on a thread of its own. An error is no answer: the table before stands, with its age.

use super::errands::Errand;
use super::{Cluster, command, script, table};
use std::collections::{BTreeSet, HashSet};
use std::io;
use std::sync::{PoisonError, Weak};
use std::time::{Duration, Instant};

/// Time that `squeue` has to answer.
const TIME_LIMIT: Duration = Duration::from_secs(60);
/// Least time between two looks, also where one is wanted soon.
const LEAST_INTERVAL: Duration = Duration::from_secs(2);
/// Share of its time that the cluster's controller spends on us, at most.
const PATIENCE: u32 = 5;

/// Starts the thread; it ends with the cluster.
pub(super) fn start(cluster: Weak<Cluster>) -> io::Result<()> {
    std::thread::Builder::new().name("slurm-poll".to_owned()).spawn(move || {
        let (mut nodes, mut asked) = (BTreeSet::new(), HashSet::new());
        while let Some(cluster) = cluster.upgrade() {
            let spent = look(&cluster);
            tell_of_nodes(&cluster, &mut nodes);
            admit_to_any_node(&cluster, &mut asked);
            let poll = cluster.settings.poll;
            let least = (spent * PATIENCE).max(LEAST_INTERVAL.min(poll));
            wait(&cluster, least, least.max(poll));
        }
    })?;
    Ok(())
}

/// Takes one look; the time that it took.
fn look(cluster: &Cluster) -> Duration {
    let asked = Instant::now();
    let answer = command::run(
        cluster.settings.command("squeue"),
        ["--me", "-h", "-t", "all", "-o", table::FORMAT],
        TIME_LIMIT,
        None,
    );
    let spent = asked.elapsed();
    metrics::histogram!("meniscus_slurm_squeue_seconds").record(spent.as_secs_f64());
    let mut held = cluster.table();
    match answer {
        Ok(answer) => {
            held.take(&answer, script::NAME_PREFIX, asked);
            cluster.clear_bundles(&held);
        }
        Err(error) => {
            if held.trouble.is_none() {
                tracing::warn!(%error, "the cluster gives no answer; what it said before stands");
            }
            held.trouble = Some(error.to_string());
        }
    }
    let (waiting, running) = held.counts();
    metrics::gauge!("meniscus_slurm_table_age_seconds").set(held.asked.elapsed().as_secs_f64());
    metrics::gauge!("meniscus_slurm_jobs", "state" => "waiting").set(waiting as f64);
    metrics::gauge!("meniscus_slurm_jobs", "state" => "running").set(running as f64);
    drop(held);
    let (_, unsure) = cluster.counts();
    metrics::gauge!("meniscus_slurm_unsure").set(unsure as f64);
    end_orphans(cluster);
    spent
}

/// Metrics of the nodes that have or had jobs of this service; `known` has those seen so far.
fn tell_of_nodes(cluster: &Cluster, known: &mut BTreeSet<String>) {
    let jobs = cluster.table().jobs_by_node();
    let excluded = cluster.excluded();
    known.extend(jobs.keys().cloned().chain(excluded.iter().cloned()));
    for node in known.iter() {
        let count = jobs.get(node).copied().unwrap_or(0);
        metrics::gauge!("meniscus_slurm_node_jobs", "node" => node.clone()).set(count as f64);
        let is_excluded = f64::from(u8::from(excluded.contains(node)));
        metrics::gauge!("meniscus_slurm_node_excluded", "node" => node.clone()).set(is_excluded);
    }
}

/// Ends jobs of earlier attempts whose successors are watched.
fn end_orphans(cluster: &Cluster) {
    let watched: HashSet<String> = cluster.tickets().keys().cloned().collect();
    let jobs: HashSet<&str> = watched.iter().filter_map(|name| job_of(name)).collect();
    let table = cluster.table();
    for row in table.all().filter(|row| row.state.is_alive() && !watched.contains(&row.name)) {
        if job_of(&row.name).is_some_and(|job| jobs.contains(job)) {
            tracing::info!(name = row.name, id = row.id, "an earlier attempt is still in the cluster and is ended");
            cluster.errands.send(Errand::End { name: row.name.clone(), id: Some(row.id.clone()) });
        }
    }
}

/// Lets jobs that wait for nodes which are not to be had run on those that they left out: a doubtful node is better than none.
///
/// The cluster writes several nodes of the site as one word: by `asked`, what a job left out when it was admitted, it is not admitted again.
fn admit_to_any_node(cluster: &Cluster, asked: &mut HashSet<(String, String)>) {
    let watched: HashSet<String> = cluster.tickets().values().map(|ticket| ticket.job().name).collect();
    asked.retain(|(name, _)| watched.contains(name));
    let by_site = cluster.settings.excluded().unwrap_or_default();
    for row in cluster.table().all().filter(|row| row.waits_for_nodes() && watched.contains(&row.name)) {
        let is_new = asked.insert((row.name.clone(), row.excluded.clone()));
        // Without nodes of the site an answer that did not come is told by those that are still left out.
        if row.excluded == by_site || (!is_new && !by_site.is_empty()) {
            continue;
        }
        if is_new {
            tracing::warn!(name = row.name, left_out = row.excluded, reason = row.reason, "a job may run on any node");
        }
        cluster.errands.send(Errand::Admit { name: row.name.clone(), excluded: by_site.to_owned() });
    }
}

/// The job in a name.
fn job_of(name: &str) -> Option<&str> {
    name.strip_prefix(script::NAME_PREFIX)?.rsplit_once('-').map(|(job, _)| job)
}

/// Waits for the next look: until `latest`, or only until `least` where one is wanted soon.
fn wait(cluster: &Cluster, least: Duration, latest: Duration) {
    let began = Instant::now();
    std::thread::sleep(least);
    let (wanted, condition) = &cluster.poll_soon;
    let mut wanted = wanted.lock().unwrap_or_else(PoisonError::into_inner);
    while !*wanted && began.elapsed() < latest {
        let left = latest.saturating_sub(began.elapsed());
        wanted = condition.wait_timeout(wanted, left).unwrap_or_else(PoisonError::into_inner).0;
    }
    *wanted = false;
}

#[cfg(test)]
mod tests {
    use super::job_of;

    #[test]
    fn a_name_has_its_job() {
        assert_eq!(job_of("mns-job_01ABC-12"), Some("job_01ABC"));
        assert_eq!(job_of("another"), None);
    }
}
