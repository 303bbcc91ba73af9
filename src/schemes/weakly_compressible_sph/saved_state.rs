//! The state of the two fluids in a checkpoint.

use super::interface::LevelSet;
use super::interface::level_set::Sides;
use super::species::Species;
use super::system::SphSystem;
use crate::closest_point::FitDiagnostics;
use crate::operators::SupportDiagnostics;
use crate::simulation::components::{check_particles, load_particles, save_particles};
use crate::simulation::section::{copy_vectors, known};
use crate::simulation::{LoadError, Section};

impl<const D: usize> SphSystem<D> {
    /// Saves everything that the next evaluation depends on.
    pub(super) fn save(&self, state: &mut Section) {
        state.put_section("pressure", |section| {
            section.put_real("calibration", self.flow.calibration);
            section.put_real("background", self.flow.background);
            if self.walls.is_some() || self.config.mean_shear.is_some() {
                section.put_real("viscosity_factor", self.flow.viscosity_factor);
            }
            section.put_reals("last_volume", &self.flow.last_volume);
        });
        state.put_section("particles", |section| {
            save_particles(&self.particles, section);
            section.put_counts("phase", self.flow.species.iter().map(|species| u64::from(species.code())));
            section.put_vectors("velocity", &self.flow.velocity);
            section.put_vectors("acceleration", &self.rates.acceleration);
            section.put_vectors("reference", self.pairs.lists.reference());
            if let Some(time) = self.pairs.lists.listed_at() {
                section.put_real("listed_at", time);
            }
            section.put_reals("density", &self.flow.density);
            section.put_reals("density_rate", &self.rates.density);
        });
        state.put_section("droplets", |section| {
            section.put_flags("droplet", &self.droplets.label);
            section.put_reals("ball_curvatures", &self.droplets.ball_curvatures);
            if self.walls.is_some() {
                section.put_reals("contacts", &self.droplets.saved_contacts());
            }
            section.put_optional("initial_measure", known(self.droplets.initial_measure));
        });
        if let Some(level_set) = self.interface.level_set() {
            state.put_section("interface", |section| {
                section.put_component("redistancing", level_set.surface.fit_diagnostics());
                section.put_count("bounded_curvatures", level_set.bounded);
                section.put_flags("candidate", &level_set.is_candidate);
                section.put_count("is_begun", u64::from(level_set.is_begun));
                section.put_counts("sides", [level_set.sides.near, level_set.sides.wrong]);
            });
        }
        if let Some(flow) = self.equations.fits() {
            state.put_component("flow_fits", &flow.fit_diagnostics);
        }
        state.put_count("absorbed_strays", self.strays.absorbed);
        state.put_real("lost_particles", self.strays.lost as f64);
        state.put_count("waiting_strays", self.strays.waiting);
    }

    /// Loads a state of this scene.
    ///
    /// # Errors
    /// [`LoadError`] where it is of another scene; nothing is changed then.
    pub(super) fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        // 1. Everything is read, and checked against this scene.
        let interface = match self.interface.level_set() {
            Some(level_set) => Some(state.section("interface", |section| load_interface(level_set, section))?),
            None => None,
        };
        let flow_fits: Option<SupportDiagnostics> = match self.equations.fits() {
            Some(_) => Some(state.component("flow_fits")?),
            None => None,
        };
        let species = state.section("particles", species_of)?;
        let absorbed = state.count("absorbed_strays")?;
        // Version 0.2.0 had none of these.
        let lost = if state.has("lost_particles") { state.real("lost_particles")? as i64 } else { 0 };
        let waiting = if state.has("waiting_strays") { state.count("waiting_strays")? } else { 0 };
        let (calibration, viscosity_factor, background, last_volume) = match state.has("pressure") {
            true => state.section("pressure", |section| {
                let last_volume = section.reals_of("last_volume", self.flow.last_volume.len())?.to_vec();
                // Before there were walls, none was found.
                let factor = if section.has("viscosity_factor") { section.real("viscosity_factor")? } else { 1.0 };
                Ok((section.real("calibration")?, factor, section.real("background")?, last_volume))
            })?,
            false => (1.0, 1.0, 0.0, Vec::new()),
        };
        state.section("particles", |section| check_columns(self, section))?;
        state.section("droplets", |section| check_droplets(self, section))?;
        // 2. From here on nothing fails.
        state.section("particles", |section| load_columns(self, section))?;
        state.section("droplets", |section| load_droplets(self, section))?;
        self.flow.species = species;
        (self.flow.calibration, self.flow.viscosity_factor, self.flow.background) =
            (calibration, viscosity_factor, background);
        self.flow.last_volume = last_volume;
        if let (Some((diagnostics, bounded, candidates, repair)), Some(level_set)) =
            (interface, self.interface.level_set_mut())
        {
            (level_set.is_begun, level_set.sides) = repair;
            *level_set.surface.fit_diagnostics_mut() = diagnostics;
            level_set.bounded = bounded;
            copy_flags(candidates, &mut level_set.is_candidate);
        }
        if let (Some(soundness), Some(flow)) = (flow_fits, self.equations.fits_mut()) {
            flow.fit_diagnostics = soundness;
        }
        (self.strays.absorbed, self.strays.lost, self.strays.waiting) = (absorbed, lost, waiting);
        Ok(())
    }
}

