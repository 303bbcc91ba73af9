//! Bundles: attempts that are forecast to be short share one job of the cluster, which works through them one after another. Each
//! keeps its directory, its claim and its worker, so that a bundle that ends early gives back what it has not begun.

use super::ticket::{ClusterJob, Order, Submission};
use super::{Cluster, script};
use crate::service::executor::Needs;
use crate::spec::attempt_files;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use ulid::Ulid;

/// Forecast running time below which an attempt is short, in seconds.
const SHORT_S: f64 = 300.0;
/// Forecast running time that a bundle has at least where there are enough attempts, in seconds.
const LEAST_S: f64 = 300.0;
/// And at most.
const MOST_S: f64 = 3600.0;
/// Attempts of a bundle at most.
const MOST_ATTEMPTS: usize = 1000;
/// Time for which the line waits for further short attempts after the last one that came, and after the first.
const GATHERING: Duration = Duration::from_millis(300);
const LONGEST_GATHERING: Duration = Duration::from_secs(2);
/// Folder of the lists and scripts, in the shared directory.
const FOLDER: &str = "bundles";

/// File of an attempt that says in which bundle it is.
#[derive(Debug, Serialize, Deserialize)]
struct Membership {
    name: String,
    place: usize,
}

/// The forecast of an attempt that may be bundled.
pub(super) fn short_s(needs: &Needs) -> Option<f64> {
    needs.forecast_s.filter(|seconds| *seconds < SHORT_S)
}

/// Jobs of the cluster that attempts in line will take: `long` attempts, and short ones of `short_s` seconds in all.
pub(super) fn places_for(long: usize, short_s: f64) -> usize {
    long + (short_s / LEAST_S).floor() as usize
}

/// Whether short attempts may still be coming.
pub(super) fn is_gathering(orders: &VecDeque<Order>, (begun, grown): (Instant, Instant)) -> bool {
    let Some(first) = orders.front() else { return false };
    let all: f64 = orders.iter().filter_map(|order| order.ticket.short_s()).sum();
    let has_time = grown.elapsed() < GATHERING && begun.elapsed() < LONGEST_GATHERING;
    first.ticket.short_s().is_some() && all < LEAST_S && has_time
}

/// Takes the next order, and where it is short those like it, as many as make the bundles for the free places equal.
pub(super) fn take_next(orders: &mut VecDeque<Order>, places: usize) -> Vec<Order> {
    let Some(first) = orders.pop_front() else { return Vec::new() };
    let Some(mut seconds) = first.ticket.short_s() else { return vec![first] };
    let is_alike = |order: &Order| order.needs.threads == first.needs.threads;
    let all: f64 = orders.iter().filter(|order| is_alike(order)).filter_map(|order| order.ticket.short_s()).sum();
    let share = ((all + seconds) / places.max(1) as f64).clamp(LEAST_S, MOST_S);
    let (mut taken, mut left) = (vec![first.clone()], VecDeque::new());
    for order in orders.drain(..) {
        match order.ticket.short_s() {
            Some(more) if is_alike(&order) && seconds < share && taken.len() < MOST_ATTEMPTS => {
                seconds += more;
                taken.push(order);
            }
            _ => left.push_back(order),
        }
    }
    *orders = left;
    taken
}

/// Makes a submission of one order or of several. Orders that were taken back in between are left out.
pub(super) fn prepare(orders: Vec<Order>, cluster: &Cluster) -> Result<Submission, (Vec<Order>, io::Error)> {
    let settings = &cluster.settings;
    if let [order] = orders.as_slice() {
        let name = script::name_of(&order.attempt.job, order.attempt.epoch);
        let call = script::Call {
            name: &name,
            directory: &order.attempt.directory,
            script: attempt_files::SCRIPT,
            log: attempt_files::LOG,
            needs: order.needs,
        };
        let arguments = script::arguments(&call, settings);
        let is_wanted = order.ticket.begin(ClusterJob::own(name.clone()));
        return Ok(Submission { name, orders: if is_wanted { orders } else { Vec::new() }, arguments });
    }
    let name = format!("{}bundle_{}-1", script::NAME_PREFIX, Ulid::generate());
    // From here on one that is taken back is claimed by the service: the list may have it.
    let begin =
        |(place, order): &(usize, Order)| order.ticket.begin(ClusterJob { name: name.clone(), place: Some(*place) });
    let orders: Vec<Order> = orders.into_iter().enumerate().filter(begin).map(|(_, order)| order).collect();
    if let Err(error) = write(&name, &orders, cluster) {
        remove(&cluster.shared, &name);
        return Err((orders, error));
    }
    let lanes = settings.lanes as u64;
    let most = |of: fn(&Needs) -> u64| orders.iter().map(|order| of(&order.needs)).max().unwrap_or(1) * lanes;
    let needs = Needs {
        memory_bytes: most(|needs| needs.memory_bytes),
        threads: most(|needs| needs.threads),
        wall_s: None,
        forecast_s: None,
    };
    let (directory, script, log) = (folder(&cluster.shared), format!("{name}.sh"), format!("{name}.log"));
    let call = script::Call { name: &name, directory: &directory, script: &script, log: &log, needs };
    let arguments = script::arguments(&call, settings);
    Ok(Submission { name, orders, arguments })
}

