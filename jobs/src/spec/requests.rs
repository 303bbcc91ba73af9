//! Requests of the service to a running worker. Nothing else flows into a run.

/// A request to a running worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// End the run after a checkpoint at the end of the step.
    Pause,
    /// Drop the step and end.
    Cancel,
    /// Write a checkpoint at the end of the step and go on.
    Checkpoint,
}

impl Request {
    /// All requests.
    pub const ALL: [Self; 3] = [Self::Pause, Self::Cancel, Self::Checkpoint];

    /// Its word on the way to a worker.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Cancel => "cancel",
            Self::Checkpoint => "checkpoint",
        }
    }

    /// The request of a word; None for other words.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|request| request.word() == word)
    }
}
