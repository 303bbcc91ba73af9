//! Measuring an unknown machine, once, in a process of its own.

use meniscus_jobs::service::store::Store;
use meniscus_jobs::spec::calibration::PhaseMeasured;
use std::io;
use std::process::{Command, Stdio};
use std::sync::Arc;

/// Starts the measurement where nothing is known of this machine with this build. It stands back for jobs, and ends
/// with the service.
///
/// # Errors
/// When it cannot be started.
pub fn start_where_needed(store: &Arc<Store>, threads: usize) -> io::Result<()> {
    if !store.calibration().map_err(io::Error::other)?.is_empty() {
        return Ok(());
    }
    let store = Arc::clone(store);
    std::thread::Builder::new().name("calibration".to_owned()).spawn(move || match measure(&store, threads) {
        Ok(phases) => tracing::info!(phases, "this machine was measured"),
        // Estimates then begin with the first job that finishes.
        Err(error) => tracing::warn!(%error, "this machine could not be measured"),
    })?;
    Ok(())
}

fn measure(store: &Store, threads: usize) -> io::Result<usize> {
    let mut child = Command::new("/proc/self/exe")
        .args(["calibrate", "--threads", &threads.to_string(), "--scratch"])
        .arg(store.directory().join("calibration"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    // `wait_with_output` would close the input, which ends the process.
    let input = child.stdin.take();
    let output = child.wait_with_output()?;
    drop(input);
    if !output.status.success() {
        return Err(io::Error::other("the measuring process failed"));
    }
    let found: Vec<PhaseMeasured> = serde_json::from_slice(&output.stdout)?;
    store.calibrate(&found).map_err(io::Error::other)?;
    Ok(found.len())
}
