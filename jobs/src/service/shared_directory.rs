//! The folders of a data directory that the nodes of a cluster see, too. They lie in a shared directory, and the data directory has
//! links to them; the database, its log and the lock stay where the service runs.

use crate::service::data_directory::{DataDirectory, MARKER, ORPHANS};
use crate::service::store;
use crate::system::artifacts;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// Folders that are shared.
const SHARED: [&str; 3] = [store::JOBS, store::UPLOADS, ORPHANS];

/// The content of the marker: which data directory the folders belong to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Marker {
    shared_by: String,
}

/// Why a shared directory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SharedDirectoryError {
    /// It belongs to another data directory, or is none of ours.
    #[error("{} cannot be shared: {found}. Nothing there was changed; give executor.shared a new or empty directory", directory.display())]
    NotOurs {
        /// The directory.
        directory: PathBuf,
        /// What is in it.
        found: String,
    },
    /// It was used before, and is not there now.
    #[error("{} has no {MARKER}, though the jobs of this data directory lie there: is it mounted? Nothing was changed", .0.display())]
    Missing(PathBuf),
    /// The data directory has files of its own, or a link to another place.
    #[error("{} {found}. Stop the service, move its content to {}, and start again", folder.display(), wanted.display())]
    InTheWay {
        /// The folder of the data directory.
        folder: PathBuf,
        /// What it is.
        found: String,
        /// Where its content belongs.
        wanted: PathBuf,
    },
    /// The system failed.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

/// Puts jobs and uploads of a data directory into a shared one, which is made where there is none; its absolute path. A directory
/// whose data directory was lost is taken over with `adopt`.
///
/// # Errors
/// [`SharedDirectoryError`]; nothing of others is changed.
pub fn link(data: &DataDirectory, shared: &Path, adopt: bool) -> Result<PathBuf, SharedDirectoryError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |error| SharedDirectoryError::Io { path, error }
    };
    let is_linked = std::fs::symlink_metadata(data.path().join(store::JOBS)).is_ok_and(|meta| meta.is_symlink());
    if is_linked && !shared.join(MARKER).is_file() {
        // An empty mount point must not pass for a new directory: everything in it would be taken for lost.
        return Err(SharedDirectoryError::Missing(shared.to_owned()));
    }
    std::fs::create_dir_all(shared).map_err(failed(shared))?;
    let shared = std::fs::canonicalize(shared).map_err(failed(shared))?;
    recognize(&shared, data.id(), adopt)?;
    let marker = serde_json::to_vec_pretty(&Marker { shared_by: data.id().to_owned() }).map_err(io::Error::from);
    marker.and_then(|text| artifacts::write(&shared.join(MARKER), &text)).map_err(failed(&shared.join(MARKER)))?;
    for name in SHARED {
        let (folder, target) = (data.path().join(name), shared.join(name));
        std::fs::create_dir_all(&target).map_err(failed(&target))?;
        make_link(&folder, &target)?;
    }
    Ok(shared)
}

/// Refuses a directory of others.
fn recognize(shared: &Path, id: &str, adopt: bool) -> Result<(), SharedDirectoryError> {
    let not_ours = |found: String| SharedDirectoryError::NotOurs { directory: shared.to_owned(), found };
    let failed = |error| SharedDirectoryError::Io { path: shared.to_owned(), error };
    match std::fs::read(shared.join(MARKER)) {
        Ok(text) => {
            let marker: Marker = serde_json::from_slice(&text)
                .map_err(|_| not_ours(format!("its {MARKER} is that of a data directory, or damaged")))?;
            if marker.shared_by == id || adopt {
                return Ok(());
            }
            Err(not_ours(format!("it belongs to the data directory {}", marker.shared_by)))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let mut names = Vec::new();
            for entry in std::fs::read_dir(shared).map_err(failed)? {
                let name = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
                // The first start may have been cut short, and the root of a file system has `lost+found`.
                if name != "lost+found" && !name.starts_with(MARKER) {
                    names.push(name);
                }
            }
            names.sort();
            names.first().map_or(Ok(()), |name| Err(not_ours(format!("it has no {MARKER}, but {name}"))))
        }
        Err(error) => Err(failed(error)),
    }
}

