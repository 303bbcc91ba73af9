//! Neighbours and the sums over them: columns gathered in the order of pencils, sums, and what comes of them written back.

use super::color_field;
use super::column::Column;
use super::continuity::{sum_rates, sums_of};
use super::density::sum_kernel;
use super::kernel_choice::{KernelChoice, with_kernel};
use super::momentum::sum_forces;
use super::pair_sums::Columns;
use super::parts::SphParts;
use super::shifting::sum_concentration;
use crate::geometry::{Domain, Vector};
use crate::neighbors::Pencils;
use crate::neighbors::pencils::BoxTooSmall;
use crate::parallel::{Interrupt, Interrupted};
use std::array::from_fn;

/// Far from everybody, in ε.
const FAR: f64 = 1e15;

/// Pencils and columns in their order.
#[derive(Debug)]
pub(super) struct Hydrodynamics<const D: usize> {
    domain: Domain<D>,
    pencils: Pencils<D>,
    skin: f64,
    epsilon: f64,
    kernel: KernelChoice,
    /// σ/ε^D.
    normalization: f64,
    /// The volume of a particle at rest, h^D.
    cell: f64,
    x: [Column; D],
    u: [Column; D],
    scalars: [Column; 6],
    sums: Vec<Column>,
}

/// The column slices of one length.
fn slices<const N: usize>(columns: &[Column]) -> [&[f64]; N] {
    from_fn(|n| &columns[n][..])
}

impl<const D: usize> Hydrodynamics<D> {
    pub fn new(parts: &SphParts<D>, domain: &Domain<D>, cell: f64) -> Result<Self, BoxTooSmall> {
        let (skin, epsilon) = (parts.skin(), parts.smoothing_length);
        Ok(Self {
            domain: domain.clone(),
            pencils: Pencils::new(domain, parts.reach())?,
            skin,
            epsilon,
            kernel: parts.kernel,
            normalization: parts.kernel.normalization(D) / epsilon.powi(D as i32),
            cell,
            // Those that are used together are next to each other.
            x: from_fn(Column::new),
            u: from_fn(|d| Column::new(D + d)),
            sums: (0..sums_of(D)).map(|n| Column::new(2 * D + n)).collect(),
            scalars: from_fn(|n| Column::new(2 * D + sums_of(D) + n)),
        })
    }

    /// Whether there are lists at all.
    pub fn is_listed(&self) -> bool {
        self.pencils.slot_count() > 0
    }

    /// Whether the lists no longer cover everybody in reach.
    pub fn is_stale(&self, positions: &[Vector<D>], reference: &[Vector<D>]) -> bool {
        let most = 0.25 * self.skin * self.skin;
        let has_moved = |(x, from)| self.domain.displacement(from, x).norm_squared() > most;
        positions.iter().zip(reference).any(has_moved)
    }

    /// Lists neighbours anew, of the positions in `reference`.
    pub fn list(&mut self, reference: &[Vector<D>], interrupt: &Interrupt) -> Result<(), Interrupted> {
        self.pencils.rebuild(reference, interrupt)?;
        let places = self.pencils.slot_count();
        for column in &mut self.sums {
            column.resize(places);
        }
        Ok(())
    }

    /// Gathers positions, side by side with where they were listed however they have been wrapped since.
    pub fn take_positions(&mut self, positions: &[Vector<D>], reference: &[Vector<D>]) {
        let (domain, inverse) = (&self.domain, 1.0 / self.epsilon);
        for (d, column) in self.x.iter_mut().enumerate() {
            column.refill(self.pencils.by_slot(FAR, |i| {
                let from = &reference[i];
                (from[d] + domain.displacement(from, &positions[i])[d]) * inverse
            }));
        }
    }

    fn gather_vectors(&mut self, factor: f64, value: impl Fn(usize) -> Vector<D>) {
        for (d, column) in self.u.iter_mut().enumerate() {
            column.refill(self.pencils.by_slot(0.0, |i| value(i)[d] * factor));
        }
    }

