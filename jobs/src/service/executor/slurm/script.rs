//! The script that the cluster runs for an attempt, and the arguments of `sbatch`.

use super::Settings;
use crate::service::executor::Needs;
use crate::spec::attempt_files;
use crate::spec::requests::NOT_STARTED_CODE;
use std::path::Path;
use std::time::Duration;

/// Start of the names of all jobs that this program submits.
pub const NAME_PREFIX: &str = "mns-";

/// The name of an attempt in the cluster, which is its key.
#[must_use]
pub fn name_of(job: &str, epoch: u64) -> String {
    format!("{NAME_PREFIX}{job}-{epoch}")
}

/// Whether a path can stand in a script as it is.
#[must_use]
pub fn is_plain(path: &Path) -> bool {
    path.to_str().is_some_and(|text| {
        text.starts_with('/') && text.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_./".contains(&b))
    })
}

/// The script of one attempt. It claims the attempt before anything else: of two jobs with its name, one works and the other
/// leaves. A job that the cluster puts back into its queue has the same number, so the count of its restarts belongs to the claim.
/// Then it becomes the worker, so that signals reach it. The signal that hints at a request is ignored until the worker listens:
/// a worker reads its requests at its start in any case.
#[must_use]
pub fn script(directory: &Path, settings: &Settings) -> String {
    let directory = directory.display();
    let Settings { program, program_sha256, heartbeat, lease, .. } = settings;
    let (claim, owner) = (attempt_files::CLAIM, attempt_files::CLAIM_OWNER);
    format!(
        "#!/bin/sh\n\
         trap '' USR1\n\
         PATH=/usr/local/bin:/usr/bin:/bin\n\
         dir={directory}\n\
         me=$SLURM_JOB_ID.${{SLURM_RESTART_COUNT:-0}}\n\
         if ! mkdir \"$dir/{claim}\" 2> /dev/null && [ \"$(cat \"$dir/{claim}/{owner}\" 2> /dev/null)\" != \"$me\" ]; then\n\
         \x20   : > \"$dir/{claim}/second-$me\"\n\
         \x20   exit {NOT_STARTED_CODE}\n\
         fi\n\
         echo \"$me\" > \"$dir/{claim}/{owner}\"\n\
         # No file that the worker reads may bring code along.\n\
         export HDF5_PLUGIN_PRELOAD=::\n\
         exec {program} worker --attempt \"$dir\" --detached --heartbeat-s {heartbeat} --lease-s {lease} --program-sha256 {program_sha256}\n",
        program = program.display(),
        heartbeat = heartbeat.as_secs_f64(),
        lease = lease.as_secs(),
    )
}

/// The script of a bundle: this program works through the list.
#[must_use]
pub fn bundle_script(list: &Path, settings: &Settings) -> String {
    let Settings { program, program_sha256, heartbeat, lease, lanes, .. } = settings;
    format!(
        "#!/bin/sh\n\
         trap '' USR1\n\
         PATH=/usr/local/bin:/usr/bin:/bin\n\
         export HDF5_PLUGIN_PRELOAD=::\n\
         exec {program} bundle --list {list} --owner \"$SLURM_JOB_ID.${{SLURM_RESTART_COUNT:-0}}\" --lanes {lanes} \
         --heartbeat-s {heartbeat} --lease-s {lease} --program-sha256 {program_sha256}\n",
        program = program.display(),
        list = list.display(),
        heartbeat = heartbeat.as_secs_f64(),
        lease = lease.as_secs(),
    )
}

/// A job of the cluster, for `sbatch`.
pub struct Call<'a> {
    /// Its name.
    pub name: &'a str,
    /// Where it runs, and where its script is.
    pub directory: &'a Path,
    /// Name of the script there.
    pub script: &'a str,
    /// Name of the file there that gets its output.
    pub log: &'a str,
    /// What it needs.
    pub needs: Needs,
}

/// The arguments of `sbatch` for a job.
#[must_use]
pub fn arguments(call: &Call, settings: &Settings) -> Vec<String> {
    let Call { name, directory, script, log, needs } = call;
    let directory = directory.display();
    let mut arguments = vec![
        "--parsable".to_owned(),
        format!("--job-name={name}"),
        format!("--comment={}:{directory}", settings.service_id),
        format!("--chdir={directory}"),
        format!("--output={directory}/{log}"),
        "--open-mode=append".to_owned(),
        // The cluster never starts an attempt again: what it writes belongs to one process.
        "--no-requeue".to_owned(),
        // Nothing of the service's environment goes along.
        "--export=NIL".to_owned(),
        format!("--signal=B:TERM@{}", settings.grace.as_secs()),
        "--nodes=1".to_owned(),
        "--ntasks=1".to_owned(),
        format!("--cpus-per-task={}", needs.threads.max(1)),
        format!("--mem={}M", (needs.memory_bytes as f64 * MEMORY_MARGIN / f64::from(1 << 20)).ceil()),
    ];
    arguments.extend(time_limit(needs, settings).map(|minutes| format!("--time={minutes}")));
    arguments.extend(settings.options.iter().cloned());
    arguments.push(format!("{directory}/{script}"));
    arguments
}

/// Memory that the cluster grants by that which a job may use: our own limit comes first.
const MEMORY_MARGIN: f64 = 1.05;

/// Time by which `--signal` may come early.
const SIGNAL_MARGIN: Duration = Duration::from_secs(60);

