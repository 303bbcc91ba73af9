//! Two-phase flow by weakly compressible SPH with surface tension (PCP, sections 4.3 and 4.4, appendix B).
//!
//! Particles belong to a [`Species`]; the equations of motion are made of `interactions`, one item a term. Within an
//! evaluation data flows one way: positions → neighbor lists → interface → densities and pressures → rates.
//!
//! | concept | files |
//! | --- | --- |
//! | configuration | [`config`], [`level_update`], [`species`], [`fluids`], `kernel_choice` |
//! | the flow and its rates | `flow_state` |
//! | sums over pairs | `neighbor_lists`, `pair_workspace`, `pair_sums`, `column` |
//! | terms of the equations | `interactions` |
//! | equations that combine the terms | `equations`: `volume_form`, `mass_form` or `dcpse` |
//! | the interface and what it encloses | `interface`, `smoothed_delta`, `droplets`, `strays` |
//! | a tension that varies | [`tension_law`], `varying_tension`, `surfactant`, `tension_record`, `migration` |
//! | one evaluation | `system` |
//! | steps in time | `stepping`, [`time_step`] |
//! | walls | [`walls`], [`steady_flow`], `wall_record` |
//! | what a run watches | `budget`, `checks`, `guard` |
//! | the simulation and what it shows | `simulation`, `start`, `saved_state`, `fastest`, `diagnostics`, `pacing`, `frame_fields`, `quantities`, `monitors`, `summary` |

mod budget;
mod checks;
mod column;
pub mod config;
mod dcpse;
mod diagnostics;
pub mod dimensionless;
mod droplets;
mod energy_rise;
mod equations;
mod fastest;
mod flow_state;
pub mod fluids;
mod format_1;
pub mod frame_fields;
mod guard;
mod interactions;
mod interface;
mod kernel_choice;
pub mod level_update;
mod mass_form;
pub mod mean_shear;
mod migration;
mod monitors;
mod neighbor_lists;
mod pacing;
mod pair_sums;
mod pair_workspace;
pub mod quantities;
mod pressures;
mod saved_state;
mod shear_record;
mod simulation;
mod sliding;
pub mod species;
mod smoothed_delta;
mod standing_wave;
mod start;
pub mod steady_flow;
mod stepping;
mod strays;
mod summary;
mod surfactant;
mod system;
pub mod tension_law;
mod tension_record;
pub mod time_step;
mod varying_tension;
mod volume_form;
pub mod walls;
mod wall_record;
mod wave_record;

pub use config::{
    DensityMethod, Discretization, Geometry, Integrator, PressureConfig, PressureForm, SphConfig, Volumes,
};
pub use droplets::ball_curvature;
pub use fluids::Fluid;
pub use interactions::{BodyForce, FormulaForce, TensionForce};
pub use kernel_choice::KernelChoice;
pub use level_update::LevelUpdate;
pub use mean_shear::MeanShear;
pub use pacing::measurement_interval;
pub use simulation::WeaklyCompressibleSph;
pub use species::{Fluids, Species};
pub use standing_wave::StandingWave;
pub use surfactant::RADIUS_H as EXCHANGE_RADIUS_H;
pub use system::{Drop, SphSystem};
pub use tension_law::{EquationOfState, SurfactantConfig, TensionLaw};

#[cfg(test)]
mod test_setting;
