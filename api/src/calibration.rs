//! Measures an unknown machine once, in a separate process.

use meniscus_jobs::service::store::Store;
use meniscus_jobs::spec::calibration::Measurements;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// Starts the measurement if the store has none of this machine and build, or only the first part of one that was cut short. The
/// process has a low priority and ends with the service.
///
/// # Errors
/// If the store fails or the thread cannot be started.
pub fn start_where_needed(store: &Arc<Store>, threads: usize) -> io::Result<()> {
    let has_speeds = !store.calibration().map_err(io::Error::other)?.is_empty();
    if has_speeds && store.has_short_runs().map_err(io::Error::other)? {
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
    let input = child.stdin.take();
    let said = child.stderr.take().map(|said| std::thread::spawn(|| lines_of(said)));
    let kept = child.stdout.take().map_or(Ok(0), |output| keep(store, BufReader::new(output)));
    drop(input);
    let status = child.wait()?;
    let said = said.and_then(|said| said.join().ok()).unwrap_or_default();
    if !status.success() {
        return Err(io::Error::other(format!("the measuring process failed: {}", said.join("; "))));
    }
    for line in said {
        tracing::warn!(line, "the measuring process could not do all of its runs");
    }
    kept
}

/// Keeps each line of measurements as it comes; the number of phases is the answer.
fn keep(store: &Store, lines: impl BufRead) -> io::Result<usize> {
    let mut phases = 0;
    for line in lines.lines() {
        let found: Measurements = serde_json::from_str(&line?)?;
        phases += found.phases.len();
        store.calibrate(&found.phases).map_err(io::Error::other)?;
        store.keep_precision(&found.precision).map_err(io::Error::other)?;
    }
    Ok(phases)
}

/// What the process says on its standard error.
fn lines_of(said: impl Read) -> Vec<String> {
    BufReader::new(said).lines().map_while(Result::ok).collect()
}

#[cfg(test)]
mod tests {
    use super::keep;
    use meniscus_jobs::service::store::Store;
    use meniscus_jobs::spec::calibration::{Measured, Measurements, PhaseMeasured};
    use meniscus_jobs::spec::work_precision::{PrecisionMeasured, reference_of};
    use serde_json::json;

    #[test]
    fn what_was_measured_before_the_process_ended_is_kept_and_the_rest_is_known_to_lack() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(directory.path()).unwrap();
        let phase = PhaseMeasured {
            family: "redistance/2".to_owned(),
            phase: "fits".to_owned(),
            measured: Measured { work: 2.0, seconds: 1.0 },
        };
        let scene = meniscus::scene::parse(&json!({"kind": "redistance"}), meniscus::scenes::SCENES).unwrap();
        let run = PrecisionMeasured {
            problem: reference_of(scene.as_ref(), None),
            quantity: "phi".to_owned(),
            norm: "rms".to_owned(),
            spacing: 0.1,
            error: 1e-3,
            cpu_s: 1.0,
        };
        let speeds = Measurements { phases: vec![phase], ..Measurements::default() };
        let errors = Measurements { precision: vec![run.clone()], ..Measurements::default() };
        let line = |found: &Measurements| serde_json::to_string(found).unwrap() + "\n";
        // The process was ended in the middle of its second line.
        let torn = line(&speeds) + &line(&errors)[..30];
        assert!(keep(&store, torn.as_bytes()).is_err());
        assert!(!store.calibration().unwrap().is_empty() && !store.has_short_runs().unwrap());
        assert_eq!(keep(&store, (line(&speeds) + &line(&errors)).as_bytes()).unwrap(), 1);
        assert!(store.has_short_runs().unwrap());
        assert_eq!(store.precision(&run.problem, "phi", "rms").unwrap().len(), 1);
        store.close();
    }
}
