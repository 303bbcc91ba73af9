//! The checkpoint that a run begins with: opened under its digest, checked against the scene and the instruction set, loaded.

use crate::formats::checkpoint::{self, Meta};
use crate::spec::attempt_spec::{AttemptSpec, StartCheckpoint};
use meniscus::simulation::{LoadError, Section, Simulation};
use std::time::{Duration, Instant};

/// Time between two tries to read a checkpoint that another machine wrote.
const LATE_FILE_INTERVAL: Duration = Duration::from_millis(500);

/// Why a run does not begin with a checkpoint.
pub(super) enum Refusal {
    /// It is not whole.
    Damaged(String),
    /// It belongs to another scene, or to another instruction set.
    Incompatible(String),
}

/// Opens a checkpoint. One that another machine wrote may not be whole here yet: it is tried again for a while.
pub(super) fn open_when_there(
    spec: &AttemptSpec,
    candidate: &StartCheckpoint,
    began: Instant,
) -> Result<(Meta, Section), Refusal> {
    loop {
        match open_start(spec, candidate) {
            Err(Refusal::Damaged(_)) if began.elapsed().as_secs_f64() < spec.late_files_s => {
                std::thread::sleep(LATE_FILE_INTERVAL);
            }
            opened => return opened,
        }
    }
}

fn open_start(spec: &AttemptSpec, candidate: &StartCheckpoint) -> Result<(Meta, Section), Refusal> {
    let (meta, state) = checkpoint::read(&candidate.path, candidate.sha256.as_deref())
        .map_err(|error| Refusal::Damaged(error.to_string()))?;
    if !checkpoint::is_same_scene(&meta.body, &spec.body) {
        let message = "the checkpoint is of another scene: fields that are not restart-safe differ";
        return Err(Refusal::Incompatible(message.to_owned()));
    }
    let isa = crate::system::build::isa();
    if meta.isa != isa && !candidate.allow_other_isa {
        return Err(Refusal::Incompatible(format!(
            "the checkpoint was written on {}, this worker computes on {isa}",
            meta.isa
        )));
    }
    Ok((meta, state))
}

/// Brings a simulation to the state of a checkpoint.
pub(super) fn load(simulation: &mut dyn Simulation, meta: &Meta, state: Section) -> Result<(), LoadError> {
    let state = checkpoint::state_for(simulation, meta, state)?;
    simulation.load(&state)
}
