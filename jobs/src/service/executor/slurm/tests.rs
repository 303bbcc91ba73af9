//! The executor with commands that stand in for the cluster's: they hang, fail and lie.

use super::{Settings, SlurmExecutor};
use crate::service::executor::{Adoption, AttemptPlace, EndCause, Eviction, Executor, Needs, Phase, Worker};
use crate::spec::attempt_files;
use crate::spec::heartbeat::Heartbeat;
use crate::spec::requests::Request;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A cluster of shell scripts.
struct Fake {
    place: tempfile::TempDir,
}

const NEEDS: Needs = Needs { memory_bytes: 1 << 20, threads: 1, wall_s: None, forecast_s: None };

impl Fake {
    /// Commands with these bodies; `$here` is their directory.
    fn new(sbatch: &str, squeue: &str) -> Self {
        let place = tempfile::tempdir().unwrap();
        let fake = Self { place };
        fake.set("sbatch", sbatch);
        fake.set("squeue", squeue);
        fake.set("scancel", "echo \"$@\" >> $here/canceled");
        fake
    }

    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// Replaces a command in one go: it may be being run.
    fn set(&self, name: &str, body: &str) {
        let text = format!("#!/bin/sh\nhere={}\n{body}\n", self.place.path().display());
        let beside = self.path(&format!("{name}.new"));
        std::fs::write(&beside, text).unwrap();
        std::fs::set_permissions(&beside, std::fs::Permissions::from_mode(0o755)).unwrap();
        std::fs::rename(beside, self.path(name)).unwrap();
    }

    fn executor(&self) -> SlurmExecutor {
        let settings = Settings {
            commands: Some(self.place.path().to_owned()),
            poll: Duration::from_millis(100),
            submission_interval: Duration::ZERO,
            late_files: Duration::from_millis(500),
            heartbeat: Duration::from_millis(200),
            ..Settings::new("/bin/true".into(), "0".repeat(64))
        };
        SlurmExecutor::new(settings, self.place.path()).unwrap()
    }

    fn attempt(&self) -> AttemptPlace {
        self.attempt_of("job_1")
    }

    fn attempt_of(&self, job: &str) -> AttemptPlace {
        let directory = self.path(&format!("jobs/{job}/attempts/1"));
        std::fs::create_dir_all(&directory).unwrap();
        AttemptPlace { job: job.to_owned(), epoch: 1, directory }
    }

    fn lines(&self, name: &str) -> usize {
        std::fs::read_to_string(self.path(name)).unwrap_or_default().lines().count()
    }
}

fn until<R>(what: &str, mut look: impl FnMut() -> Option<R>) -> R {
    let deadline = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < deadline, "it never came true that {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn end_of(worker: &mut Box<dyn Worker>) -> EndCause {
    until("the worker has ended", || worker.poll().unwrap())
}

fn give_life(directory: &Path, count: u64, exit_code: Option<i32>) {
    Heartbeat { count, memory_bytes: Some(5), host: "node1".to_owned(), exit_code, cause: None }
        .write(directory)
        .unwrap();
}

const ROW: &str = "echo '7|mns-job_1-1|RUNNING|None|node1'";

#[test]
fn an_attempt_goes_through_the_cluster_to_its_end() {
    let fake = Fake::new("echo 7", "echo '7|mns-job_1-1|PENDING|Priority|'");
    let (executor, attempt) = (fake.executor(), fake.attempt());
    let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
    until("it waits for its priority", || {
        (worker.poll().unwrap().is_none() && worker.waits_for()? == "slurm (Priority)").then_some(())
    });
    assert_eq!((worker.phase(), worker.handle()), (Phase::Waiting, "mns-job_1-1"));
    fake.set("squeue", ROW);
    give_life(&attempt.directory, 1, None);
    until("it works", || (worker.poll().unwrap().is_none() && worker.phase() == Phase::Running).then_some(()));
    until("its memory is known", || worker.usage().memory_bytes);
    worker.send(Request::Pause);
    until("it has a hint", || (fake.lines("canceled") > 0).then_some(()));
    assert_eq!(std::fs::read_to_string(attempt.directory.join(attempt_files::CONTROL)).unwrap(), "pause\n");
    give_life(&attempt.directory, 2, Some(0));
    assert_eq!(end_of(&mut worker), EndCause::Exited { code: 0 });
}

#[test]
fn a_submission_whose_answer_was_lost_is_found_by_its_name_and_not_repeated() {
    let fake =
        Fake::new("echo x >> $here/submitted; echo 'Socket timed out on send/recv operation' >&2; exit 1", "true");
    let (executor, attempt) = (fake.executor(), fake.attempt());
    let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
    until("it is unsure", || worker.waits_for().filter(|said| said.contains("not known yet")));
    fake.set("squeue", ROW);
    until("it was found", || (worker.poll().unwrap().is_none() && worker.phase() == Phase::Running).then_some(()));
    assert_eq!(fake.lines("submitted"), 1);
}

