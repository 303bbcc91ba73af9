//! The states of a job and the one table of transitions between them.

use meniscus::simulation::{Divergence, StepError};
use serde::{Deserialize, Serialize};

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident => $word:literal,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum $name {
            $($(#[$variant_doc])* #[serde(rename = $word)] $variant,)*
        }

        impl $name {
            /// All values.
            pub const ALL: &[$name] = &[$($name::$variant,)*];

            /// Its word in JSON and in the store.
            #[must_use]
            pub fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)*
                }
            }

            /// The value of a word; None for other words.
            #[must_use]
            pub fn from_word(word: &str) -> Option<Self> {
                match word {
                    $($word => Some(Self::$variant),)*
                    _ => None,
                }
            }
        }
    };
}

words! {
    /// State of a job.
    State {
        /// Waiting for a slot.
        Queued => "queued",
        /// A worker runs.
        Running => "running",
        /// A worker was asked to checkpoint and end.
        Pausing => "pausing",
        /// Without a worker, with checkpoints to go on from.
        Paused => "paused",
        /// A worker was asked to drop everything.
        Canceling => "canceling",
        /// The worker ended without a verdict.
        Interrupted => "interrupted",
        /// Finished, with all results published.
        Succeeded => "succeeded",
        /// Ended by an error.
        Failed => "failed",
        /// Ended on request.
        Canceled => "canceled",
    }
}

words! {
    /// Event that changes the state of a job.
    Trigger {
        /// A slot and memory are free.
        Claim => "claim",
        /// The worker could not be started.
        Miss => "miss",
        /// A request to cancel.
        Cancel => "cancel",
        /// A request to pause, or a limit.
        Pause => "pause",
        /// A request to resume, or space on the device again.
        Resume => "resume",
        /// The worker ended with everything published.
        Finish => "finish",
        /// The worker ended after a checkpoint.
        Rest => "rest",
        /// The worker ended after a checkpoint because the service shuts down.
        Drain => "drain",
        /// The worker dropped its step and ended.
        Drop => "drop",
        /// The run cannot go on.
        Fail => "fail",
        /// The worker ended without a verdict.
        Lose => "lose",
        /// A lost job goes back to the queue.
        Requeue => "requeue",
    }
}

words! {
    /// Why a job is in its state, where the state does not say so.
    Reason {
        /// On request.
        UserCancel => "user.cancel",
        /// On request.
        UserPause => "user.pause",
        /// Running time used up.
        LimitWalltime => "limit.walltime",
        /// Resident memory above the limit.
        LimitMemory => "limit.memory",
        /// Ended by the kernel for memory.
        WorkerOom => "worker.oom",
        /// Files above the limit.
        LimitDisk => "limit.disk",
        /// No space on the device.
        StorageEnospc => "storage.enospc",
        /// Reading or writing failed.
        StorageIo => "storage.io",
        /// A value stopped being a number.
        DivergedNonfinite => "diverged.nonfinite",
        /// A particle became faster than sound.
        DivergedCfl => "diverged.cfl",
        /// The limits ask for a step too small to go on.
        DivergedDtFloor => "diverged.dt_floor",
        /// The interface vanished.
        DivergedInterface => "diverged.interface",
        /// A system of equations was not solved, or a tolerance not kept.
        DivergedUnsolved => "diverged.unsolved",
        /// Energy was made.
        DivergedEnergy => "diverged.energy",
        /// Momentum was made.
        DivergedMomentum => "diverged.momentum",
        /// Particles crowded.
        DivergedCrowded => "diverged.crowded",
        /// Area or volume of a phase was lost.
        DivergedPhaseLost => "diverged.phase_lost",
        /// Something is finer than the particles resolve.
        DivergedUnresolved => "diverged.unresolved",
        /// Particles left the region that the method knows.
        DivergedEscaped => "diverged.escaped",
        /// The worker died.
        WorkerCrash => "worker.crash",
        /// The worker gave no sign of life.
        WorkerStalled => "worker.stalled",
        /// A cluster took the node back.
        WorkerEvicted => "worker.evicted",
        /// The service restarted.
        ServerRestart => "server.restart",
        /// No checkpoint to go on from could be read.
        CheckpointNoneValid => "checkpoint.none_valid",
        /// The checkpoint belongs to another scene.
        CheckpointIncompatible => "checkpoint.incompatible",
        /// A job that this one waits for did not succeed.
        DependencyFailed => "dependency.failed",
        /// An input file is damaged.
        InputDamaged => "input.damaged",
        /// A bug in the program.
        Internal => "internal",
    }
}

