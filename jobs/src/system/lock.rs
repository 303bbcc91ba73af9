//! The lock of a data directory: one service at a time uses it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::Path;

/// Name of the lock file.
pub const FILE_NAME: &str = "lock";

/// Holds the directory until it is dropped or the process ends.
#[derive(Debug)]
pub struct DirectoryLock {
    _file: File,
}

/// The directory could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another service has it.
    #[error("another service uses this data directory")]
    Held,
    /// The lock file could not be made.
    #[error("the lock file cannot be used: {0}")]
    Io(#[from] io::Error),
}

impl DirectoryLock {
    /// Takes a directory.
    ///
    /// # Errors
    /// [`LockError`].
    pub fn take(directory: &Path) -> Result<Self, LockError> {
        let mut file = OpenOptions::new().create(true).truncate(false).write(true).open(directory.join(FILE_NAME))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(LockError::Held),
            Err(TryLockError::Error(error)) => return Err(error.into()),
        }
        file.set_len(0)?;
        writeln!(file, "{}", std::process::id())?;
        Ok(Self { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::{DirectoryLock, LockError};

    #[test]
    fn a_second_holder_is_refused_until_the_first_is_gone() {
        let directory = tempfile::tempdir().unwrap();
        let first = DirectoryLock::take(directory.path()).unwrap();
        assert!(matches!(DirectoryLock::take(directory.path()), Err(LockError::Held)));
        drop(first);
        assert!(DirectoryLock::take(directory.path()).is_ok());
    }
}