#[test]
fn a_submission_that_never_arrived_is_repeated_after_five_answers() {
    let fake = Fake::new("echo x >> $here/submitted; echo 'Socket timed out' >&2; exit 1", "echo x >> $here/asked");
    let (executor, attempt) = (fake.executor(), fake.attempt());
    let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
    until("it was repeated", || (worker.poll().unwrap().is_none() && fake.lines("submitted") == 2).then_some(()));
    assert!(fake.lines("asked") >= 5);
}

#[test]
fn a_cluster_that_fails_or_lies_ends_nothing() {
    let fake = Fake::new("echo 7", ROW);
    let (executor, attempt) = (fake.executor(), fake.attempt());
    let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
    give_life(&attempt.directory, 1, None);
    until("it works", || (worker.poll().unwrap().is_none() && worker.phase() == Phase::Running).then_some(()));
    for answer in
        ["echo 'Unable to contact slurm controller' >&2; exit 1", "head -c 5000 /dev/urandom; exit 3", "kill -9 $$"]
    {
        fake.set("squeue", answer);
        std::thread::sleep(Duration::from_millis(400));
        assert_eq!(worker.poll().unwrap(), None, "{answer}");
    }
}

#[test]
fn a_hopeless_job_does_not_hold_up_others() {
    let fake = Fake::new(
        "echo x >> $here/submitted\n\
         case \"$*\" in *job_1*) echo 'sbatch: error: Batch job submission failed: Requested node configuration is not available' >&2; exit 1;; esac\n\
         echo 8",
        "true",
    );
    let executor = fake.executor();
    let hopeless = executor.start(&fake.attempt(), &NEEDS, Box::new(|| {})).unwrap();
    let other = executor.start(&fake.attempt_of("job_2"), &NEEDS, Box::new(|| {})).unwrap();
    until("the other is submitted", || {
        other.waits_for().filter(|said| said.contains("submitted")).filter(|said| !said.contains("not"))
    });
    let said = until("its words are shown", || hopeless.waits_for().filter(|said| said.contains("configuration")));
    assert!(said.starts_with("slurm ("), "{said}");
}

#[test]
fn a_cluster_that_refuses_all_jobs_is_asked_with_growing_pauses() {
    let refusal =
        "echo x >> $here/submitted; echo 'sbatch: error: Batch job submission failed: Invalid account' >&2; exit 1";
    let fake = Fake::new(refusal, "true");
    let executor = fake.executor();
    let start = |job: &str| executor.start(&fake.attempt_of(job), &NEEDS, Box::new(|| {})).unwrap();
    let workers = [start("job_1"), start("job_2"), start("job_3")];
    std::thread::sleep(Duration::from_secs(4));
    // Each once, then after one second and after two more.
    let asked = fake.lines("submitted");
    assert!((3..=6).contains(&asked), "{asked} calls in four seconds");
    assert!(workers.iter().all(|worker| worker.waits_for().is_some_and(|said| said.contains("Invalid account"))));
}

#[test]
fn what_is_taken_back_while_the_cluster_thinks_about_it_is_ended_there_and_not_submitted_again() {
    for (answer, is_taken) in [("echo 7", true), ("echo 'temporarily unable to accept job' >&2; exit 1", false)] {
        let fake = Fake::new(&format!("echo x >> $here/submitted; sleep 1; {answer}"), "true");
        let (executor, attempt) = (fake.executor(), fake.attempt());
        let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
        until("sbatch is at it", || (fake.lines("submitted") == 1).then_some(()));
        worker.send(Request::Cancel);
        assert_eq!(worker.poll().unwrap(), Some(EndCause::Evicted(Eviction::Revoked)));
        drop(worker);
        std::thread::sleep(Duration::from_millis(2500));
        let told = std::fs::read_to_string(fake.path("canceled")).unwrap_or_default();
        assert_eq!(told.contains("--name=mns-job_1-1 7"), is_taken, "{told}");
        assert_eq!(fake.lines("submitted"), 1);
    }
}

