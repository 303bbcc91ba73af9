//! The service: store, supervisor, executors, uploads, studies, upkeep of the data directory.

pub mod backup;
pub mod data_directory;
pub mod executor;
pub mod found_folders;
pub mod fsck;
pub mod growing_pause;
pub mod inspector;
pub mod refinement;
pub mod shared_directory;
pub mod accuracy;
pub mod store;
pub mod study_report;
pub mod study_table;
pub mod supervisor;
