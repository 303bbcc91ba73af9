//! The log of an attempt.

use crate::spec::attempt_files;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A log of whole lines, each with a time and written at once.
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
}

impl Log {
    /// The log of an attempt in its directory.
    #[must_use]
    pub fn new(directory: &Path) -> Self {
        Self { path: directory.join(attempt_files::LOG) }
    }

    /// Adds a line.
    pub fn line(&self, text: &str) {
        let line = format!("{} {text}\n", crate::system::clock::now());
        // A log that cannot be written must not end a run.
        let _ = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .and_then(|mut f| f.write_all(line.as_bytes()));
    }
}