#[test]
fn lists_of_bundles_go_when_they_are_refused_and_when_they_are_done_but_not_at_a_stop() {
    let noted = "for a in \"$@\"; do case $a in --job-name=*) echo \"${a#--job-name=}\" > $here/name;; esac; done\n";
    let fake = Fake::new(&format!("{noted}echo x >> $here/submitted; echo 'submit limit' >&2; exit 1"), "true");
    let executor = fake.executor();
    let short = Needs { forecast_s: Some(1.0), ..NEEDS };
    let attempts = ["job_1", "job_2"].map(|job| fake.attempt_of(job));
    let start = |attempt: &AttemptPlace| executor.start(attempt, &short, Box::new(|| {})).unwrap();
    let mut workers: Vec<Box<dyn Worker>> = attempts.iter().map(start).collect();
    let lists = || std::fs::read_dir(fake.path("bundles")).map_or(0, Iterator::count);
    until("it was refused", || (fake.lines("submitted") == 1 && lists() == 0).then_some(()));
    fake.set("sbatch", &format!("{noted}echo 7"));
    fake.set("squeue", "[ ! -e $here/name ] || echo \"7|$(cat $here/name)|RUNNING|None|node1\"");
    until("they wait in a bundle", || {
        workers
            .iter_mut()
            .all(|worker| {
                worker.poll().unwrap().is_none() && worker.waits_for().is_some_and(|said| said.contains("bundle"))
            })
            .then_some(())
    });
    assert_eq!(lists(), 2);
    // The service stops and starts again: the cluster still needs them.
    workers.clear();
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(lists(), 2);
    let adopt = |attempt: &AttemptPlace| match executor.adopt(attempt, None, &short, Box::new(|| {})) {
        Adoption::Running(worker) => worker,
        Adoption::Gone => panic!("it has a script"),
    };
    let mut workers: Vec<Box<dyn Worker>> = attempts.iter().map(adopt).collect();
    for attempt in &attempts {
        give_life(&attempt.directory, 1, Some(0));
    }
    assert!(workers.iter_mut().all(|worker| end_of(worker) == EndCause::Exited { code: 0 }));
    workers.clear();
    fake.set("squeue", "true");
    until("they are gone", || (lists() == 0).then_some(()));
}

#[test]
fn what_no_process_has_begun_is_taken_back_without_an_answer_of_the_cluster() {
    let fake = Fake::new("sleep 0.2; echo 7", "sleep 1000");
    let (executor, attempt) = (fake.executor(), fake.attempt());
    let mut worker = executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap();
    until("it is submitted", || worker.waits_for().filter(|said| said.contains("(submitted)")));
    let began = Instant::now();
    worker.send(Request::Cancel);
    assert_eq!(worker.poll().unwrap(), Some(EndCause::Evicted(Eviction::Revoked)));
    assert!(began.elapsed() < Duration::from_secs(1));
    // The cluster's job comes second to the service.
    assert!(std::fs::create_dir(attempt.directory.join(attempt_files::CLAIM)).is_err());
    until("the cluster is told", || (fake.lines("canceled") > 0).then_some(()));
}

#[test]
fn a_service_that_starts_again_finds_what_was_submitted_and_only_that() {
    let fake = Fake::new("echo 7", ROW);
    let attempt = fake.attempt();
    let executor = fake.executor();
    let adopt = || executor.adopt(&attempt, None, &NEEDS, Box::new(|| {}));
    assert!(matches!(adopt(), Adoption::Gone));
    drop(executor.start(&attempt, &NEEDS, Box::new(|| {})).unwrap());
    let Adoption::Running(mut worker) = adopt() else { panic!("it has a script") };
    until("it was found", || (worker.poll().unwrap().is_none() && worker.phase() == Phase::Running).then_some(()));
}

#[test]
fn a_node_that_loses_two_attempts_in_a_minute_is_left_out() {
    let fake = Fake::new("echo 7", ROW);
    let executor = fake.executor();
    executor.cluster.note_loss("node3");
    assert!(executor.cluster.excluded().is_empty());
    executor.cluster.note_loss("node3");
    executor.cluster.note_loss("node4");
    assert_eq!(executor.cluster.excluded(), ["node3"]);
}

#[test]
fn a_job_that_left_nodes_out_may_use_them_where_no_other_is_to_be_had() {
    let fake = Fake::new("echo \"$@\" > $here/submitted; echo 7", "true");
    fake.set("scontrol", "echo \"$@\" >> $here/updated");
    let executor = fake.executor();
    executor.cluster.note_loss("node3");
    executor.cluster.note_loss("node3");
    let _worker = executor.start(&fake.attempt(), &NEEDS, Box::new(|| {})).unwrap();
    let submitted = until("it was submitted", || std::fs::read_to_string(fake.path("submitted")).ok());
    assert!(submitted.contains("--exclude=node3 "), "{submitted}");
    let row = |reason: &str| format!("echo '7|mns-job_1-1|PENDING|{reason}||node3'");
    // It waits for its turn only.
    fake.set("squeue", &row("Resources"));
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!(fake.lines("updated"), 0);
    fake.set("squeue", &row("ReqNodeNotAvail, UnavailableNodes:node1"));
    let updated = until("it may run on any node", || std::fs::read_to_string(fake.path("updated")).ok());
    assert!(updated.starts_with("update JobName=mns-job_1-1 ExcNodeList="), "{updated}");
}
