//! Every proof a few times.

use crate::proofs::PROOFS;
use crate::support::seed;

macro_rules! quick {
    ($($name:ident),* $(,)?) => {
        $(#[test]
        fn $name() {
            let proof = PROOFS.iter().find(|proof| proof.name == stringify!($name)).unwrap();
            println!("{}: {}", proof.name, (proof.run)(proof.quick, seed()));
        })*

        #[test]
        fn every_proof_has_its_test() {
            let names = [$(stringify!($name)),*];
            assert!(PROOFS.iter().all(|proof| names.contains(&proof.name)));
        }
    };
}

quick!(
    kills_of_the_service,
    kills_of_workers,
    kills_of_a_refinement,
    kills_between_operations_of_a_checkpoint,
    truncated_checkpoints,
    flipped_bits_of_checkpoints,
    damaged_newest_checkpoint,
    full_disk_at_every_write,
    memory_limit,
    stalled_workers,
    steps_of_the_clock,
    event_streams,
    cuts_in_a_download,
    one_key_one_job,
    cancels,
    requests_at_random_moments,
    lost_databases,
    foreign_folders,
    descriptor_shortage,
    mutated_scenes,
    mutated_bodies_of_studies,
    mutated_structures,
    mutated_meshes,
    mutated_files_through_the_reader,
);
