//! The interface as the zero of a level set that particles carry, redistanced at every evaluation.
//!
//! The fits find φ, the signed distance from the zero of the carried level ψ. What becomes of ψ then:
//!
//! - *overwrite*: ψ = φ (PCP section 4.3). Each fit has an error that depends on the arrangement of the particles, and the
//!   next one starts from it: the level creeps relative to its particles, and surface tension pays for it.
//! - *transparent*: ψ ← ψ + ω (φ + (2S − S²)[ψ − φ] − ψ) with the surface filter S. Long waves of the interface move with
//!   the particles alone; short waves and slopes |∇ψ| ≠ 1 are repaired.
//!
//! Only particles near the interface take part, the candidates. They are selected when neighbors are listed, with a margin
//! that covers the motion of particles until the next selection.

use super::InterfaceError;
use super::extension::Extension;
use super::surface_filter::{CURVATURE, LEVEL, Place, SurfaceFilter, share_across};
use crate::closest_point::{ClosestPoints, LevelSurface, PcpMethod, Redistancing, SurfaceColumns};
use crate::geometry::{Domain, Vector};
use crate::neighbors::CellList;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::{Particles, ScalarKey};
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::schemes::weakly_compressible_sph::droplets::Droplets;
use crate::schemes::weakly_compressible_sph::level_update::LevelUpdate;
use crate::simulation::Phases;

/// Constants of the selection.
struct Tuning {
    /// Distance in h beyond band and fits up to which particles are candidates: more than neighbors move towards each other
    /// between two selections, which is the skin of the neighbor lists.
    margin: f64,
    /// A particle within this distance of the interface, in h, marks its cell and the neighboring cells.
    near: f64,
    /// Distance in h beyond which a carried level is repaired at once: such particles take part in no fit.
    repaired_beyond: f64,
    /// Level in h of a particle whose repaired level would lie on the other side: no particle changes side.
    least_level: f64,
    /// The largest shift in h of a whole interface in the time of repair.
    largest_shift: f64,
    /// Distance in h within which sides are compared.
    sides_within: f64,
    /// Distance in h from the fitted surface up to which a particle may lie on the other side.
    sides_slack: f64,
}

const TUNING: Tuning = Tuning {
    margin: 1.0,
    near: 2.0,
    repaired_beyond: 4.5,
    least_level: 1e-6,
    largest_shift: 1e-5,
    sides_within: 1.5,
    sides_slack: 0.05,
};

/// Distance from the surface up to which particles are candidates, for fits and a band of half a width.
pub fn reach<const D: usize>(method: &PcpMethod, half_band: f64, spacing: f64) -> f64 {
    half_band.max(method.fit_band_h::<D>() * spacing) + TUNING.margin * spacing
}

/// How a level set treats the level and the curvature that it finds.
#[derive(Debug, Clone, Copy)]
pub struct LevelSetConfig {
    /// The spacing h.
    pub spacing: f64,
    /// Particles closer than this are in the band.
    pub half_band: f64,
    /// What becomes of the carried level.
    pub update: LevelUpdate,
    /// Radius of the filter of the curvature.
    pub curvature_filter: Option<f64>,
    /// The time ½ √(ρh³/(2πτ)) in which a share of a deviation is repaired.
    pub repair_time: f64,
}

/// What an answer depends on.
#[derive(Debug, Clone, Copy)]
pub struct Answering<'a, const D: usize> {
    /// Whether candidates were selected for this evaluation.
    pub is_selection: bool,
    /// Time since the last evaluation, 0 for the first.
    pub elapsed: f64,
    /// The droplets, each of which keeps its area or volume.
    pub droplets: &'a Droplets<D>,
}

