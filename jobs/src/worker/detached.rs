//! The process of a worker that a cluster started. It has no pipe to the service: requests come by a file and by signals, signs
//! of life go into a file. The service may be gone for as long as it likes.

use crate::spec::attempt_files;
use crate::spec::attempt_spec::AttemptSpec;
use crate::spec::heartbeat::Heartbeat;
use crate::spec::records::{RecordFile, Verdict};
use crate::spec::requests::{NOT_STARTED_CODE, Request};
use crate::system::{digest, process};
use crate::worker::attempt::run_attempt;
use crate::worker::observers::Control;
use signal_hook::consts::{SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How a detached worker lives.
#[derive(Debug, Clone)]
pub struct Terms {
    /// Time between two signs of life.
    pub heartbeat: Duration,
    /// Time after which a worker that cannot give one ends itself: its service has given it up.
    pub lease: Duration,
    /// Digest that the program must have; every node has its own copy of the path.
    pub program_sha256: Option<String>,
}

/// Time between two looks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);
/// Time between two looks into the file of requests.
const CONTROL_INTERVAL: Duration = Duration::from_secs(1);

/// Runs the attempt whose specification stands in a directory. The verdict is also its last record, and the last sign of life
/// has the exit code.
///
/// # Errors
/// When the specification cannot be read, the records cannot be opened or signals cannot be received.
pub fn run(directory: &Path, terms: &Terms) -> io::Result<Verdict> {
    // Before anything that takes time: without a listener a signal ends the process.
    let signals = Signals::new([SIGTERM, SIGUSR1])?;
    let life = Life::new(directory);
    let foreign = foreign_build(terms).unwrap_or_else(|error| Some(format!("the program cannot be read: {error}")));
    if let Some(cause) = foreign {
        life.end(NOT_STARTED_CODE.into(), Some(cause.clone()))?;
        return Ok(Verdict::Unstarted { cause });
    }
    let control = Control::default();
    let watch = Watch::begin(directory, signals, control.clone(), life.clone(), terms)?;
    let ran = attempt(directory, &control);
    drop(watch);
    let (code, cause) = match &ran {
        Ok(Verdict::Unstarted { cause }) => (NOT_STARTED_CODE.into(), Some(cause.clone())),
        Ok(_) => (0, None),
        Err(error) if process::is_shortage(error) => (NOT_STARTED_CODE.into(), Some(error.to_string())),
        Err(_) => (1, None),
    };
    life.end(code, cause)?;
    ran
}

fn attempt(directory: &Path, control: &Control) -> io::Result<Verdict> {
    let spec: AttemptSpec = serde_json::from_slice(&std::fs::read(directory.join(attempt_files::ATTEMPT_SPEC))?)?;
    let mut records = RecordFile::open(directory, spec.epoch)?;
    Ok(run_attempt(&spec, directory, control, &mut records))
}

/// What is wrong with this program, where it is not the one that was ordered.
pub(super) fn foreign_build(terms: &Terms) -> io::Result<Option<String>> {
    let Some(wanted) = &terms.program_sha256 else { return Ok(None) };
    let (found, _) = digest::of_file(Path::new("/proc/self/exe"))?;
    Ok((found != *wanted).then(|| {
        format!(
            "the program on {} is another build than that of the service (SHA-256 {}…, not {}…): install the same file on every node",
            process::host_name(),
            &found[..12],
            &wanted[..wanted.len().min(12)]
        )
    }))
}

/// Gives signs of life.
#[derive(Clone)]
struct Life {
    directory: PathBuf,
    last: Arc<Mutex<Heartbeat>>,
}

impl Life {
    fn new(directory: &Path) -> Self {
        let host = process::host_name();
        let last = Heartbeat { count: 0, memory_bytes: None, host, exit_code: None, cause: None };
        Self { directory: directory.to_owned(), last: Arc::new(Mutex::new(last)) }
    }

    fn give(&self) -> io::Result<()> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.exit_code.is_some() {
            return Ok(());
        }
        last.count += 1;
        last.memory_bytes = process::resident_bytes(std::process::id());
        last.write(&self.directory)
    }

    /// The last one.
    fn end(&self, exit_code: i32, cause: Option<String>) -> io::Result<()> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.count += 1;
        (last.exit_code, last.cause) = (Some(exit_code), cause);
        last.write(&self.directory)
    }
}

/// The thread that receives requests and gives signs of life; it ends when this is dropped.
struct Watch {
    is_over: Arc<AtomicBool>,
}

