//! The sign of life of a worker that has no pipe to its service: a small file in the attempt's directory, written anew each time.
//! The service compares it with what it read before, never with a clock of another machine.

use crate::spec::attempt_files;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// One sign of life.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heartbeat {
    /// Rises with each sign of life.
    pub count: u64,
    /// Resident memory of the worker.
    pub memory_bytes: Option<u64>,
    /// Machine on which it runs.
    pub host: String,
    /// The exit code of a worker that ends by itself; nothing follows it.
    pub exit_code: Option<i32>,
    /// Why it did not begin, where it did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
}

impl Heartbeat {
    /// Writes it into an attempt's directory. It is not synced: it is worth nothing after a crash.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn write(&self, directory: &Path) -> io::Result<()> {
        let beside = directory.join(format!("{}.new", attempt_files::HEARTBEAT));
        let mut file = File::create(&beside)?;
        file.write_all(&serde_json::to_vec(self)?)?;
        drop(file);
        fs::rename(beside, directory.join(attempt_files::HEARTBEAT))
    }

    /// The last one of an attempt; None where there is none, or none that can be read at the moment.
    #[must_use]
    pub fn read(directory: &Path) -> Option<Self> {
        serde_json::from_slice(&fs::read(directory.join(attempt_files::HEARTBEAT)).ok()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::Heartbeat;

    #[test]
    fn what_is_written_is_read() {
        let directory = tempfile::tempdir().unwrap();
        assert_eq!(Heartbeat::read(directory.path()), None);
        let last = Heartbeat {
            count: 3,
            memory_bytes: Some(1 << 20),
            host: "node1".to_owned(),
            exit_code: Some(0),
            cause: None,
        };
        last.write(directory.path()).unwrap();
        assert_eq!(Heartbeat::read(directory.path()), Some(last));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