fn folder(shared: &Path) -> PathBuf {
    shared.join(FOLDER)
}

/// Writes the list and the script of a bundle, and into each attempt where it is to be looked for. A membership that a crash
/// loses does no harm: the attempt is submitted again, and the claim decides.
fn write(name: &str, orders: &[Order], cluster: &Cluster) -> io::Result<()> {
    let folder = folder(&cluster.shared);
    fs::create_dir_all(&folder)?;
    let list = folder.join(format!("{name}.txt"));
    let lines: String = orders.iter().map(|order| format!("{}\n", order.attempt.directory.display())).collect();
    fs::write(&list, lines)?;
    fs::write(folder.join(format!("{name}.sh")), script::bundle_script(&list, &cluster.settings))?;
    for order in orders {
        let place = order.ticket.job().place.unwrap_or_default();
        let text = serde_json::to_vec(&Membership { name: name.to_owned(), place })?;
        fs::write(order.attempt.directory.join(attempt_files::BUNDLE), text)?;
    }
    Ok(())
}

/// Where in the cluster an attempt of an earlier service is looked for.
pub(super) fn job_of(directory: &Path, own_name: String) -> ClusterJob {
    let text = fs::read(directory.join(attempt_files::BUNDLE)).ok();
    let member: Option<Membership> = text.and_then(|text| serde_json::from_slice(&text).ok());
    member
        .map_or_else(|| ClusterJob::own(own_name), |member| ClusterJob { name: member.name, place: Some(member.place) })
}

/// Removes what belongs to a bundle that is over or was never submitted; of another name nothing is there.
pub(super) fn remove(shared: &Path, name: &str) {
    for ending in ["txt", "sh", "log"] {
        // What cannot be removed is small and does no harm.
        let _ = fs::remove_file(folder(shared).join(format!("{name}.{ending}")));
    }
}

#[cfg(test)]
mod tests {
    use super::{is_gathering, places_for, short_s, take_next};
    use crate::service::executor::slurm::ticket::{ClusterJob, Order, Stage, Ticket};
    use crate::service::executor::{AttemptPlace, Needs};
    use std::collections::VecDeque;
    use std::time::{Duration, Instant};

    fn order(number: u64, forecast_s: Option<f64>, threads: u64) -> Order {
        let needs = Needs { memory_bytes: 1, threads, wall_s: None, forecast_s };
        let job = ClusterJob::own(format!("mns-job_{number}-1"));
        let ticket = Ticket::new(Stage::InLine { said: None }, job, short_s(&needs));
        let attempt = AttemptPlace { job: format!("job_{number}"), epoch: 1, directory: "/x".into() };
        Order { attempt, needs, ticket }
    }

    #[test]
    fn short_attempts_go_together_and_long_ones_alone() {
        let mut line: VecDeque<Order> = (0..100).map(|number| order(number, Some(10.0), 1)).collect();
        line.push_front(order(100, Some(4000.0), 1));
        line.push_back(order(101, None, 1));
        line.push_back(order(102, Some(10.0), 4));
        assert_eq!(take_next(&mut line, 2).len(), 1);
        // A thousand seconds for two places.
        assert_eq!(take_next(&mut line, 2).len(), 50);
        // Never below five minutes where there is enough.
        assert_eq!(take_next(&mut line, 200).len(), 30);
        assert_eq!(take_next(&mut line, 1).len(), 20);
        assert_eq!((take_next(&mut line, 1).len(), take_next(&mut line, 1).len()), (1, 1));
        assert!(line.is_empty() && take_next(&mut line, 1).is_empty());
    }

    #[test]
    fn a_bundle_is_an_hour_at_most() {
        let mut line: VecDeque<Order> = (0..100).map(|number| order(number, Some(200.0), 1)).collect();
        assert_eq!(take_next(&mut line, 1).len(), 18);
    }

    #[test]
    fn the_line_waits_a_moment_for_more_of_the_same() {
        let now = Instant::now();
        let long_ago = now.checked_sub(Duration::from_secs(1)).unwrap();
        let line = |forecast| VecDeque::from([order(1, forecast, 1)]);
        assert!(is_gathering(&line(Some(1.0)), (now, now)));
        assert!(!is_gathering(&line(Some(1.0)), (long_ago, long_ago)));
        let (begun, before) = (now.checked_sub(Duration::from_secs(3)).unwrap(), now);
        // Others come all the time.
        assert!(!is_gathering(&line(Some(1.0)), (begun, before)));
        assert!(!is_gathering(&line(None), (now, now)));
        assert_eq!(places_for(3, 640.0), 5);
    }
}
