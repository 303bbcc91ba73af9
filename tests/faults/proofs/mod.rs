//! The promises, each as a function of how often it is to be tried and of a seed. A proof panics where a promise is
//! broken, and says what it measured.

pub mod cancels;
pub mod checkpoints;
pub mod clients;
pub mod directories;
pub mod files;
pub mod kills;
pub mod machine;
pub mod moments;
pub mod parsers;

/// A promise.
#[expect(dead_code, reason = "the tests use one number, the soak the others")]
pub struct Proof {
    /// Name, for the soak's totals.
    pub name: &'static str,
    /// Tries in `make test`.
    pub quick: u64,
    /// Tries that show it.
    pub full: u64,
    /// Tries that belong together in a soak: one service, one undisturbed run to compare with.
    pub batch: u64,
    /// Tries it so often from a seed; says what was measured.
    pub run: fn(count: u64, seed: u64) -> String,
}

/// All of them.
pub static PROOFS: &[Proof] = &[
    Proof { name: "kills_of_the_service", quick: 20, full: 1000, batch: 50, run: kills::of_the_service },
    Proof { name: "kills_of_workers", quick: 20, full: 1000, batch: 50, run: kills::of_workers },
    Proof { name: "kills_of_a_refinement", quick: 12, full: 1000, batch: 50, run: kills::of_a_refinement },
    Proof {
        name: "kills_between_operations_of_a_checkpoint",
        quick: 14,
        full: 140,
        batch: 14,
        run: checkpoints::kills_between_operations,
    },
    Proof { name: "truncated_checkpoints", quick: 20, full: 1000, batch: 250, run: checkpoints::truncations },
    Proof {
        name: "flipped_bits_of_checkpoints",
        quick: 200,
        full: 10_000,
        batch: 2500,
        run: checkpoints::flipped_bits,
    },
    Proof { name: "damaged_newest_checkpoint", quick: 4, full: 100, batch: 10, run: checkpoints::fall_back },
    Proof { name: "full_disk_at_every_write", quick: 6, full: 100, batch: 10, run: machine::full_disk },
    Proof { name: "memory_limit", quick: 2, full: 20, batch: 5, run: machine::memory_limit },
    Proof { name: "stalled_workers", quick: 1, full: 20, batch: 2, run: machine::stalled_workers },
    Proof { name: "steps_of_the_clock", quick: 20, full: 1000, batch: 100, run: machine::clock_steps },
    Proof { name: "event_streams", quick: 100, full: 500, batch: 500, run: clients::event_streams },
    Proof { name: "cuts_in_a_download", quick: 20, full: 200, batch: 20, run: clients::cut_downloads },
    Proof { name: "one_key_one_job", quick: 100, full: 1000, batch: 100, run: clients::one_key },
    Proof { name: "cancels", quick: 20, full: 1000, batch: 100, run: cancels::prompt },
    Proof { name: "lost_databases", quick: 4, full: 200, batch: 20, run: directories::lost_databases },
    Proof { name: "foreign_folders", quick: 4, full: 200, batch: 50, run: directories::foreign_folders },
    Proof { name: "descriptor_shortage", quick: 2, full: 50, batch: 10, run: machine::descriptor_shortage },
    Proof { name: "requests_at_random_moments", quick: 4, full: 20, batch: 20, run: moments::of_every_scene },
    Proof { name: "mutated_scenes", quick: 20_000, full: 1_000_000, batch: 100_000, run: parsers::scenes },
    Proof { name: "mutated_bodies_of_studies", quick: 5_000, full: 1_000_000, batch: 100_000, run: parsers::studies },
    Proof { name: "mutated_structures", quick: 20_000, full: 1_000_000, batch: 100_000, run: parsers::structures },
    Proof { name: "mutated_meshes", quick: 20_000, full: 1_000_000, batch: 100_000, run: parsers::meshes },
    Proof { name: "mutated_files_through_the_reader", quick: 100, full: 10_000, batch: 1000, run: files::mutated },
];
