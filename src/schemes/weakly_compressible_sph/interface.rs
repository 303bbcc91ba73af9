//! The interface as the zero of a level set that particles carry, redistanced at every evaluation.
//!
//! Only particles near it take part: they are selected when neighbours are, with a margin that covers what anybody moves
//! until the next time.

use crate::closest_point::{ClosestPoints, LevelSurface, PcpMethod, Redistancing, SurfaceColumns};
use crate::geometry::{Domain, Vector};
use crate::neighbors::CellList;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::Phases;

/// Beyond band and fits, in h: more than neighbours move towards each other between two selections.
const MARGIN_H: f64 = 1.0;
/// Within so many h a particle counts as next to the surface when others are selected.
const NEAR_H: f64 = 2.0;

/// The surface and the particles near it.
#[derive(Debug)]
pub(super) struct Interface<const D: usize> {
    pub surface: LevelSurface<D>,
    spacing: f64,
    half_band: f64,
    /// How far from the surface particles are kept.
    keep: f64,
    cells: CellList<D>,
    marks: Vec<u8>,
    before: Vec<u8>,
    candidates: Vec<usize>,
    positions: Vec<Vector<D>>,
    level: Vec<f64>,
    normals: Vec<Vector<D>>,
    answers: ClosestPoints<D>,
    /// Curvatures that were cut to 1/h.
    pub bounded: u64,
}

impl<const D: usize> Interface<D> {
    pub fn new(method: PcpMethod, domain: &Domain<D>, spacing: f64, half_band: f64) -> Self {
        let keep = half_band.max(method.fit_band_h::<D>() * spacing) + MARGIN_H * spacing;
        Self {
            surface: LevelSurface::Spatial(Box::new(Redistancing::new(method, domain.clone(), spacing))),
            spacing,
            half_band,
            keep,
            cells: CellList::new(domain.clone()),
            marks: Vec::new(),
            before: Vec::new(),
            candidates: Vec::new(),
            positions: Vec::new(),
            level: Vec::new(),
            normals: Vec::new(),
            answers: ClosestPoints::default(),
            bounded: 0,
        }
    }

    /// Who is near, in the order of particles.
    pub fn candidates(&self) -> &[usize] {
        &self.candidates
    }

    /// How far from the surface particles are kept.
    pub fn keep(&self) -> f64 {
        self.keep
    }

    /// Marks everybody who may be near; the next answers tell who is.
    ///
    /// Cells as wide as what is kept: who is near lies in a cell next to one with a particle at the surface.
    pub fn select(&mut self, particles: &Particles<D>, columns: &SurfaceColumns, flags: &mut [u8]) {
        let (positions, phi) = (particles.positions(), particles.scalar(columns.phi));
        self.cells.rebuild(positions.iter().copied(), self.keep + NEAR_H * self.spacing);
        let (starts, order) = (self.cells.starts(), self.cells.permutation());
        let near = NEAR_H * self.spacing;
        self.marks.clear();
        self.marks.extend(
            starts.windows(2).map(|ends| u8::from(order[ends[0]..ends[1]].iter().any(|i| phi[*i].abs() <= near))),
        );
        self.cells.spread_marks(&mut self.marks, &mut self.before);
        flags.fill(0);
        for (cell, mark) in self.marks.iter().enumerate() {
            if *mark != 0 {
                for i in &order[starts[cell]..starts[cell + 1]] {
                    flags[*i] = 1;
                }
            }
        }
        self.take(flags);
    }

    /// Takes the candidates from their marks.
    pub fn take(&mut self, flags: &[u8]) {
        self.candidates.clear();
        self.candidates.extend((0..flags.len()).filter(|i| flags[*i] == 1));
    }

    /// Fits and sample particles from the level that the candidates carry.
    pub fn rebuild(
        &mut self,
        particles: &Particles<D>,
        columns: &SurfaceColumns,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), Interrupted> {
        let (phi, normal) = (particles.scalar(columns.phi), particles.vector(columns.normal));
        self.level.clear();
        self.level.extend(self.candidates.iter().map(|i| phi[*i]));
        self.normals.clear();
        self.normals.extend(self.candidates.iter().map(|i| normal[*i]));
        self.gather(particles);
        let normals = Some(self.normals.as_slice());
        rebuild(&mut self.surface, &self.positions, &self.level, normals, interrupt, phases)
    }

    fn gather(&mut self, particles: &Particles<D>) {
        let positions = particles.positions();
        self.positions.clear();
        self.positions.extend(self.candidates.iter().map(|i| positions[*i]));
    }

    /// Closest points of the candidates where they are now, which may be elsewhere than at the rebuild. After a selection only
    /// those who are near stay candidates.
    pub fn answer(
        &mut self,
        particles: &mut Particles<D>,
        columns: &SurfaceColumns,
        candidate: &mut [u8],
        is_selection: bool,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), Interrupted> {
        self.gather(particles);
        query(&self.surface, &self.positions, self.keep, &mut self.answers, interrupt, phases)?;
        phases.measure("redistancing/store", || {
            particles.flag_mut(columns.in_band).fill(0);
            if is_selection {
                candidate.fill(0);
            }
            let steepest = 1.0 / self.spacing;
            for (k, answer) in self.answers.iter() {
                let i = self.candidates[k];
                if is_selection {
                    candidate[i] = 1;
                }
                // Nobody changes side; who lies off a mere sample keeps what it has carried.
                if !answer.is_sample {
                    particles.scalar_mut(columns.phi)[i] = answer.distance.copysign(self.level[k]);
                }
                particles.vector_mut(columns.closest_point)[i] = answer.point;
                particles.vector_mut(columns.normal)[i] = answer.normal;
                let curvature = answer.curvature.clamp(-steepest, steepest);
                self.bounded += u64::from(curvature.to_bits() != answer.curvature.to_bits());
                particles.scalar_mut(columns.curvature)[i] = curvature;
                particles.flag_mut(columns.in_band)[i] = u8::from(answer.distance <= self.half_band);
            }
        });
        if is_selection {
            self.take(candidate);
        }
        Ok(())
    }
}