/// The only transition table: (from, trigger, to).
pub const TRANSITIONS: &[(State, Trigger, State)] = &[
    (State::Queued, Trigger::Claim, State::Running),
    (State::Queued, Trigger::Cancel, State::Canceled),
    (State::Queued, Trigger::Pause, State::Paused),
    // The study that was to choose its spacing could not.
    (State::Queued, Trigger::Fail, State::Failed),
    (State::Paused, Trigger::Fail, State::Failed),
    (State::Paused, Trigger::Cancel, State::Canceled),
    (State::Paused, Trigger::Resume, State::Queued),
    (State::Running, Trigger::Miss, State::Queued),
    (State::Pausing, Trigger::Miss, State::Paused),
    (State::Canceling, Trigger::Miss, State::Canceled),
    (State::Running, Trigger::Finish, State::Succeeded),
    (State::Running, Trigger::Pause, State::Pausing),
    (State::Running, Trigger::Cancel, State::Canceling),
    (State::Running, Trigger::Fail, State::Failed),
    (State::Running, Trigger::Lose, State::Interrupted),
    (State::Pausing, Trigger::Rest, State::Paused),
    (State::Pausing, Trigger::Drain, State::Queued),
    (State::Pausing, Trigger::Cancel, State::Canceling),
    // The end may be reached while the request is on its way.
    (State::Pausing, Trigger::Finish, State::Succeeded),
    (State::Pausing, Trigger::Fail, State::Failed),
    (State::Pausing, Trigger::Lose, State::Interrupted),
    (State::Canceling, Trigger::Drop, State::Canceled),
    (State::Canceling, Trigger::Lose, State::Canceled),
    (State::Interrupted, Trigger::Requeue, State::Queued),
    (State::Interrupted, Trigger::Fail, State::Failed),
];

impl State {
    /// The state to which a trigger leads; None where the table has no such row.
    #[must_use]
    pub fn after(self, trigger: Trigger) -> Option<State> {
        TRANSITIONS.iter().find(|(from, on, _)| *from == self && *on == trigger).map(|(_, _, to)| *to)
    }

    /// Whether the state is never left.
    #[must_use]
    pub fn is_terminal(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Canceled)
    }

    /// Whether a worker should exist.
    #[must_use]
    pub fn has_worker(self) -> bool {
        matches!(self, Self::Running | Self::Pausing | Self::Canceling)
    }
}

impl From<Divergence> for Reason {
    fn from(divergence: Divergence) -> Self {
        match divergence {
            Divergence::Energy => Self::DivergedEnergy,
            Divergence::Momentum => Self::DivergedMomentum,
            Divergence::Crowded => Self::DivergedCrowded,
            Divergence::PhaseLost => Self::DivergedPhaseLost,
            Divergence::Unresolved => Self::DivergedUnresolved,
            Divergence::Unsolved => Self::DivergedUnsolved,
            Divergence::Escaped => Self::DivergedEscaped,
        }
    }
}

impl From<&StepError> for Reason {
    /// The reason of a run that a step ended; an interrupted step is canceled and has none.
    fn from(error: &StepError) -> Self {
        match error {
            StepError::CheckFailed { divergence, .. } => (*divergence).into(),
            StepError::Unresolved { .. } => Self::DivergedUnresolved,
            StepError::InterfaceLost { .. } => Self::DivergedInterface,
            StepError::TooFast { .. } => Self::DivergedCfl,
            StepError::TimeStepFloor { .. } => Self::DivergedDtFloor,
            StepError::Unsolved { .. } => Self::DivergedUnsolved,
            StepError::NonFinite { .. } | StepError::Undefined { .. } => Self::DivergedNonfinite,
            StepError::Interrupted => Self::UserCancel,
        }
    }
}

impl Reason {
    /// Whether the run itself could not go on: a check ended it, or numbers that do not exist.
    #[must_use]
    pub fn is_of_physics(self) -> bool {
        self.word().starts_with("diverged.")
    }

