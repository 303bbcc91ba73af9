//! A Slurm cluster of two nodes on this machine: loopback only, with a directory and ports of its own. Its daemons are children of
//! the test, which can stop and kill them; they end with it.

use crate::service::{eventually, signal};
use rustix::process::Signal;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The daemons, in the order in which they start.
const MUNGED: usize = 0;
const CONTROLLER: usize = 1;
const NODES: usize = 2;

pub struct Cluster {
    pub place: tempfile::TempDir,
    daemons: [Option<Child>; 4],
    source: Option<PathBuf>,
}

impl Cluster {
    pub fn start() -> Self {
        Self::start_with("", None)
    }

    /// With further lines of its configuration. Nodes see `source` under the name of the shared directory.
    pub fn start_with(lines: &str, source: Option<PathBuf>) -> Self {
        let place = tempfile::Builder::new().prefix("meniscus-cluster-").tempdir().unwrap();
        let mut cluster = Self { place, daemons: [None, None, None, None], source };
        for folder in ["run", "log", "state", "spool/node1", "spool/node2", "shared"] {
            std::fs::create_dir_all(cluster.path(folder)).unwrap();
        }
        // Munge wants directories that its user alone can write.
        set_mode(&cluster.path(""), 0o755);
        std::fs::write(cluster.path("munge.key"), [7_u8; 1024]).unwrap();
        set_mode(&cluster.path("munge.key"), 0o400);
        std::fs::write(cluster.path("slurm.conf"), cluster.configuration(lines)).unwrap();
        cluster.start_munged();
        cluster.start_controller();
        cluster.start_node(1);
        cluster.start_node(2);
        eventually("both nodes are ready", Duration::from_secs(30), || cluster.is_ready().then_some(()));
        cluster
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    pub fn shared(&self) -> PathBuf {
        self.path("shared")
    }

    fn configuration(&self, lines: &str) -> String {
        let (dir, host) = (self.place.path().display(), Self::ask_plain("hostname", &["-s"]));
        let [controller, first, second] = free_ports();
        let user = Self::ask_plain("id", &["-un"]);
        format!(
            "ClusterName=trial\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controller}\nSlurmUser={user}\nSlurmdUser={user}\n\
             AuthType=auth/munge\nAuthInfo=socket={dir}/run/munge.socket,cred_expire=10\nCredType=cred/munge\n\
             CommunicationParameters=NoAddrCache,NoInAddrAny,NoCtldInAddrAny\n\
             StateSaveLocation={dir}/state\nSlurmdSpoolDir={dir}/spool/%n\n\
             SlurmctldPidFile={dir}/run/slurmctld.pid\nSlurmdPidFile={dir}/run/slurmd.%n.pid\n\
             SlurmctldLogFile={dir}/log/slurmctld.log\nSlurmdLogFile={dir}/log/slurmd.%n.log\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nJobAcctGatherType=jobacct_gather/none\n\
             AccountingStorageType=accounting_storage/none\nMpiDefault=none\nSwitchType=switch/none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU_Memory\nSlurmdParameters=config_overrides\n\
             SchedulerType=sched/backfill\n\
             SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,bf_interval=1,sched_interval=2,default_queue_depth=500\n\
             PriorityType=priority/basic\nPreemptType=preempt/partition_prio\nPreemptMode=REQUEUE\nJobRequeue=1\n\
             SlurmdTimeout=10\nSlurmctldTimeout=10\nInactiveLimit=0\nMinJobAge=30\nKillWait=2\nCompleteWait=0\nMessageTimeout=5\n\
             BatchStartTimeout=10\nReturnToService=2\nMaxArraySize=1001\n\
             NodeName=DEFAULT CPUs=4 RealMemory=8000 State=UNKNOWN\n\
             NodeName=node1 NodeHostname={host} NodeAddr=127.0.0.1 Port={first}\n\
             NodeName=node2 NodeHostname={host} NodeAddr=127.0.0.1 Port={second}\n\
             PartitionName=main Nodes=node1,node2 Default=YES MaxTime=INFINITE State=UP PriorityTier=1 DefMemPerCPU=100\n\
             PartitionName=urgent Nodes=node1,node2 MaxTime=INFINITE State=UP PriorityTier=9 DefMemPerCPU=100\n{lines}\n",
        )
    }

    /// A program that dies with the thread that started it.
    fn spawn(&self, program: &str, arguments: &[&str], log: &str) -> Child {
        let log = std::fs::OpenOptions::new().create(true).append(true).open(self.path("log").join(log)).unwrap();
        Command::new("setpriv")
            .args(["--pdeathsig", "KILL", "--", program])
            .args(arguments)
            .env("PATH", search_path())
            .env("SLURM_CONF", self.path("slurm.conf"))
            .env("SHARED", self.shared())
            .env("SOURCE", self.source.clone().unwrap_or_default())
            .current_dir(self.place.path())
            .stdin(Stdio::null())
            .stdout(log.try_clone().unwrap())
            .stderr(log)
            .spawn()
            .unwrap_or_else(|error| panic!("{program}: {error}; `make test-cluster` installs what is missing"))
    }

    pub fn start_munged(&mut self) {
        let [key, socket, pid, log, seed] =
            ["munge.key", "run/munge.socket", "run/munged.pid", "log/munged.log", "run/seed"]
                .map(|name| self.path(name).display().to_string());
        // The socket of a daemon that was killed is in the way.
        let _ = std::fs::remove_file(&socket);
        let arguments = [
            "--foreground".to_owned(),
            "--force".to_owned(),
            format!("--key-file={key}"),
            format!("--socket={socket}"),
            format!("--pid-file={pid}"),
            format!("--log-file={log}"),
            format!("--seed-file={seed}"),
            "--num-threads=2".to_owned(),
        ];
        let child = self.spawn("munged", &arguments.iter().map(String::as_str).collect::<Vec<_>>(), "munged.err");
        self.daemons[MUNGED] = Some(child);
        eventually("munge answers", Duration::from_secs(10), || Path::new(&socket).exists().then_some(()));
    }

    pub fn start_controller(&mut self) {
        self.daemons[CONTROLLER] = Some(self.spawn("slurmctld", &["-D", "-i"], "slurmctld.err"));
    }

    pub fn start_node(&mut self, number: usize) {
        let name = format!("node{number}");
        let child = match &self.source {
            None => self.spawn("slurmd", &["-D", "-N", &name], "slurmd.err"),
            // This node has a view of its own.
            Some(_) => {
                let view =
                    "mount --make-rprivate / && mount --bind \"$SOURCE\" \"$SHARED\" && exec slurmd -D -N \"$1\"";
                self.spawn("unshare", &["-m", "sh", "-c", view, "sh", &name], "slurmd.err")
            }
        };
        self.daemons[NODES + number - 1] = Some(child);
    }

    fn end_daemon(&mut self, which: usize) {
        if let Some(mut child) = self.daemons[which].take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// `kill -9` of the controller.
    pub fn kill_controller(&mut self) {
        self.end_daemon(CONTROLLER);
    }

    /// `kill -9` of a node's daemon; its jobs go on.
    pub fn kill_node(&mut self, number: usize) {
        self.end_daemon(NODES + number - 1);
    }

    /// An orderly end of the daemon by which all others know each other.
    pub fn stop_munged(&mut self) {
        if let Some(child) = &self.daemons[MUNGED] {
            signal(child.id(), Signal::TERM);
        }
        if let Some(mut child) = self.daemons[MUNGED].take() {
            child.wait().unwrap();
        }
    }

    /// Stops the controller, or lets it go on.
    pub fn freeze_controller(&self, is_frozen: bool) {
        if let Some(child) = &self.daemons[CONTROLLER] {
            signal(child.id(), if is_frozen { Signal::STOP } else { Signal::CONT });
        }
    }

    /// What a command of the cluster says; None where it gives no answer.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> Option<String> {
        let output = Command::new("timeout")
            .args(["10", program])
            .args(arguments)
            .env("PATH", search_path())
            .env("SLURM_CONF", self.path("slurm.conf"))
            .output()
            .unwrap();
        output.status.success().then(|| String::from_utf8(output.stdout).unwrap().trim().to_owned())
    }

    fn ask_plain(program: &str, arguments: &[&str]) -> String {
        String::from_utf8(Command::new(program).args(arguments).output().unwrap().stdout).unwrap().trim().to_owned()
    }

    fn is_ready(&self) -> bool {
        let idle = self.ask("sinfo", &["-h", "-N", "-p", "main", "-t", "idle,mix,alloc", "-o", "%N"]);
        let both = idle.is_some_and(|idle| idle.lines().collect::<std::collections::HashSet<_>>().len() == 2);
        // After a start both must take a job, not only be remembered as idle.
        both && self.ask("srun", &["-Q", "-N2", "--immediate=5", "true"]).is_some()
    }

    /// What an administrator does about nodes that Slurm has drained by itself, as after a crash of the controller that lost numbers of jobs
    /// ("Duplicate jobid").
    pub fn resume_drained_nodes(&self) {
        let drained = self.ask("sinfo", &["-h", "-N", "-p", "main", "-t", "drain", "-o", "%N"]).unwrap_or_default();
        for node in drained.lines() {
            self.ask("scontrol", &["update", &format!("nodename={node}"), "state=resume"]);
        }
    }

    /// Rows of `squeue` as this format gives them.
    pub fn queue(&self, format: &str) -> Vec<String> {
        let said = eventually("squeue answers", Duration::from_secs(20), || self.ask("squeue", &["-h", "-o", format]));
        said.lines().map(str::to_owned).collect()
    }

    /// Waits until a job is on a node; the node.
    pub fn node_of(&self, job: &str) -> usize {
        eventually("the job is on a node", Duration::from_secs(20), || {
            let rows = self.queue("%j %T %N");
            let row = rows.iter().find(|row| row.contains(job) && row.contains("RUNNING"))?.clone();
            row.rsplit("node").next()?.parse().ok()
        })
    }

    /// Processes of jobs, whatever their parent is now.
    pub fn job_processes(&self) -> Vec<u32> {
        let conf = format!("SLURM_CONF={}", self.path("slurm.conf").display());
        let mut found = Vec::new();
        for entry in std::fs::read_dir("/proc").unwrap().flatten() {
            let Some(pid) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
            let environment = std::fs::read(entry.path().join("environ")).unwrap_or_default();
            let mut words = environment.split(|byte| *byte == 0);
            let is_ours = words.clone().any(|word| word == conf.as_bytes());
            let command = std::fs::read_to_string(entry.path().join("comm")).unwrap_or_default();
            if is_ours && (words.any(|word| word.starts_with(b"SLURM_JOB_ID=")) || command.trim() == "slurmstepd") {
                found.push(pid);
            }
        }
        found
    }
}

#[expect(clippy::print_stderr, reason = "a failed test shows what the daemons said")]
impl Drop for Cluster {
    fn drop(&mut self) {
        for which in (0..self.daemons.len()).rev() {
            self.end_daemon(which);
        }
        // What jobs left behind.
        for pid in self.job_processes() {
            signal(pid, Signal::KILL);
        }
        if std::thread::panicking() {
            for name in ["slurmctld.log", "slurmd.node1.log", "slurmctld.err", "slurmd.err"] {
                let text = std::fs::read_to_string(self.path("log").join(name)).unwrap_or_default();
                let last: Vec<&str> = text.lines().rev().take(15).collect();
                eprintln!("== {name}\n{}", last.into_iter().rev().collect::<Vec<_>>().join("\n"));
            }
        }
    }
}

fn search_path() -> String {
    format!("{}:/usr/sbin:/sbin", std::env::var("PATH").unwrap_or_default())
}

fn set_mode(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
}

fn free_ports() -> [u16; 3] {
    let listeners = [0; 3].map(|_: i32| TcpListener::bind("127.0.0.1:0").unwrap());
    listeners.map(|listener| listener.local_addr().unwrap().port())
}
