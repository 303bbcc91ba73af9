//! Workers as child processes of the service. A worker holds the reading end of a pipe whose other end only the service
//! has: when the service is gone, in whatever way, the worker reads the end of the pipe and ends too.

use super::cgroup::MemoryGroup;
use super::{
    Adoption, AttemptPlace, Capacity, EndCause, Executor, Needs, NotStarted, Notify, Phase, Reservation, Worker,
    WorkerUsage,
};
use crate::spec::attempt_files;
use crate::spec::requests::Request;
use crate::system::process;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::OpenOptions;
use std::io::{self, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Starts `PROGRAM worker --attempt DIR`. Handles are process numbers.
#[derive(Debug, Clone)]
pub struct LocalExecutor {
    program: PathBuf,
}

impl LocalExecutor {
    /// An executor whose workers run a program.
    #[must_use]
    pub fn new(program: PathBuf) -> Self {
        Self { program }
    }
}

impl Executor for LocalExecutor {
    fn start(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted> {
        let errors = OpenOptions::new().create(true).append(true).open(attempt.directory.join(attempt_files::LOG))?;
        let mut child = Command::new(&self.program)
            .arg0("meniscus")
            .arg("worker")
            .arg("--attempt")
            .arg(&attempt.directory)
            // No file that it reads may bring code along.
            .env("HDF5_PLUGIN_PRELOAD", "::")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(errors)
            .spawn()?;
        let last_heartbeat = Arc::new(Mutex::new(Instant::now()));
        if let Some(output) = child.stdout.take()
            && let Err(error) = follow_heartbeat(output, Arc::clone(&last_heartbeat), notify)
        {
            // Without a thread that listens to it, it would run unwatched.
            child.kill()?;
            child.wait()?;
            return Err(error.into());
        }
        let name = format!("{}-{}", std::process::id(), child.id());
        let group = MemoryGroup::enclose(Path::new("/sys/fs/cgroup"), &name, child.id(), needs.memory_bytes);
        let handle = child.id().to_string();
        Ok(Box::new(LocalWorker { handle, input: child.stdin.take(), child, last_heartbeat, group }))
    }

    /// A child of an earlier service has lost its pipes. Its records could not be believed any more, but it would use the
    /// machine: it is ended.
    fn adopt(&self, attempt: &AttemptPlace, handle: Option<&str>, _: &Needs, _: Notify) -> Adoption {
        if let Some(pid) = handle.and_then(|handle| handle.parse::<i32>().ok())
            && is_worker_of(pid, &attempt.directory)
            && let Some(pid) = Pid::from_raw(pid)
        {
            // It may have gone by itself in between.
            let _ = kill_process(pid, Signal::KILL);
        }
        Adoption::Gone
    }

    fn capacity(&self, reservations: &[Reservation]) -> Capacity {
        // Workers that have just started have not taken their memory yet.
        let promised: u64 = reservations.iter().map(|one| one.reserved_bytes.saturating_sub(one.used_bytes)).sum();
        let available = process::available_memory().unwrap_or(u64::MAX);
        Capacity { memory_bytes: available.saturating_sub(promised), workers: usize::MAX }
    }
}

/// Whether a process is the worker of an attempt: process numbers are used again.
fn is_worker_of(pid: i32, attempt_directory: &Path) -> bool {
    let command = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let wanted = attempt_directory.as_os_str().as_encoded_bytes();
    command.windows(wanted.len().max(1)).any(|window| window == wanted)
}

/// Follows what a worker writes to its standard output, on a thread of its own: each byte is a sign of life.
fn follow_heartbeat(mut output: ChildStdout, last: Arc<Mutex<Instant>>, notify: Notify) -> io::Result<()> {
    std::thread::Builder::new().name("worker-heartbeat".to_owned()).spawn(move || {
        let mut buffer = [0; 256];
        // The end of the output is news, too.
        while output.read(&mut buffer).is_ok_and(|count| count > 0) {
            *last.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
            notify();
        }
        notify();
    })?;
    Ok(())
}

struct LocalWorker {
    handle: String,
    child: Child,
    input: Option<ChildStdin>,
    last_heartbeat: Arc<Mutex<Instant>>,
    group: Option<MemoryGroup>,
}

impl LocalWorker {
    fn cause(&self, status: ExitStatus) -> EndCause {
        if self.group.as_ref().is_some_and(MemoryGroup::has_killed) {
            return EndCause::OutOfMemory;
        }
        match status.signal() {
            Some(signal) => EndCause::Signaled { signal },
            None => EndCause::Exited { code: status.code().unwrap_or_default() },
        }
    }
}

impl Worker for LocalWorker {
    fn handle(&self) -> &str {
        &self.handle
    }

    fn send(&mut self, request: Request) {
        if let Some(input) = &mut self.input {
            // A worker that is gone receives nothing; its end is noticed elsewhere.
            let _ = writeln!(input, "{}", request.word()).and_then(|()| input.flush());
        }
    }

    fn time_since_heartbeat(&self) -> Duration {
        self.last_heartbeat.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    fn phase(&self) -> Phase {
        Phase::Running
    }

    fn usage(&self) -> WorkerUsage {
        WorkerUsage { memory_bytes: process::resident_bytes(self.child.id()) }
    }

    fn poll(&mut self) -> io::Result<Option<EndCause>> {
        Ok(self.child.try_wait()?.map(|status| self.cause(status)))
    }

    fn kill(&mut self) {
        // It may be gone already.
        let _ = self.child.kill();
    }
}

impl Drop for LocalWorker {
    fn drop(&mut self) {
        self.input = None;
        self.kill();
        let _ = self.child.wait();
    }
}
