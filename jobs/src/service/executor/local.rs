//! Workers as child processes of the service. A worker holds the reading end of a pipe whose other end is ours alone:
//! when we are gone, in whatever way, it reads the end and goes too.

use super::cgroup::MemoryGroup;
use super::{Executor, Exit, Worker};
use std::fs::OpenOptions;
use std::io::{self, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Starts `PROGRAM worker --attempt DIR`.
#[derive(Debug, Clone)]
pub struct LocalExecutor {
    program: PathBuf,
}

impl LocalExecutor {
    /// Workers run this program.
    #[must_use]
    pub fn new(program: PathBuf) -> Self {
        Self { program }
    }
}

impl Executor for LocalExecutor {
    fn start(
        &self,
        attempt_directory: &Path,
        memory_bytes: u64,
        news: Box<dyn Fn() + Send>,
    ) -> io::Result<Box<dyn Worker>> {
        let errors = OpenOptions::new()
            .create(true)
            .append(true)
            .open(attempt_directory.join(crate::worker::attempt::LOG_NAME))?;
        let mut child = Command::new(&self.program)
            .arg0("meniscus")
            .arg("worker")
            .arg("--attempt")
            .arg(attempt_directory)
            // No file that it reads may bring code along.
            .env("HDF5_PLUGIN_PRELOAD", "::")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(errors)
            .spawn()?;
        let heard = Arc::new(Mutex::new(Instant::now()));
        if let Some(mut output) = child.stdout.take() {
            let heard = Arc::clone(&heard);
            std::thread::Builder::new().name("worker-ear".to_owned()).spawn(move || {
                let mut buffer = [0; 256];
                // Whatever comes is a hint that there is news; the end of it too.
                while output.read(&mut buffer).is_ok_and(|count| count > 0) {
                    *heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
                    news();
                }
                news();
            })?;
        }
        let name = format!("{}-{}", std::process::id(), child.id());
        let group = MemoryGroup::enclose(Path::new("/sys/fs/cgroup"), &name, child.id(), memory_bytes);
        Ok(Box::new(LocalWorker { input: child.stdin.take(), child, heard, group }))
    }
}

struct LocalWorker {
    child: Child,
    input: Option<ChildStdin>,
    heard: Arc<Mutex<Instant>>,
    group: Option<MemoryGroup>,
}

impl Worker for LocalWorker {
    fn pid(&self) -> u32 {
        self.child.id()
    }

    fn say(&mut self, word: &str) {
        if let Some(input) = &mut self.input {
            // A worker that is gone does not hear; its end is noticed elsewhere.
            let _ = writeln!(input, "{word}").and_then(|()| input.flush());
        }
    }

    fn silence(&self) -> Duration {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    fn poll(&mut self) -> io::Result<Option<Exit>> {
        let Some(status) = self.child.try_wait()? else {
            return Ok(None);
        };
        let out_of_memory = self.group.as_ref().is_some_and(MemoryGroup::has_killed);
        Ok(Some(Exit { code: status.code(), signal: status.signal(), out_of_memory }))
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
