//! The process of a worker that the local executor started: it receives requests on standard input, gives signs of life on
//! standard output, and runs its attempt.

use crate::spec::attempt_files;
use crate::spec::attempt_spec::AttemptSpec;
use crate::spec::records::{Record, RecordFile, RecordSink, Verdict};
use crate::spec::requests::Request;
use crate::system::process;
use crate::worker::attempt::run_attempt;
use crate::worker::observers::Control;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::time::Duration;

/// Time between two signs of life.
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);

/// Runs the attempt whose specification stands in a directory. The verdict is also its last record.
///
/// # Errors
/// When the specification cannot be read or the records cannot be opened.
pub fn run(directory: &Path) -> io::Result<Verdict> {
    process::be_nice();
    let spec: AttemptSpec = serde_json::from_slice(&std::fs::read(directory.join(attempt_files::ATTEMPT_SPEC))?)?;
    let control = Control::default();
    receive_requests(control.clone())?;
    give_heartbeats()?;
    let mut sink = AnnouncedRecords(RecordFile::open(directory, spec.epoch)?);
    Ok(run_attempt(&spec, directory, &control, &mut sink))
}

/// Receives requests on a thread of its own. The end of the input means that the service has ended: this process ends too.
fn receive_requests(control: Control) -> io::Result<()> {
    std::thread::Builder::new().name("requests".to_owned()).spawn(move || {
        for line in io::stdin().lock().lines() {
            let Ok(word) = line else { break };
            if let Some(request) = Request::from_word(word.trim()) {
                control.receive(request);
            }
        }
        process::end_at_once();
    })?;
    Ok(())
}

/// Ends this process when its standard input ends: the process at the other end has gone.
///
/// # Errors
/// When no thread can be started.
pub fn end_with_input() -> io::Result<()> {
    receive_requests(Control::default())
}

fn give_heartbeats() -> io::Result<()> {
    std::thread::Builder::new().name("heartbeat".to_owned()).spawn(|| {
        loop {
            std::thread::sleep(HEARTBEAT_INTERVAL);
            if heartbeat().is_err() {
                process::end_at_once();
            }
        }
    })?;
    Ok(())
}

/// One sign of life; it also hints that there may be new records.
fn heartbeat() -> io::Result<()> {
    let mut output = io::stdout().lock();
    output.write_all(b"\n")?;
    output.flush()
}

/// Records each of which is followed by a sign of life.
struct AnnouncedRecords(RecordFile);

impl RecordSink for AnnouncedRecords {
    fn put(&mut self, record: &Record, durable: bool) -> io::Result<()> {
        self.0.put(record, durable)?;
        // The next heartbeat notices a closed pipe.
        let _ = heartbeat();
        Ok(())
    }
}
