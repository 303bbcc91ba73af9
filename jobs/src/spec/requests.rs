//! Requests of the service to a running worker. Nothing else flows into a run.

/// Exit code of a worker to which the system did not grant what it needs to begin, such as threads: EX_TEMPFAIL.
pub const NOT_STARTED_CODE: u8 = 75;

/// A request to a running worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// End the run after a checkpoint at the end of the step.
    Pause,
    /// The same because the service stops: the job goes back to the queue.
    Drain,
    /// The same because the machine is taken back: the job goes back to the queue.
    Evict,
    /// Drop the step and end.
    Cancel,
    /// Write a checkpoint at the end of the step and go on.
    Checkpoint,
    /// End at once: another worker has the job.
    Stop,
}

impl Request {
    /// All requests.
    pub const ALL: [Self; 6] = [Self::Pause, Self::Drain, Self::Evict, Self::Cancel, Self::Checkpoint, Self::Stop];

    /// Its word on the way to a worker.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Drain => "drain",
            Self::Evict => "evict",
            Self::Cancel => "cancel",
            Self::Checkpoint => "checkpoint",
            Self::Stop => "stop",
        }
    }

    /// The request of a word; None for other words.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|request| request.word() == word)
    }
}