/// The limit of time in minutes: that of the job or that of the site, whichever comes first, and the time to write a checkpoint.
fn time_limit(needs: &Needs, settings: &Settings) -> Option<u64> {
    let site = settings.time_limit.map(|limit| limit.as_secs_f64());
    // The service's own limit comes first: it begins to count later than the cluster, whose signals may come a minute early.
    let margin = settings.grace * 2 + settings.poll + SIGNAL_MARGIN;
    let own = needs.wall_s.map(|wall| wall + margin.as_secs_f64());
    let seconds = match (own, site) {
        (Some(own), Some(site)) => own.min(site),
        (own, site) => own.or(site)?,
    };
    Some(((seconds / 60.0).ceil() as u64).max(1))
}

/// Options that are not the site's to give.
const OURS: [&str; 17] = [
    "--array",
    "-a",
    "--requeue",
    "--no-requeue",
    "--export",
    "--export-file",
    "--job-name",
    "-J",
    "--comment",
    "--chdir",
    "-D",
    "--output",
    "-o",
    "--open-mode",
    "--signal",
    "--parsable",
    "--wrap",
];

/// What is wrong with an option of the configuration.
#[must_use]
pub fn wrong_option(option: &str) -> Option<String> {
    if !option.starts_with('-') {
        return Some(format!("{option} is not an option of sbatch: options begin with -"));
    }
    if option.starts_with("-x") || option == "--exclude" {
        return Some("nodes that are left out are written as --exclude=NODES".to_owned());
    }
    let name = option.split('=').next().unwrap_or(option);
    OURS.contains(&name).then(|| format!("{name} belongs to the service and cannot be an option of the site"))
}

#[cfg(test)]
mod tests {
    use super::{Call, arguments, bundle_script, is_plain, script, wrong_option};
    use crate::service::executor::Needs;
    use crate::service::executor::slurm::Settings;
    use std::path::Path;
    use std::process::Command;
    use std::time::Duration;

    fn settings() -> Settings {
        Settings {
            options: vec!["--partition=main".to_owned()],
            time_limit: Some(Duration::from_secs(3600)),
            ..Settings::new("/bin/echo".into(), "0".repeat(64))
        }
    }

    #[test]
    fn the_limits_of_a_job_are_the_clusters() {
        let directory = Path::new("/shared/jobs/job_1/attempts/2");
        let call = |needs| Call { name: "mns-job_1-2", directory, script: "slurm.sh", log: "log.txt", needs };
        let needs = Needs { memory_bytes: 100 << 20, threads: 4, wall_s: Some(600.0), forecast_s: None };
        let given = arguments(&call(needs), &settings());
        for wanted in [
            "--job-name=mns-job_1-2",
            "--mem=105M",
            "--cpus-per-task=4",
            "--time=14",
            "--export=NIL",
            "--no-requeue",
            "--partition=main",
        ] {
            assert!(given.iter().any(|argument| argument == wanted), "{wanted} {given:?}");
        }
        assert_eq!(given.last().unwrap(), "/shared/jobs/job_1/attempts/2/slurm.sh");
        let long = arguments(&call(Needs { wall_s: Some(1e6), ..needs }), &settings());
        assert!(long.iter().any(|argument| argument == "--time=60"), "{long:?}");
    }

    #[test]
    fn one_process_works_and_every_other_leaves() {
        let directory = tempfile::tempdir().unwrap();
        let text = script(directory.path(), &settings());
        std::fs::write(directory.path().join("slurm.sh"), text).unwrap();
        let run = |id: &str, restarts: Option<&str>| {
            let mut command = Command::new("sh");
            command.arg(directory.path().join("slurm.sh")).env("SLURM_JOB_ID", id);
            if let Some(restarts) = restarts {
                command.env("SLURM_RESTART_COUNT", restarts);
            }
            command.output().unwrap().status.code()
        };
        assert_eq!(run("17", None), Some(0));
        // Another job, and the same one after the cluster put it back into its queue.
        assert_eq!(run("18", None), Some(75));
        assert_eq!(run("17", Some("1")), Some(75));
        // A file system that reports the first answer twice.
        assert_eq!(run("17", None), Some(0));
        assert!(directory.path().join("claim/second-17.1").is_file());
    }

    #[test]
    fn a_hint_before_the_worker_listens_does_not_end_it() {
        use std::os::unix::fs::PermissionsExt;
        let directory = tempfile::tempdir().unwrap();
        let program = directory.path().join("program");
        std::fs::write(&program, "#!/bin/sh\nkill -USR1 $$\nexit 3\n").unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let settings = Settings::new(program, "0".repeat(64));
        for text in [script(directory.path(), &settings), bundle_script(Path::new("/list"), &settings)] {
            let ended = Command::new("sh").args(["-c", &text]).status().unwrap();
            assert_eq!(ended.code(), Some(3), "{ended:?}");
        }
    }

    #[test]
    fn paths_and_options_that_would_do_harm_are_refused() {
        assert!(is_plain(Path::new("/work/shared-1/jobs_2.x")));
        for wrong in ["relative", "/a b", "/a;b", "/a$b", "/a'b", "/a\nb"] {
            assert!(!is_plain(Path::new(wrong)), "{wrong}");
        }
        assert_eq!(wrong_option("--partition=main"), None);
        assert!(wrong_option("--array=0-9").unwrap().contains("--array"));
        assert!(wrong_option("rm").is_some());
        assert_eq!(wrong_option("--exclude=node3"), None);
        assert!(wrong_option("-xnode3").unwrap().contains("--exclude="));
    }
}
