//! The inside of a worker's process: the ear on standard input, the pulse on standard output, and the attempt.

use crate::spec::attempt_spec::{FILE_NAME, Order};
use crate::spec::records::{Record, RecordFile, RecordSink, Verdict};
use crate::system::process;
use crate::worker::attempt::run_attempt;
use crate::worker::observers::Control;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::time::Duration;

/// Time between two signs of life.
const PULSE: Duration = Duration::from_secs(1);

/// Runs the order in an attempt's directory; the verdict stands in the records.
///
/// # Errors
/// When the order cannot be read or the records cannot be opened.
pub fn run(directory: &Path) -> io::Result<Verdict> {
    process::be_nice();
    let order: Order = serde_json::from_slice(&std::fs::read(directory.join(FILE_NAME))?)?;
    let control = Control::default();
    listen(control.clone())?;
    pulse()?;
    let mut sink = Announced(RecordFile::open(directory, order.epoch)?);
    Ok(run_attempt(&order, directory, &control, &mut sink))
}

/// Hears requests; the end of the input is the end of the service and of this process.
fn listen(control: Control) -> io::Result<()> {
    std::thread::Builder::new().name("ear".to_owned()).spawn(move || {
        for line in io::stdin().lock().lines() {
            match line {
                Ok(word) => control.hear(&word),
                Err(_) => break,
            }
        }
        end_at_once();
    })?;
    Ok(())
}

/// Ends this process when its standard input does: whoever holds the other end has gone.
///
/// # Errors
/// When no thread can be started.
pub fn end_with_input() -> io::Result<()> {
    listen(Control::default())
}

fn pulse() -> io::Result<()> {
    std::thread::Builder::new().name("pulse".to_owned()).spawn(|| {
        loop {
            std::thread::sleep(PULSE);
            if hint().is_err() {
                end_at_once();
            }
        }
    })?;
    Ok(())
}

fn hint() -> io::Result<()> {
    let mut output = io::stdout().lock();
    output.write_all(b"\n")?;
    output.flush()
}

/// Ends without exit handlers, which could wait for a library that another thread is inside of. Whatever was being
/// written has an unfinished name.
fn end_at_once() {
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
}

/// Records that are hinted at on standard output.
struct Announced(RecordFile);

impl RecordSink for Announced {
    fn put(&mut self, record: &Record, durable: bool) -> io::Result<()> {
        self.0.put(record, durable)?;
        // The pulse notices a closed pipe.
        let _ = hint();
        Ok(())
    }
}
