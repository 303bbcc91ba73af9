//! A data directory and its marker. `meniscus.json` says that a directory belongs to this service; nothing in any other
//! directory is read as data, changed or deleted.

use crate::service::store;
use crate::system::artifacts;
use crate::system::lock::{self, DirectoryLock, LockError};
use rusqlite::{Connection, OpenFlags};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use ulid::Ulid;

/// Name of the marker in the data directory.
pub const MARKER: &str = "meniscus.json";
/// Folder of job and upload folders that the database does not know.
pub const ORPHANS: &str = "orphans";

/// Entries that a new data directory may have: the root of a file system has `lost+found`.
const IGNORED: [&str; 2] = ["lost+found", lock::FILE_NAME];
/// Tables by which a database of this program is recognized.
const TABLES: [&str; 3] = ["jobs", "events", "checkpoints"];
/// Names that a message lists.
const NAMES_SHOWN: usize = 3;

/// The content of the marker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Marker {
    /// Id of the data directory.
    id: String,
    /// Number of schema changes that the program knew which used it last.
    schema: i64,
}

/// A data directory that this process holds.
#[derive(Debug)]
pub struct DataDirectory {
    path: PathBuf,
    id: String,
    _lock: DirectoryLock,
}

/// Why a directory cannot be used as a data directory.
#[derive(Debug, thiserror::Error)]
pub enum DataDirectoryError {
    /// It has entries and no marker.
    #[error(
        "{} is not a data directory of meniscus: it has no {MARKER}, but {found}. Nothing there was changed; give --data a new or \
         empty directory",
        directory.display()
    )]
    NotOurs {
        /// The directory.
        directory: PathBuf,
        /// What is in it.
        found: String,
    },
    /// It is not a directory.
    #[error("{} is not a directory; give --data a directory, or a path at which one can be created", .0.display())]
    NotADirectory(PathBuf),
    /// The marker cannot be read.
    #[error("{} is damaged: {cause}. Put it back from a backup, or delete it if {} is there", path.display(), store::FILE_NAME)]
    DamagedMarker {
        /// Path of the marker.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// A later version used the directory.
    #[error("{} was used by a later version of meniscus (schema {found}, this program knows {known}); use that version", directory.display())]
    Newer {
        /// The directory.
        directory: PathBuf,
        /// Schema of the marker.
        found: i64,
        /// Schema of the program.
        known: i64,
    },
    /// Another service has it, or the lock file cannot be used.
    #[error("{}: {cause}", directory.display())]
    Lock {
        /// The directory.
        directory: PathBuf,
        /// Why it is not locked.
        cause: LockError,
    },
    /// The system failed.
    #[error("{} cannot be used as data directory: {error}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

impl DataDirectory {
    /// Takes a directory of ours, or makes a new or empty one ours.
    ///
    /// # Errors
    /// [`DataDirectoryError`]; a directory that is not ours is left as it is.
    pub fn open(path: &Path) -> Result<Self, DataDirectoryError> {
        let failed = |error| DataDirectoryError::Io { path: path.to_owned(), error };
        match std::fs::create_dir_all(path) {
            Err(_) if path.exists() && !path.is_dir() => {
                return Err(DataDirectoryError::NotADirectory(path.to_owned()));
            }
            made => made.map_err(failed)?,
        }
        // Workers get paths that do not depend on a current directory.
        let path = std::fs::canonicalize(path).map_err(failed)?;
        let marker = recognize(&path)?;
        let lock =
            DirectoryLock::take(&path).map_err(|cause| DataDirectoryError::Lock { directory: path.clone(), cause })?;
        let id = mark(&path, marker)?;
        Ok(Self { path, id, _lock: lock })
    }

    /// Takes a directory that is ours already, without making one.
    ///
    /// # Errors
    /// [`DataDirectoryError`].
    pub fn open_existing(path: &Path) -> Result<Self, DataDirectoryError> {
        let is_ours = path.join(MARKER).is_file() || is_our_database(&path.join(store::FILE_NAME));
        if !is_ours {
            let found = "no database of meniscus".to_owned();
            return Err(DataDirectoryError::NotOurs { directory: path.to_owned(), found });
        }
        Self::open(path)
    }

    /// Its id.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The absolute path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// The marker of a directory; None where it may become ours.
fn recognize(directory: &Path) -> Result<Option<Marker>, DataDirectoryError> {
    let path = directory.join(MARKER);
    let marker = match std::fs::read(&path) {
        Ok(text) => Some(serde_json::from_slice::<Marker>(&text).map_err(|error| {
            let cause = error.to_string();
            DataDirectoryError::DamagedMarker { path: path.clone(), cause }
        })?),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(DataDirectoryError::Io { path, error }),
    };
    if let Some(marker) = marker {
        let known = store::migrations::known();
        if marker.schema > known {
            let directory = directory.to_owned();
            return Err(DataDirectoryError::Newer { directory, found: marker.schema, known });
        }
        return Ok(Some(marker));
    }
    if is_our_database(&directory.join(store::FILE_NAME)) {
        return Ok(None);
    }
    let found =
        foreign_entries(directory).map_err(|error| DataDirectoryError::Io { path: directory.to_owned(), error })?;
    match found {
        None => Ok(None),
        Some(found) => Err(DataDirectoryError::NotOurs { directory: directory.to_owned(), found }),
    }
}

/// Entries of a directory without marker and database, as a message shows them.
fn foreign_entries(directory: &Path) -> io::Result<Option<String>> {
    let unfinished = artifacts::unfinished(&directory.join(MARKER));
    let mut names = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !IGNORED.contains(&name.as_str()) && entry.path() != unfinished {
            names.push(name);
        }
    }
    names.sort();
    Ok(match names.len() {
        0 => None,
        n if n <= NAMES_SHOWN => Some(names.join(", ")),
        n => Some(format!("{} and {} more", names[..NAMES_SHOWN].join(", "), n - NAMES_SHOWN)),
    })
}

/// Whether a file is a database that this program made. It is opened for reading alone.
fn is_our_database(path: &Path) -> bool {
    if !path.is_file() {
        return false;
    }
    let count = || -> rusqlite::Result<usize> {
        let connection = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
        let mut statement = connection.prepare("SELECT name FROM sqlite_master WHERE type = 'table'")?;
        let names = statement.query_map([], |row| row.get::<_, String>(0))?.collect::<Result<Vec<_>, _>>()?;
        Ok(TABLES.iter().filter(|table| names.iter().any(|name| name == *table)).count())
    };
    count().is_ok_and(|count| count == TABLES.len())
}

/// Writes the marker where it is missing or of an older program; the id in it.
fn mark(directory: &Path, marker: Option<Marker>) -> Result<String, DataDirectoryError> {
    let schema = store::migrations::known();
    let id = match marker {
        Some(marker) if marker.schema == schema => return Ok(marker.id),
        Some(marker) => marker.id,
        None => format!("data_{}", Ulid::generate()),
    };
    let path = directory.join(MARKER);
    let text = serde_json::to_vec_pretty(&Marker { id: id.clone(), schema }).map_err(io::Error::from);
    text.and_then(|text| artifacts::write(&path, &text)).map_err(|error| DataDirectoryError::Io { path, error })?;
    Ok(id)
}

#[cfg(test)]
mod tests {
    use super::{DataDirectory, DataDirectoryError, MARKER};
    use crate::service::store::Store;

    #[test]
    fn an_empty_directory_becomes_ours_and_stays_so() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::create_dir(directory.path().join("lost+found")).unwrap();
        drop(DataDirectory::open(directory.path()).unwrap());
        let marker = std::fs::read(directory.path().join(MARKER)).unwrap();
        std::fs::write(directory.path().join("notes.txt"), "").unwrap();
        drop(DataDirectory::open(directory.path()).unwrap());
        assert_eq!(std::fs::read(directory.path().join(MARKER)).unwrap(), marker);
    }

    #[test]
    fn a_foreign_directory_is_refused_and_left_as_it_is() {
        for foreign in ["jobs/2025-thesis/results.csv", ".DS_Store", "meniscus.sqlite"] {
            let directory = tempfile::tempdir().unwrap();
            let file = directory.path().join(foreign);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(&file, "years of work").unwrap();
            let error = DataDirectory::open(directory.path()).unwrap_err();
            assert!(matches!(error, DataDirectoryError::NotOurs { .. }), "{foreign}: {error}");
            let first = foreign.split('/').next().unwrap();
            assert!(error.to_string().contains(first), "{error}");
            assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1, "{foreign}");
            assert_eq!(std::fs::read_to_string(&file).unwrap(), "years of work");
        }
    }

    #[test]
    fn a_directory_of_the_version_before_is_marked() {
        let directory = tempfile::tempdir().unwrap();
        Store::open(directory.path()).unwrap().close();
        std::fs::write(directory.path().join("notes.txt"), "").unwrap();
        drop(DataDirectory::open(directory.path()).unwrap());
        assert!(directory.path().join(MARKER).is_file());
    }

    #[test]
    fn damaged_and_newer_markers_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        for (text, part) in [("{", "damaged"), (r#"{"id": "data_x", "schema": 99}"#, "later version")] {
            std::fs::write(directory.path().join(MARKER), text).unwrap();
            let error = DataDirectory::open(directory.path()).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let file = directory.path().join("a file");
        std::fs::write(&file, "").unwrap();
        assert!(matches!(DataDirectory::open(&file), Err(DataDirectoryError::NotADirectory(_))));
    }
}