    /// The first D sums of a place.
    fn vector(&self, place: usize) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| self.sums[d][place])
    }

    fn gather(&mut self, slot: usize, nobodys: f64, value: impl Fn(usize) -> f64) {
        self.scalars[slot].refill(self.pencils.by_slot(nobodys, value));
    }

    /// The volume of every particle by summation, 1/Σ W.
    pub fn volumes(&mut self, volume: &mut [f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let columns = Columns { vectors: [slices(&self.x)], scalars: [] };
        let inverse = 1.0 / self.epsilon;
        with_kernel!(self.kernel, K => sum_kernel::<K, D>(&self.pencils, &columns, inverse, &mut self.sums, interrupt))?;
        let own = self.kernel.value(0.0);
        for (place, i) in self.pencils.occupied() {
            volume[i] = 1.0 / (self.normalization * (own + self.sums[0][place]));
        }
        Ok(())
    }

    /// Forces by the volume form.
    #[expect(clippy::too_many_arguments, reason = "columns of one evaluation, each a slice of its own")]
    pub fn forces(
        &mut self,
        parts: &SphParts<D>,
        is_inside: &[u8],
        volume: &[f64],
        pressure: &[f64],
        velocity: &[Vector<D>],
        forces: &mut [Vector<D>],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let (by_cell, inverse) = (1.0 / self.cell, 1.0 / self.epsilon);
        self.gather(0, 1.0, |i| volume[i] * by_cell);
        self.gather(1, 0.0, |i| volume[i] * by_cell * pressure[i]);
        let is_one = parts.has_one_viscosity();
        if is_one {
            self.gather_vectors(parts.inside.viscosity * inverse, |i| velocity[i]);
        } else {
            self.gather(2, 1.0, |i| parts.fluid(is_inside[i] == 1).viscosity);
            self.gather_vectors(inverse, |i| velocity[i]);
        }
        let (pencils, forces_of, vectors) = (&self.pencils, &mut self.sums, [slices(&self.x), slices(&self.u)]);
        with_kernel!(self.kernel, K => if is_one {
            let columns = Columns { vectors, scalars: slices::<2>(&self.scalars) };
            sum_forces::<K, D, 2>(pencils, &columns, inverse, forces_of, interrupt)
        } else {
            let columns = Columns { vectors, scalars: slices::<3>(&self.scalars) };
            sum_forces::<K, D, 3>(pencils, &columns, inverse, forces_of, interrupt)
        })?;
        // ∇W = σ/ε^(D+1) w'(q)/q x/ε.
        let factor = self.cell * self.cell * self.normalization * self.kernel.slope() / self.epsilon;
        for (place, i) in pencils.occupied() {
            forces[i] = self.vector(place) * factor;
        }
        Ok(())
    }

    /// Accelerations and rates of density by the mass form.
    #[expect(clippy::too_many_arguments, reason = "columns of one evaluation, each a slice of its own")]
    pub fn rates(
        &mut self,
        parts: &SphParts<D>,
        diffusion: f64,
        is_inside: &[u8],
        mass: impl Fn(usize) -> f64,
        density: &[f64],
        pressure: &[f64],
        velocity: &[Vector<D>],
        acceleration: &mut [Vector<D>],
        density_rate: &mut [f64],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let (by_cell, unit) = (1.0 / self.cell, parts.inside.density * self.cell);
        let factor = if D == 2 { 8.0 } else { 10.0 };
        let fluid = |i: usize| parts.fluid(is_inside[i] == 1);
        self.gather_vectors(1.0, |i| velocity[i]);
        self.gather(0, 1.0, |i| density[i]);
        self.gather(1, 1.0, |i| mass(i) / density[i] * by_cell);
        self.gather(2, 0.0, |i| pressure[i] / (density[i] * density[i]));
        let viscosity = factor * parts.inside.kinematic_viscosity();
        let inverse = 1.0 / self.epsilon;
        let is_one = parts.has_one_mass() && parts.has_one_viscosity();
        if !is_one {
            self.gather(3, 1.0, |i| mass(i) / unit);
            self.gather(4, 1.0, |i| factor * fluid(i).kinematic_viscosity());
            self.gather(5, 1.0, |i| 1.0 / fluid(i).density);
        }
        let (pencils, rates, vectors) = (&self.pencils, &mut self.sums, [slices(&self.x), slices(&self.u)]);
        let same = Columns { vectors, scalars: slices::<3>(&self.scalars) };
        let other = Columns { vectors, scalars: slices::<6>(&self.scalars) };
        with_kernel!(self.kernel, K => match (is_one, D) {
            (true, 2) => sum_rates::<K, D, 3, 4>(pencils, &same, inverse, viscosity, rates, interrupt),
            (true, _) => sum_rates::<K, D, 3, 5>(pencils, &same, inverse, viscosity, rates, interrupt),
            (false, 2) => sum_rates::<K, D, 6, 4>(pencils, &other, inverse, viscosity, rates, interrupt),
            (false, _) => sum_rates::<K, D, 6, 5>(pencils, &other, inverse, viscosity, rates, interrupt),
        })?;
        let gradient = self.normalization * self.kernel.slope() / self.epsilon;
        for (place, i) in pencils.occupied() {
            let [compression, spread] = [self.sums[D][place], self.sums[D + 1][place]];
            let fluid = fluid(i);
            acceleration[i] = self.vector(place) * (-unit * gradient);
            // Excesses are of ρ, or of ρ/ρ₀ where the fluids differ; W'/r has one more 1/ε than ∇W by x/ε.
            let scale = if is_one { 1.0 } else { fluid.density };
            let spread = diffusion * fluid.sound_speed * scale * spread;
            density_rate[i] = (density[i] * compression + spread) * gradient * self.cell;
        }
        Ok(())
    }

    /// ∇C of every particle (B.15), for given volumes.
    pub fn concentration(
        &mut self,
        volume: impl Fn(usize) -> f64,
        spacing: f64,
        interrupt: &Interrupt,
        mut found: impl FnMut(usize, Vector<D>),
    ) -> Result<(), Interrupted> {
        let by_cell = 1.0 / self.cell;
        self.gather(0, 0.0, |i| volume(i) * by_cell);
        let at_spacing = self.kernel.value(spacing / self.epsilon);
        let columns = Columns { vectors: [slices(&self.x)], scalars: slices::<1>(&self.scalars) };
        let (pencils, inverse, sums) = (&self.pencils, 1.0 / self.epsilon, &mut self.sums);
        with_kernel!(self.kernel, K => {
            sum_concentration::<K, D>(pencils, &columns, inverse, at_spacing, sums, interrupt)
        })?;
        let factor = self.cell * self.normalization * self.kernel.slope() / self.epsilon;
        for (place, i) in pencils.occupied() {
            found(i, self.vector(place) * factor);
        }
        Ok(())
    }

    /// Colours of the inner fluid, their gradients (outward: from the inside out), unit normals and curvatures (B.5 to B.9);
    /// `gradient` keeps n̂, zero away from the interface.
    pub fn color_geometry(
        &mut self,
        is_inside: &[u8],
        volume: &[f64],
        gradient: &mut [Vector<D>],
        normal: &mut [Vector<D>],
        curvature: &mut [f64],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let (by_cell, inverse, slope) = (1.0 / self.cell, 1.0 / self.epsilon, self.kernel.slope());
        let kernel = self.normalization * self.cell;
        self.gather(0, 0.0, |i| volume[i] * by_cell * f64::from(is_inside[i]));
        self.gather(1, 0.0, |i| volume[i] * by_cell);
        let columns = Columns { vectors: [slices(&self.x)], scalars: slices::<1>(&self.scalars) };
        let (pencils, sums) = (&self.pencils, &mut self.sums);
        with_kernel!(self.kernel, K => color_field::sum_color::<K, D>(pencils, &columns, inverse, sums, interrupt))?;
        let own = self.kernel.value(0.0);
        for (color, sum) in self.scalars[0].iter_mut().zip(&self.sums[0][..]) {
            *color = (own * *color + sum) * kernel;
        }
        let columns = Columns { vectors: [slices(&self.x)], scalars: slices::<2>(&self.scalars) };
        let sums = &mut self.sums;
        with_kernel!(self.kernel, K => color_field::sum_gradient::<K, D>(pencils, &columns, inverse, sums, interrupt))?;
        let least = color_field::THRESHOLD * inverse;
        for (place, i) in pencils.occupied() {
            // Colours fall outwards.
            let found = self.vector(place) * (-kernel * slope * inverse);
            let is_of_interface = found.norm() > least;
            gradient[i] = if is_of_interface { found } else { Vector::<D>::zeros() };
            normal[i] = if is_of_interface { found.normalize() } else { Vector::<D>::zeros() };
        }
        self.gather_vectors(1.0, |i| normal[i]);
        self.gather(0, 0.0, |i| if normal[i] == Vector::<D>::zeros() { 0.0 } else { volume[i] * by_cell });
        let columns = Columns { vectors: [slices(&self.x), slices(&self.u)], scalars: slices::<1>(&self.scalars) };
        let (pencils, sums) = (&self.pencils, &mut self.sums);
        with_kernel!(self.kernel, K => color_field::sum_curvature::<K, D>(pencils, &columns, inverse, sums, interrupt))?;
        for (place, i) in pencils.occupied() {
            let share = self.scalars[0][place];
            // With its own share of the weights.
            let weights = self.sums[0][place] + own * share;
            // ∇·n with ∇W about i, turned to the sign of a divergence.
            let found = self.sums[1][place] * slope * inverse / weights;
            curvature[i] = if share > 0.0 && weights > 0.0 { found } else { 0.0 };
        }
        Ok(())
    }
}