/// Makes a folder of the data directory a link. An empty folder gives way; one with files does not.
fn make_link(folder: &Path, target: &Path) -> Result<(), SharedDirectoryError> {
    let failed = |error| SharedDirectoryError::Io { path: folder.to_owned(), error };
    let in_the_way = |found: &str| SharedDirectoryError::InTheWay {
        folder: folder.to_owned(),
        found: found.to_owned(),
        wanted: target.to_owned(),
    };
    match std::fs::symlink_metadata(folder) {
        Ok(meta) if meta.file_type().is_symlink() => {
            let there = std::fs::read_link(folder).map_err(failed)?;
            return if there == target {
                Ok(())
            } else {
                Err(in_the_way(&format!("is a link to {}", there.display())))
            };
        }
        Ok(meta) if meta.is_dir() => {
            if std::fs::read_dir(folder).map_err(failed)?.next().is_some() {
                return Err(in_the_way("has files of its own"));
            }
            std::fs::remove_dir(folder).map_err(failed)?;
        }
        Ok(_) => return Err(in_the_way("is a file")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(failed(error)),
    }
    std::os::unix::fs::symlink(target, folder).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::{SharedDirectoryError, link};
    use crate::service::data_directory::DataDirectory;
    use crate::service::store::Store;

    #[test]
    fn jobs_lie_in_the_shared_directory_under_the_path_of_the_nodes() {
        let (data, place) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let shared = place.path().join("new");
        for _ in 0..2 {
            let directory = DataDirectory::open(data.path()).unwrap();
            let shared = link(&directory, &shared, false).unwrap();
            let store = Store::open(directory.path()).unwrap();
            assert_eq!(store.job_directory("job_1"), shared.join("jobs/job_1"));
            assert_eq!(store.upload_directory("upl_1"), shared.join("uploads/upl_1"));
            store.close();
        }
        assert!(data.path().join("meniscus.sqlite").is_file() && !shared.join("meniscus.sqlite").exists());
        // It is not mounted: nothing passes for new.
        std::fs::rename(&shared, place.path().join("elsewhere")).unwrap();
        std::fs::create_dir(&shared).unwrap();
        let error = link(&DataDirectory::open(data.path()).unwrap(), &shared, false).unwrap_err();
        assert!(error.to_string().contains("is it mounted"), "{error}");
        assert_eq!(std::fs::read_dir(&shared).unwrap().count(), 0);
    }

    #[test]
    fn directories_of_others_and_files_in_the_way_are_left_as_they_are() {
        let (data, shared) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let directory = DataDirectory::open(data.path()).unwrap();
        std::fs::write(shared.path().join("thesis.tex"), "years of work").unwrap();
        let error = link(&directory, shared.path(), true).unwrap_err();
        assert!(error.to_string().contains("thesis.tex"), "{error}");
        assert_eq!(std::fs::read_dir(shared.path()).unwrap().count(), 1);
        std::fs::remove_file(shared.path().join("thesis.tex")).unwrap();

        std::fs::create_dir_all(data.path().join("jobs/job_x")).unwrap();
        let error = link(&directory, shared.path(), false).unwrap_err();
        assert!(
            matches!(error, SharedDirectoryError::InTheWay { .. }) && error.to_string().contains("move"),
            "{error}"
        );
        std::fs::remove_dir(data.path().join("jobs/job_x")).unwrap();
        link(&directory, shared.path(), false).unwrap();

        let another = tempfile::tempdir().unwrap();
        let other = DataDirectory::open(another.path()).unwrap();
        let error = link(&other, shared.path(), false).unwrap_err();
        assert!(error.to_string().contains(directory.id()), "{error}");
        // Its data directory was lost.
        link(&other, shared.path(), true).unwrap();
    }
}