    /// What a user can do about it, where the job has no checkpoint to go on from.
    #[must_use]
    pub fn hint_without_checkpoint(self) -> &'static str {
        match self {
            Self::UserPause => {
                "paused on request before its first checkpoint; resumed, the job starts from the beginning"
            }
            Self::ServerRestart => {
                "the service stopped before the first checkpoint of the job; it starts from the beginning"
            }
            Self::WorkerEvicted => {
                "the cluster took the node back before the first checkpoint; the job starts from the beginning"
            }
            other => other.hint(),
        }
    }

    /// What a user can do about it.
    #[must_use]
    pub fn hint(self) -> &'static str {
        match self {
            Self::UserCancel => "canceled on request; submit the body again to run it anew",
            Self::UserPause => "paused on request; resume the job to go on from its last checkpoint",
            Self::LimitWalltime => "limits.wall_s is used up; resume the job to grant it once more",
            Self::LimitMemory => {
                "the worker outgrew limits.memory_bytes; raise it, or use a larger spacing or a narrower band"
            }
            Self::WorkerOom => {
                "the kernel ended the worker for lack of memory; run fewer jobs at once or lower limits.memory_bytes"
            }
            Self::LimitDisk => {
                "limits.disk_bytes is used up; restart from the last checkpoint with a higher limit or fewer frames"
            }
            Self::StorageEnospc => "the disk is full; the job resumes by itself when space is back",
            Self::StorageIo => "a file could not be read or written; the service's log names it",
            Self::DivergedNonfinite => {
                "a value stopped being finite; try a smaller time step, from the last checkpoint"
            }
            Self::DivergedCfl => {
                "particles became faster than sound; restart from the last checkpoint with the time step that the message names"
            }
            Self::DivergedDtFloor => {
                "the run asks for ever smaller steps; look at its last frames before anything else"
            }
            Self::DivergedInterface => "the interface vanished between the particles; try a smaller spacing",
            Self::DivergedUnsolved => {
                "equations were not solved as the scene asks; the message says what was left: points that lie more evenly, another solver, \
                 more iterations or a looser tolerance may do"
            }
            Self::DivergedEnergy => {
                "the run made energy out of nothing; the message has the numbers: a smaller time step or spacing may do"
            }
            Self::DivergedMomentum => {
                "the run made momentum out of nothing; the message has the numbers: a smaller time step or spacing may do"
            }
            Self::DivergedCrowded => {
                "particles crowded; the message has the numbers: the balanced force, a higher speed of sound or a finer spacing may do"
            }
            Self::DivergedPhaseLost => {
                "area or volume of a phase was lost; the message has the numbers: a smaller spacing may do"
            }
            Self::DivergedUnresolved => {
                "something became finer than the particles resolve; the message has the numbers: use a smaller spacing"
            }
            Self::DivergedEscaped => {
                "particles left the region that the method knows; the message names it: a larger domain or a smaller time step may do"
            }
            Self::WorkerEvicted => "the cluster took the node back; the job goes on from its last checkpoint",
            Self::DependencyFailed => "a job of `after` did not succeed; submit the body again once it has",
            Self::WorkerCrash => "the worker died; its log may say why",
            Self::WorkerStalled => "the worker gave no sign of life and was ended",
            Self::ServerRestart => "the service stopped while the job ran; it goes on from the last checkpoint",
            Self::CheckpointNoneValid => "no checkpoint to start from passed its checks",
            Self::CheckpointIncompatible => "the checkpoint is of another scene or another instruction set",
            Self::InputDamaged => "an input file did not pass its checks",
            Self::Internal => "a bug in the program; please report it with the job's log",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Reason, State, TRANSITIONS, Trigger};
    use meniscus::simulation::{Divergence, StepError};

    #[test]
    fn a_check_that_no_longer_holds_has_its_reason_and_numbers() {
        let (check, divergence, step, time) = ("kinetic_energy", Divergence::Energy, 7, 0.5);
        let error = StepError::CheckFailed { check, divergence, value: 2.0, limit: 1.5, step, time };
        assert_eq!(Reason::from(&error).word(), "diverged.energy");
        assert_eq!(error.to_string(), "kinetic_energy is 2.0000e0, its limit is 1.5000e0, at step 7, time 0.5");
    }

    #[test]
    fn terminal_states_are_never_left_and_every_state_is_reached() {
        for (from, _, _) in TRANSITIONS {
            assert!(!from.is_terminal(), "{from:?} is left");
        }
        for state in State::ALL {
            assert!(*state == State::Queued || TRANSITIONS.iter().any(|t| t.2 == *state), "{state:?}");
        }
    }

    #[test]
    fn every_state_that_lasts_can_be_canceled_and_every_worker_can_be_lost() {
        for state in State::ALL {
            if state.has_worker() {
                assert!(state.after(Trigger::Lose).is_some(), "{state:?}");
            }
            if matches!(state, State::Queued | State::Running | State::Pausing | State::Paused) {
                assert!(state.after(Trigger::Cancel).is_some(), "{state:?}");
            }
        }
    }

    #[test]
    fn one_row_a_state_and_trigger() {
        for (k, row) in TRANSITIONS.iter().enumerate() {
            assert!(TRANSITIONS[..k].iter().all(|other| (other.0, other.1) != (row.0, row.1)), "{row:?}");
        }
    }
}