impl Watch {
    fn begin(directory: &Path, signals: Signals, control: Control, life: Life, terms: &Terms) -> io::Result<Self> {
        let is_over = Arc::new(AtomicBool::new(false));
        life.give()?;
        let ears = Ears { signals, file: directory.join(attempt_files::CONTROL), offset: 0, control };
        let (over, terms) = (Arc::clone(&is_over), terms.clone());
        std::thread::Builder::new().name("requests".to_owned()).spawn(move || watch(ears, &life, &terms, &over))?;
        Ok(Self { is_over })
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

fn watch(mut ears: Ears, life: &Life, terms: &Terms, is_over: &AtomicBool) {
    let (mut read, mut given, mut heard) = (None::<Instant>, Instant::now(), Instant::now());
    while !is_over.load(Ordering::Relaxed) {
        let is_hinted = ears.hear_signals();
        if is_hinted || read.is_none_or(|at| at.elapsed() >= CONTROL_INTERVAL) {
            // A file system that does not answer now is asked again.
            let _ = ears.read_control();
            read = Some(Instant::now());
        }
        if given.elapsed() >= terms.heartbeat {
            given = Instant::now();
            if life.give().is_ok() {
                heard = Instant::now();
            } else if heard.elapsed() >= terms.lease {
                process::end_at_once();
            }
        }
        std::thread::sleep(SIGNAL_INTERVAL);
    }
}

/// Where requests come from.
struct Ears {
    signals: Signals,
    file: PathBuf,
    offset: u64,
    control: Control,
}

impl Ears {
    /// Takes signals; whether one says that there is a request in the file.
    fn hear_signals(&mut self) -> bool {
        let mut is_hinted = false;
        for signal in self.signals.pending() {
            match signal {
                // The node is taken back, or its time is up.
                SIGTERM => {
                    // A person's request may stand in the file already.
                    let _ = self.read_control();
                    self.control.receive(Request::Evict);
                }
                _ => is_hinted = true,
            }
        }
        is_hinted
    }

    /// Takes what was appended to the file. It is opened anew: another machine writes it.
    fn read_control(&mut self) -> io::Result<()> {
        let mut file = File::open(&self.file)?;
        file.seek(SeekFrom::Start(self.offset))?;
        let mut text = String::new();
        file.read_to_string(&mut text)?;
        for line in text.split_inclusive('\n').filter(|line| line.ends_with('\n')) {
            self.offset += line.len() as u64;
            if let Some(request) = Request::from_word(line.trim()) {
                self.control.receive(request);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Ears, Life, Terms, foreign_build};
    use crate::spec::heartbeat::Heartbeat;
    use crate::spec::states::Reason;
    use crate::worker::observers::Control;
    use signal_hook::consts::SIGUSR1;
    use signal_hook::iterator::Signals;
    use std::fs::OpenOptions;
    use std::io::Write;
    use std::time::Duration;

    #[test]
    fn requests_are_taken_once_and_only_whole() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("control");
        let append = |text: &str| {
            OpenOptions::new().create(true).append(true).open(&file).unwrap().write_all(text.as_bytes()).unwrap();
        };
        let control = Control::default();
        let signals = Signals::new([SIGUSR1]).unwrap();
        let mut ears = Ears { signals, file: file.clone(), offset: 0, control: control.clone() };
        assert!(ears.read_control().is_err());
        append("checkpoint\nevi");
        ears.read_control().unwrap();
        assert!(control.take_checkpoint_request() && !control.is_pausing());
        append("ct\nnonsense\n");
        ears.read_control().unwrap();
        assert!(!control.take_checkpoint_request());
        assert_eq!((control.is_pausing(), control.pause_reason()), (true, Some(Reason::WorkerEvicted)));
        append("pause\n");
        ears.read_control().unwrap();
        assert_eq!(control.pause_reason(), None);
    }

    #[test]
    fn nothing_follows_the_last_sign_of_life() {
        let directory = tempfile::tempdir().unwrap();
        let life = Life::new(directory.path());
        life.give().unwrap();
        assert!(Heartbeat::read(directory.path()).unwrap().memory_bytes.is_some());
        life.end(0, None).unwrap();
        life.give().unwrap();
        let last = Heartbeat::read(directory.path()).unwrap();
        assert_eq!((last.count, last.exit_code), (2, Some(0)));
    }

    #[test]
    fn another_build_is_refused_by_name() {
        let second = Duration::from_secs(1);
        let terms = |sha256| Terms { heartbeat: second, lease: second, program_sha256: sha256 };
        assert_eq!(foreign_build(&terms(None)).unwrap(), None);
        let said = foreign_build(&terms(Some("ab".repeat(32)))).unwrap().unwrap();
        assert!(said.contains("another build") && said.contains("every node"), "{said}");
    }
}
