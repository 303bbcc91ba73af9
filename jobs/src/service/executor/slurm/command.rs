//! Commands of the cluster, each with a time limit. A command that fails or does not answer is no answer.

use std::ffi::OsStr;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Why a command gave no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// It cannot be run.
    #[error("{0}")]
    NotRun(String),
    /// It did not end in time.
    #[error("{command} gave no answer within {seconds} s")]
    TimedOut {
        /// Name of the command.
        command: String,
        /// The limit.
        seconds: u64,
    },
    /// It ended with an error.
    #[error("{0}")]
    Failed(String),
}

/// Time between two looks whether a command has ended.
const LOOK: Duration = Duration::from_millis(5);

/// Runs a command to its end and returns what it wrote to its standard output. A command that says `last_words` on its standard
/// error is ended there and has failed.
///
/// # Errors
/// [`NoAnswer`], with what the command wrote to its standard error where it failed by itself.
pub fn run<S: AsRef<OsStr>>(
    program: impl AsRef<Path>,
    arguments: impl IntoIterator<Item = S>,
    limit: Duration,
    last_words: Option<&str>,
) -> Result<String, NoAnswer> {
    let program = program.as_ref();
    let name = program.file_name().unwrap_or_default().to_string_lossy();
    let not_run = |error: std::io::Error| NoAnswer::NotRun(format!("{name} cannot be run: {error}"));
    let mut child = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(not_run)?;
    // A long answer would fill a pipe that is not read.
    let output = child.stdout.take().map(Reader::start);
    let errors = child.stderr.take().map(Reader::start);
    let has_said =
        || last_words.is_some_and(|words| errors.as_ref().is_some_and(|errors| errors.so_far().contains(words)));
    let status = wait(&mut child, limit, has_said).map_err(not_run)?;
    if has_said() {
        return Err(NoAnswer::Failed(errors.map(|errors| errors.so_far()).unwrap_or_default()));
    }
    let Some(status) = status else {
        // Whatever still holds the pipes keeps the readers, not this thread.
        return Err(NoAnswer::TimedOut { command: name.into_owned(), seconds: limit.as_secs() });
    };
    let text = |reader: Option<Reader>| reader.map(Reader::all).unwrap_or_default();
    let (output, errors) = (text(output), text(errors));
    if status.success() {
        return Ok(output);
    }
    let said = errors.trim();
    Err(NoAnswer::Failed(if said.is_empty() { format!("{name} ended with {status}") } else { said.to_owned() }))
}

/// How a process ended; None where it had to be killed, at the limit or because it has said enough.
fn wait(child: &mut Child, limit: Duration, has_said: impl Fn() -> bool) -> std::io::Result<Option<ExitStatus>> {
    let deadline = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline || has_said() {
            // It may have ended in between.
            let _ = child.kill();
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

/// Reads a pipe on a thread of its own.
struct Reader {
    bytes: Arc<Mutex<Vec<u8>>>,
    thread: JoinHandle<()>,
}

impl Reader {
    fn start(mut pipe: impl Read + Send + 'static) -> Self {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let into = Arc::clone(&bytes);
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 1 << 14];
            while let Ok(count) = pipe.read(&mut buffer) {
                if count == 0 {
                    return;
                }
                into.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(&buffer[..count]);
            }
        });
        Self { bytes, thread }
    }

    fn so_far(&self) -> String {
        String::from_utf8_lossy(&self.bytes.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }

    fn all(self) -> String {
        // What was read before an error counts.
        let Self { bytes, thread } = self;
        let _ = thread.join();
        String::from_utf8_lossy(&bytes.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::{NoAnswer, run};
    use std::time::{Duration, Instant};

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn answers_of_any_length_are_read_and_errors_have_their_words() {
        assert_eq!(run("echo", ["a"], SECOND, None).unwrap(), "a\n");
        assert_eq!(run("head", ["-c", "1000000", "/dev/zero"], SECOND, None).unwrap().len(), 1_000_000);
        let failed = run("sh", ["-c", "echo slurm says no >&2; exit 3"], SECOND, None).unwrap_err();
        assert_eq!(failed, NoAnswer::Failed("slurm says no".to_owned()));
        assert!(matches!(run("no-such-program-here", [""; 0], SECOND, None), Err(NoAnswer::NotRun(_))));
    }

    #[test]
    fn a_command_that_has_said_enough_is_not_waited_for() {
        let began = Instant::now();
        let said = run(
            "sh",
            ["-c", "echo sleeping and retrying >&2; exec sleep 100"],
            SECOND * 50,
            Some("sleeping and retrying"),
        );
        assert!(matches!(said, Err(NoAnswer::Failed(text)) if text.contains("sleeping")));
        assert!(began.elapsed() < SECOND * 10);
    }

    #[test]
    fn a_command_that_hangs_is_given_up() {
        let began = Instant::now();
        let said = run("sleep", ["100"], Duration::from_millis(100), None).unwrap_err();
        assert!(matches!(said, NoAnswer::TimedOut { .. }) && began.elapsed() < SECOND, "{said}");
    }
}