/// The soundness of fits, the bounded curvatures, the candidates, whether the carried level was repaired, and the sides.
type LoadedInterface<'a> = (FitDiagnostics, u64, &'a [u64], (bool, Sides));

/// Reads the interface of a state.
fn load_interface<'a, const D: usize>(
    level_set: &LevelSet<D>,
    section: &'a Section,
) -> Result<LoadedInterface<'a>, LoadError> {
    let candidates = section.counts_of("candidate", level_set.is_candidate.len())?;
    // Version 0.2.0 repaired no level.
    let repair = match section.has("sides") {
        true => {
            let sides = section.counts_of("sides", 2)?;
            (section.count("is_begun")? == 1, Sides { near: sides[0], wrong: sides[1] })
        }
        false => (true, Sides::default()),
    };
    Ok((section.component("redistancing")?, section.count("bounded_curvatures")?, candidates, repair))
}

/// The species of all particles.
fn species_of(section: &Section) -> Result<Vec<Species>, LoadError> {
    let unknown = || LoadError::Kind { name: "phase".to_owned(), expected: "0 or 1 everywhere" };
    section.counts("phase")?.iter().map(|code| Species::from_code(*code).ok_or_else(unknown)).collect()
}

/// Checks the columns of particles against this scene.
fn check_columns<const D: usize>(system: &SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    let count = system.flow.count();
    check_particles(&system.particles, section)?;
    section.counts_of("phase", count)?;
    for name in ["velocity", "acceleration", "reference"] {
        section.reals_of(name, count * D)?;
    }
    if system.config.mean_shear.is_some() {
        section.real("listed_at")?;
    }
    section.reals_of("density", count)?;
    section.reals_of("density_rate", system.rates.density.len())?;
    Ok(())
}

/// Loads the columns of particles, as they were checked.
fn load_columns<const D: usize>(system: &mut SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    load_particles(&mut system.particles, section)?;
    copy_vectors(section.reals("velocity")?, &mut system.flow.velocity);
    copy_vectors(section.reals("acceleration")?, &mut system.rates.acceleration);
    copy_vectors(section.reals("reference")?, system.pairs.lists.reference_mut());
    if system.config.mean_shear.is_some() {
        system.pairs.lists.return_to(section.real("listed_at")?);
    }
    system.flow.density.copy_from_slice(section.reals("density")?);
    system.rates.density.copy_from_slice(section.reals("density_rate")?);
    Ok(())
}

/// Checks which particle belongs to which droplet.
fn check_droplets<const D: usize>(system: &SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    section.counts_of("droplet", system.droplets.label.len())?;
    section.reals("ball_curvatures")?;
    if section.has("contacts") {
        section.reals("contacts")?;
    }
    section.optional("initial_measure").map(|_| ())
}

/// Loads which particle belongs to which droplet, as it was checked.
fn load_droplets<const D: usize>(system: &mut SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    copy_flags(section.counts("droplet")?, &mut system.droplets.label);
    system.droplets.ball_curvatures = section.reals("ball_curvatures")?.to_vec();
    if section.has("contacts") {
        system.droplets.load_contacts(section.reals("contacts")?);
    }
    system.droplets.initial_measure = section.optional("initial_measure")?.unwrap_or(f64::NAN);
    Ok(())
}

fn copy_flags(from: &[u64], to: &mut [u8]) {
    for (flag, count) in to.iter_mut().zip(from) {
        *flag = (*count).min(255) as u8;
    }
}