/// The surface and the particles near it.
#[derive(Debug)]
pub struct LevelSet<const D: usize> {
    pub surface: LevelSurface<D>,
    config: LevelSetConfig,
    /// The level ψ that particles carry; the column of φ itself where it is overwritten.
    carried: ScalarKey,
    /// Whether ψ was repaired before: the first repair is complete.
    pub is_begun: bool,
    filter: SurfaceFilter<D>,
    places: Vec<Place<D>>,
    /// The particles of the places.
    placed: Vec<usize>,
    smoothed: Vec<[f64; 2]>,
    /// Changes of the carried level at the places.
    changes: Vec<f64>,
    /// Weights and weighted changes of each droplet.
    means: Vec<(f64, f64)>,
    /// Particles next to the interface, and those of them on the wrong side of the fits, at the last evaluation.
    pub sides: Sides,
    /// Distance from the surface up to which particles are candidates.
    keep: f64,
    cells: CellList<D>,
    marks: Vec<u8>,
    before: Vec<u8>,
    /// 1 for candidates, one entry a particle.
    pub is_candidate: Vec<u8>,
    candidates: Vec<usize>,
    positions: Vec<Vector<D>>,
    level: Vec<f64>,
    normals: Vec<Vector<D>>,
    answers: ClosestPoints<D>,
    /// Curvatures that were bounded to 1/h up to now.
    pub bounded: u64,
}

impl<const D: usize> LevelSet<D> {
    /// The level set that particles carry in the column of φ.
    pub fn new(
        method: PcpMethod,
        domain: &Domain<D>,
        config: LevelSetConfig,
        particles: &mut Particles<D>,
        columns: &SurfaceColumns,
    ) -> Self {
        let (spacing, count) = (config.spacing, particles.len());
        let keep = reach::<D>(&method, config.half_band, spacing);
        let carried = match config.update {
            LevelUpdate::Overwrite => columns.phi,
            LevelUpdate::Transparent { .. } => {
                let carried = particles.add_scalar("carried_level", 0.0);
                let level = particles.scalar(columns.phi).to_vec();
                particles.scalar_mut(carried).copy_from_slice(&level);
                carried
            }
        };
        Self {
            surface: LevelSurface::Spatial(Box::new(Redistancing::new(method, domain.clone(), spacing))),
            config,
            carried,
            is_begun: false,
            filter: SurfaceFilter::new(domain.clone()),
            places: Vec::new(),
            placed: Vec::new(),
            smoothed: Vec::new(),
            changes: Vec::new(),
            means: Vec::new(),
            sides: Sides::default(),
            keep,
            cells: CellList::new(domain.clone()),
            marks: Vec::new(),
            before: Vec::new(),
            is_candidate: vec![0; count],
            candidates: Vec::new(),
            positions: Vec::new(),
            level: Vec::new(),
            normals: Vec::new(),
            answers: ClosestPoints::default(),
            bounded: 0,
        }
    }

    /// The particles near the surface, in their order.
    pub fn candidates(&self) -> &[usize] {
        &self.candidates
    }

    /// The level ψ that particles carry.
    pub fn carried(&self) -> ScalarKey {
        self.carried
    }

