//! Measures an unknown machine once, in a separate process.

use meniscus_jobs::service::store::Store;
use meniscus_jobs::spec::calibration::Measurements;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// Starts the measurement if the store has none of this machine and build. The process has a low priority and ends with
/// the service.
///
/// # Errors
/// If the store fails or the thread cannot be started.
pub fn start_where_needed(store: &Arc<Store>, threads: usize) -> io::Result<()> {
    if !store.calibration().map_err(io::Error::other)?.is_empty() {
        return Ok(());
    }
    let store = Arc::clone(store);
    std::thread::Builder::new().name("calibration".to_owned()).spawn(move || match measure(&store, threads) {
        Ok(phases) => tracing::info!(phases, "measured the speed of this machine"),
        // Without a measurement, estimates of time begin with the first finished job.
        Err(error) => tracing::warn!(%error, "the speed of this machine could not be measured"),
    })?;
    Ok(())
}

fn measure(store: &Store, threads: usize) -> io::Result<usize> {
    let scratch = store.directory().join("calibration");
    // What a measurement that was cut short has left.
    if scratch.exists() {
        std::fs::remove_dir_all(&scratch)?;
    }
    let mut child = Command::new("/proc/self/exe")
        .args(["calibrate", "--threads", &threads.to_string(), "--scratch"])
        .arg(&scratch)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    // The process ends when its input closes.
    let _input = child.stdin.take();
    let said = child.stderr.take().map(|said| std::thread::spawn(|| lines_of(said)));
    let mut phases = 0;
    for line in child.stdout.take().map(BufReader::new).into_iter().flat_map(BufRead::lines) {
        let found: Measurements = serde_json::from_str(&line?)?;
        phases += found.phases.len();
        store.calibrate(&found.phases).map_err(io::Error::other)?;
        store.keep_precision(&found.precision).map_err(io::Error::other)?;
    }
    let status = child.wait()?;
    let said = said.and_then(|said| said.join().ok()).unwrap_or_default();
    if !status.success() {
        return Err(io::Error::other(format!("the measuring process failed: {}", said.join("; "))));
    }
    for line in said {
        tracing::warn!(line, "the measuring process could not do all of its runs");
    }
    Ok(phases)
}

/// What the process says on its standard error.
fn lines_of(said: impl Read) -> Vec<String> {
    BufReader::new(said).lines().map_while(Result::ok).collect()
}
