//! The interface as the zero of a level set that particles carry, redistanced at every evaluation.
//!
//! Only particles near the interface take part, the candidates. They are selected when neighbors are listed, with a margin
//! that covers the motion of particles until the next selection.

use super::InterfaceError;
use crate::closest_point::{ClosestPoints, LevelSurface, PcpMethod, Redistancing, SurfaceColumns};
use crate::geometry::{Domain, Vector};
use crate::neighbors::CellList;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::Phases;

/// Constants of the selection.
struct Tuning {
    /// Distance in h beyond band and fits up to which particles are candidates: more than neighbors move towards each other
    /// between two selections, which is the skin of the neighbor lists.
    margin: f64,
    /// A particle within this distance of the interface, in h, marks its cell and the neighboring cells.
    near: f64,
}

const TUNING: Tuning = Tuning { margin: 1.0, near: 2.0 };

/// The surface and the particles near it.
#[derive(Debug)]
pub struct LevelSet<const D: usize> {
    pub surface: LevelSurface<D>,
    spacing: f64,
    half_band: f64,
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
    /// A level set that no particle carries yet, for `count` particles of a spacing h. Particles closer than `half_band` are in
    /// the band.
    pub fn new(method: PcpMethod, domain: &Domain<D>, spacing: f64, half_band: f64, count: usize) -> Self {
        let keep = half_band.max(method.fit_band_h::<D>() * spacing) + TUNING.margin * spacing;
        Self {
            surface: LevelSurface::Spatial(Box::new(Redistancing::new(method, domain.clone(), spacing))),
            spacing,
            half_band,
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
        let near = TUNING.near * self.spacing;
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

    /// Fits the surface to the level that the candidates carry.
    pub fn rebuild(
        &mut self,
        particles: &Particles<D>,
        columns: &SurfaceColumns,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), InterfaceError> {
        let (phi, normal) = (particles.scalar(columns.phi), particles.vector(columns.normal));
        self.level.clear();
        self.level.extend(self.candidates.iter().map(|i| phi[*i]));
        self.normals.clear();
        self.normals.extend(self.candidates.iter().map(|i| normal[*i]));
        self.gather(particles);
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
        is_selection: bool,
        interrupt: &Interrupt,
        phases: &mut Phases,
    ) -> Result<(), Interrupted> {
        self.gather(particles);
        query(&self.surface, &self.positions, self.keep, &mut self.answers, interrupt, phases)?;
        phases.measure("redistancing/store", || self.store(particles, columns, is_selection));
        if is_selection {
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
        let steepest = 1.0 / self.spacing;
        for (k, answer) in self.answers.iter() {
            let i = self.candidates[k];
            if is_selection {
                self.is_candidate[i] = 1;
            }
            // No particle changes side. A particle whose closest point is a mere sample keeps the level that it carries.
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
    }
}