    /// Replaces the domain, before the surface is fitted anew.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        if let LevelSurface::Spatial(surface) = &mut self.surface {
            surface.set_domain(domain);
        }
        self.filter.set_domain(domain);
        self.cells.set_domain(domain);
    }

    /// Distance from the surface up to which particles are candidates.
    pub fn keep(&self) -> f64 {
        self.keep
    }

    /// Selects candidates, too many at first; [`Self::answer`] then keeps those that are near.
    ///
    /// A cell is as wide as the distance of candidates, so each candidate lies in or next to a cell with a particle at the
    /// surface.
    pub fn select(&mut self, particles: &Particles<D>, columns: &SurfaceColumns) {
        let (positions, phi) = (particles.positions(), particles.scalar(columns.phi));
        let near = TUNING.near * self.config.spacing;
        self.cells.rebuild(positions.iter().copied(), self.keep + near);
        let (starts, order) = (self.cells.starts(), self.cells.permutation());
        self.marks.clear();
        self.marks.extend(
            starts.windows(2).map(|ends| u8::from(order[ends[0]..ends[1]].iter().any(|i| phi[*i].abs() <= near))),
        );
        self.cells.spread_marks(&mut self.marks, &mut self.before);
        self.is_candidate.fill(0);
        for (cell, mark) in self.marks.iter().enumerate() {
            if *mark != 0 {
                for i in &order[starts[cell]..starts[cell + 1]] {
                    self.is_candidate[*i] = 1;
                }
            }
        }
        self.list_candidates();
    }

    /// Lists the candidates by their flags.
    pub fn list_candidates(&mut self) {
        self.candidates.clear();
        self.candidates.extend((0..self.is_candidate.len()).filter(|i| self.is_candidate[*i] == 1));
    }

    /// Fits the surface to the level that the candidates carry, and to its extension behind walls.
    pub fn rebuild(
        &mut self,
        particles: &Particles<D>,
        columns: &SurfaceColumns,
        extension: Option<&Extension<D>>,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), InterfaceError> {
        let (level, normal) = (particles.scalar(self.carried), particles.vector(columns.normal));
        self.level.clear();
        self.level.extend(self.candidates.iter().map(|i| level[*i]));
        self.normals.clear();
        self.normals.extend(self.candidates.iter().map(|i| normal[*i]));
        self.gather(particles);
        if let Some(Extension { positions, level, normals }) = extension {
            self.positions.extend_from_slice(positions);
            self.level.extend_from_slice(level);
            self.normals.extend_from_slice(normals);
        }
        let normals = Some(self.normals.as_slice());
        rebuild(&mut self.surface, &self.positions, &self.level, normals, interrupt, phases)?;
        if self.surface.is_lost() { Err(InterfaceError::Lost) } else { Ok(()) }
    }

    fn gather(&mut self, particles: &Particles<D>) {
        let positions = particles.positions();
        self.positions.clear();
        self.positions.extend(self.candidates.iter().map(|i| positions[*i]));
    }

    /// Finds closest points of the candidates at their present positions, which may differ from those of the fits. After a
    /// selection only particles that are near stay candidates.
    pub fn answer(
        &mut self,
        particles: &mut Particles<D>,
        columns: &SurfaceColumns,
        answering: Answering<'_, D>,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), Interrupted> {
        self.gather(particles);
        query(&self.surface, &self.positions, self.keep, &mut self.answers, interrupt, phases)?;
        phases.measure("redistancing/store", || self.store(particles, columns, answering.is_selection));
        phases.measure("redistancing/filter", || {
            self.filter_curvature(particles, columns, interrupt)?;
            self.repair_level(particles, answering, interrupt)
        })?;
        self.is_begun = true;
        if answering.is_selection {
            self.list_candidates();
        }
        Ok(())
    }

    /// Writes closest points, distances, normals and curvatures to the particles.
    fn store(&mut self, particles: &mut Particles<D>, columns: &SurfaceColumns, is_selection: bool) {
        particles.flag_mut(columns.in_band).fill(0);
        if is_selection {
            self.is_candidate.fill(0);
        }
        let spacing = self.config.spacing;
        let steepest = 1.0 / spacing;
        self.sides = Sides::default();
        self.places.clear();
        self.placed.clear();
        for (k, answer) in self.answers.iter() {
            let (i, level) = (self.candidates[k], self.level[k]);
            if is_selection {
                self.is_candidate[i] = 1;
            }
            // No particle changes side. A particle whose closest point is a mere sample keeps the level that it carries.
            let phi = if answer.is_sample { level } else { answer.distance.copysign(level) };
            particles.vector_mut(columns.closest_point)[i] = answer.point;
            particles.vector_mut(columns.normal)[i] = answer.normal;
            let curvature = answer.curvature.clamp(-steepest, steepest);
            self.bounded += u64::from(curvature.to_bits() != answer.curvature.to_bits());
            particles.scalar_mut(columns.curvature)[i] = curvature;
            particles.flag_mut(columns.in_band)[i] = u8::from(answer.distance <= self.config.half_band);
            if answer.distance < TUNING.sides_within * spacing && !answer.is_sample {
                let is_wrong = answer.is_outside == (level < 0.0) && answer.distance > TUNING.sides_slack * spacing;
                self.sides.near += 1;
                self.sides.wrong += u64::from(is_wrong);
            }
            // Shifted particles have taken the level of their new place since the fits.
            let carried = particles.scalar(self.carried)[i];
            let deviation = if answer.is_sample { f64::NAN } else { carried - phi };
            particles.scalar_mut(columns.phi)[i] = phi;
            let values = [deviation, curvature];
            let sample = self.answers.nearest_sample(k);
            self.places.push(Place { foot: answer.point, sample, normal: answer.normal, distance: phi, values });
            self.placed.push(i);
        }
    }

    /// Replaces the curvatures by (2S − S²)[κ], where the configuration asks for it.
    fn filter_curvature(
        &mut self,
        particles: &mut Particles<D>,
        columns: &SurfaceColumns,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let Some(radius) = self.config.curvature_filter else { return Ok(()) };
        self.filter.smooth(&self.places, self.config.spacing, radius, &mut self.smoothed, interrupt)?;
        let curvature = particles.scalar_mut(columns.curvature);
        for (i, smoothed) in self.placed.iter().zip(&self.smoothed) {
            if smoothed[CURVATURE].is_finite() {
                curvature[*i] = smoothed[CURVATURE];
            }
        }
        Ok(())
    }

    /// Repairs the level that particles carry, where it is not overwritten.
    fn repair_level(
        &mut self,
        particles: &mut Particles<D>,
        Answering { elapsed, droplets, .. }: Answering<'_, D>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let LevelUpdate::Transparent { relaxation, radius } = self.config.update else { return Ok(()) };
        if self.config.curvature_filter != Some(radius) {
            self.filter.smooth(&self.places, self.config.spacing, radius, &mut self.smoothed, interrupt)?;
        }
        let share = 1.0 - (1.0 - relaxation).powf(elapsed / self.config.repair_time);
        self.find_changes(share, particles.scalar(self.carried));
        if self.is_begun {
            self.keep_enclosed_measure(droplets, elapsed);
        }
        let least = TUNING.least_level * self.config.spacing;
        let level = particles.scalar_mut(self.carried);
        for (i, change) in self.placed.iter().zip(&self.changes) {
            let side = 1.0_f64.copysign(level[*i]);
            let repaired = level[*i] + change;
            level[*i] = if repaired * side > 0.0 { repaired } else { side * least };
        }
        Ok(())
    }

    /// Sets `changes` to ω (φ + (2S − S²)[ψ − φ] − ψ) at each place; 0 where φ is not known.
    fn find_changes(&mut self, share: f64, level: &[f64]) {
        let beyond = TUNING.repaired_beyond * self.config.spacing;
        self.changes.clear();
        let places = self.placed.iter().zip(&self.places).zip(&self.smoothed);
        self.changes.extend(places.map(|((i, place), smoothed)| {
            if place.values[LEVEL].is_nan() {
                return 0.0;
            }
            let kept = if self.is_begun && smoothed[LEVEL].is_finite() { smoothed[LEVEL] } else { 0.0 };
            let share = if !self.is_begun || place.distance.abs() > beyond { 1.0 } else { share };
            share * (place.distance + kept - level[*i])
        }));
    }

    /// Takes the mean over each droplet's interface out of the changes: a repair does not move the interface as a whole.
    /// Without it a drop at rest loses 4e-4 of its area in 24,000 steps (measured at R = 8 h). Where drops merge the mean is
    /// large for other reasons, so it is bounded.
    fn keep_enclosed_measure(&mut self, droplets: &Droplets<D>, elapsed: f64) {
        let most = TUNING.largest_shift * self.config.spacing * elapsed / self.config.repair_time;
        let spacing = self.config.spacing;
        self.means.clear();
        self.means.resize(droplets.groups(), (0.0, 0.0));
        for ((i, place), change) in self.placed.iter().zip(&self.places).zip(&self.changes) {
            let weight = share_across(place.distance, spacing);
            if !place.values[LEVEL].is_nan() {
                let (all, sum) = &mut self.means[droplets.group(*i)];
                *all += weight;
                *sum += weight * change;
            }
        }
        for ((i, place), change) in self.placed.iter().zip(&self.places).zip(&mut self.changes) {
            let (all, sum) = self.means[droplets.group(*i)];
            if all > 0.0 && place.distance.abs() <= TUNING.repaired_beyond * spacing {
                *change -= (sum / all).clamp(-most, most);
            }
        }
    }
}

/// Particles next to the interface, and those of them that lie on the wrong side of it by the fits.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sides {
    /// Particles within 1.5 h of the interface.
    pub near: u64,
    /// Those whose side by the normal of the fits is not that of their species.
    pub wrong: u64,
}

impl Sides {
    /// Share of particles on the wrong side; 0 without particles.
    #[must_use]
    pub fn wrong_share(&self) -> f64 {
        self.wrong as f64 / self.near.max(1) as f64
    }
}
