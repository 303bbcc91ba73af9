//! Writing files so that a reader sees them whole or not at all: beside the target, synced, renamed, the directory
//! synced after.

use crate::system::breakpoints::pass;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The name under which a file is written before it is whole.
#[must_use]
pub fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".unfinished");
    path.with_file_name(name)
}

/// Makes an unfinished file durable and gives it its name.
///
/// # Errors
/// When the system refuses.
pub fn finish(path: &Path) -> io::Result<()> {
    let beside = unfinished(path);
    File::open(&beside)?.sync_all()?;
    pass("artifact/synced");
    fs::rename(&beside, path)?;
    pass("artifact/renamed");
    sync_directory(path.parent().unwrap_or(Path::new(".")))?;
    pass("artifact/named");
    Ok(())
}

/// Makes renames and removals in a directory durable.
///
/// # Errors
/// When the system refuses.
pub fn sync_directory(directory: &Path) -> io::Result<()> {
    File::open(directory)?.sync_all()
}

/// Writes bytes as a whole file.
///
/// # Errors
/// When the system refuses; the target is unchanged then.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(unfinished(path))?;
    file.write_all(bytes)?;
    drop(file);
    finish(path)
}
