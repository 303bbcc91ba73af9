//! Calls of `scancel` and `scontrol`, on a thread of their own.

use super::Settings;
use super::command;
use std::collections::HashSet;
use std::io;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time that a command has to answer.
const TIME_LIMIT: Duration = Duration::from_secs(20);

/// What to tell the cluster about a job.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Errand {
    /// Its worker has a request to read.
    Hint {
        /// Its name.
        name: String,
        /// Its number.
        id: String,
    },
    /// It is to end.
    End {
        /// Its name. Numbers are used again: only a job of this name is ended.
        name: String,
        /// Its number, where it is known.
        id: Option<String>,
    },
    /// It may run on any node but those that the site leaves out.
    Admit {
        /// Its name.
        name: String,
        /// These.
        excluded: String,
    },
}

impl Errand {
    fn arguments(&self) -> Vec<String> {
        match self {
            Self::Hint { name, id } => {
                vec!["--batch".to_owned(), "--signal=USR1".to_owned(), format!("--name={name}"), id.clone()]
            }
            Self::End { name, id: Some(id) } => vec![format!("--name={name}"), id.clone()],
            Self::End { name, id: None } => vec!["--me".to_owned(), format!("--name={name}")],
            Self::Admit { name, excluded } => {
                vec!["update".to_owned(), format!("JobName={name}"), format!("ExcNodeList={excluded}")]
            }
        }
    }
}

/// Takes errands. One that waits is not put into the line once more.
#[derive(Debug)]
pub(super) struct Errands {
    sender: Sender<Errand>,
    waiting: Arc<Mutex<HashSet<Errand>>>,
}

impl Errands {
    /// Starts the thread; it ends when this is dropped.
    pub(super) fn start(settings: &Settings) -> io::Result<Self> {
        let (sender, receiver) = channel::<Errand>();
        let waiting: Arc<Mutex<HashSet<Errand>>> = Arc::default();
        let left = Arc::clone(&waiting);
        let [scancel, scontrol] = ["scancel", "scontrol"].map(|name| settings.command(name));
        std::thread::Builder::new().name("slurm-errands".to_owned()).spawn(move || {
            for errand in receiver {
                left.lock().unwrap_or_else(PoisonError::into_inner).remove(&errand);
                let program = if let Errand::Admit { .. } = errand { &scontrol } else { &scancel };
                if let Err(error) = command::run(program, errand.arguments(), TIME_LIMIT, None) {
                    // It is sent again while the job is there.
                    tracing::debug!(?errand, %error, "the cluster gave no answer");
                }
            }
        })?;
        Ok(Self { sender, waiting })
    }

    /// Does an errand soon.
    pub(super) fn send(&self, errand: Errand) {
        if self.waiting.lock().unwrap_or_else(PoisonError::into_inner).insert(errand.clone()) {
            // Without a thread nothing can be told.
            let _ = self.sender.send(errand);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Errand;

    #[test]
    fn nothing_is_ended_by_its_number_alone() {
        let name = "mns-job_1-1".to_owned();
        for id in [None, Some("7".to_owned())] {
            let arguments = Errand::End { name: name.clone(), id }.arguments();
            assert!(arguments.contains(&"--name=mns-job_1-1".to_owned()), "{arguments:?}");
        }
    }
}
