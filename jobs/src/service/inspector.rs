//! The service's side of an inspection: starts the process, limits its time, and takes its result.

use crate::formats::cloud_file;
use crate::service::store::uploads::{CLOUD, CONTENT};
use crate::service::store::{Store, UploadRow};
use crate::spec::uploads::{Contents, Inspection};
use crate::system::artifacts;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Time that an inspection may take.
const TIME_LIMIT: Duration = Duration::from_secs(90);
/// Longest line with the result, in bytes.
const LONGEST_LINE: u64 = 4 << 20;

/// Wakes the inspector. It ends when all handles are dropped.
#[derive(Debug, Clone)]
pub struct InspectorHandle {
    sender: Sender<()>,
}

impl InspectorHandle {
    /// There is something to look into.
    pub fn wake(&self) {
        // After the end there is no receiver.
        let _ = self.sender.send(());
    }
}

/// Inspects one upload after another, on a thread of its own.
///
/// # Errors
/// When the thread cannot be started.
pub fn start(store: Arc<Store>, program: PathBuf) -> io::Result<InspectorHandle> {
    let (sender, receiver) = channel();
    std::thread::Builder::new().name("inspector".to_owned()).spawn(move || inspect_all(&store, &program, &receiver))?;
    Ok(InspectorHandle { sender })
}

fn inspect_all(store: &Store, program: &Path, receiver: &Receiver<()>) {
    loop {
        match store.quarantined_uploads() {
            Ok(waiting) => {
                for upload in waiting {
                    inspect(store, program, &upload);
                }
            }
            Err(error) => tracing::error!(%error, "uploads could not be listed"),
        }
        match receiver.recv_timeout(Duration::from_secs(5)) {
            Ok(()) | Err(RecvTimeoutError::Timeout) => while receiver.try_recv().is_ok() {},
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn inspect(store: &Store, program: &Path, upload: &UploadRow) {
    let directory = store.upload_directory(&upload.id);
    let finished = check(program, upload, &directory).map_err(|error| error.to_string()).and_then(|verdict| {
        let outcome = verdict.as_ref().map_or_else(String::as_str, |_| "ready");
        tracing::info!(upload = upload.id, purpose = upload.purpose.word(), outcome, "upload checked");
        store.finish_upload(&upload.id, &verdict).map_err(|error| error.to_string())
    });
    if let Err(error) = finished {
        // It stays in quarantine and is inspected again.
        tracing::error!(upload = upload.id, error, "an upload could not be checked");
    }
}

/// Inspects an upload in a process of its own.
fn check(program: &Path, upload: &UploadRow, directory: &Path) -> io::Result<Result<Contents, String>> {
    let mut child = Command::new(program)
        .arg0("meniscus")
        .args(["inspect", "--as", upload.purpose.word()])
        .arg(directory.join(CONTENT))
        // No variable of this process reaches libhdf5: no plug-in path, no driver of another name.
        .env_clear()
        .env("HDF5_PLUGIN_PRELOAD", "::")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let output = child.stdout.take().ok_or_else(|| io::Error::other("no pipe"))?;
    let target = directory.join(CLOUD);
    let (sender, receiver) = channel();
    let reading = std::thread::Builder::new().name("inspection".to_owned()).spawn(move || {
        // The other side may have given up waiting.
        let _ = sender.send(take(output, &target));
    })?;
    let taken = receiver.recv_timeout(TIME_LIMIT);
    let is_late = taken.is_err();
    if is_late {
        child.kill()?;
    }
    let status = child.wait()?;
    if !is_late {
        let _ = reading.join();
    }
    if is_late {
        return Ok(Err(format!("looking into it took longer than {} s", TIME_LIMIT.as_secs())));
    }
    if let Some(signal) = status.signal() {
        return Ok(Err(format!("looking into it took more memory or time than is granted (signal {signal})")));
    }
    if !status.success() {
        return Ok(Err("looking into it failed".to_owned()));
    }
    taken.map_err(io::Error::other)?
}

/// Takes the line and puts the points behind it, if there are any, into a file.
fn take(output: impl Read, target: &Path) -> io::Result<Result<Contents, String>> {
    let mut output = BufReader::new(output);
    let mut line = Vec::new();
    (&mut output).take(LONGEST_LINE).read_until(b'\n', &mut line)?;
    let contents = match serde_json::from_slice(&line) {
        Ok(Inspection::Ready(contents)) => contents,
        Ok(Inspection::Rejected(reason)) => return Ok(Err(reason)),
        Err(_) => return Ok(Err("looking into it failed".to_owned())),
    };
    if !output.fill_buf()?.is_empty() {
        let mut file = File::create(artifacts::unfinished(target))?;
        let written = io::copy(&mut output.take(cloud_file::MOST_BYTES), &mut file)
            .and_then(|_| file.flush())
            .and_then(|()| artifacts::finish(target));
        if let Err(error) = written {
            let _ = std::fs::remove_file(artifacts::unfinished(target));
            // An upload that waits for space could not be deleted.
            if crate::system::process::is_out_of_space(&error) {
                return Ok(Err("there was no room on the disk for its points; delete it and send it again".to_owned()));
            }
            return Err(error);
        }
    }
    Ok(Ok(contents))
}
