//! The workspace of loops over pairs: the values of particles in the order of the neighbor lists, and the sums over pairs.
//!
//! An interaction gathers what it needs into slots, sums over pairs and reads the sums back by particle.

use super::column::Column;
use super::kernel_choice::ScaledKernel;
use super::mean_shear::MeanShear;
use super::neighbor_lists::NeighborLists;
use super::pair_sums::{Columns, Pair, PairLoop, Shares};
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use std::array::from_fn;

/// The position of a padding slot, in ε: beyond the support of every kernel.
const FAR: f64 = 1e15;
/// Scalar columns that an interaction may gather.
const SCALARS: usize = 6;

/// The most sums of one particle: a vector and two numbers.
const fn most_sums(dimension: usize) -> usize {
    dimension + 2
}

/// Neighbor lists, the kernel and columns in the order of places.
#[derive(Debug)]
pub(super) struct PairWorkspace<const D: usize> {
    pub lists: NeighborLists<D>,
    pub kernel: ScaledKernel,
    /// The volume of a particle at rest, h^D. Volumes are gathered in units of it.
    pub cell: f64,
    /// Positions in ε.
    positions: [Column; D],
    /// A second vector, as a rule velocities.
    vectors: [Column; D],
    scalars: [Column; SCALARS],
    sums: Vec<Column>,
    /// How the gathered vectors of images differ; see [`PairLoop::image_shear`].
    image_shear: Option<(usize, f64)>,
    interrupt: Interrupt,
}

/// The first columns as slices.
fn slices<const N: usize>(columns: &[Column]) -> [&[f64]; N] {
    from_fn(|n| &columns[n][..])
}

impl<const D: usize> PairWorkspace<D> {
    /// An empty workspace for particles of a volume `cell` each.
    pub fn new(lists: NeighborLists<D>, kernel: ScaledKernel, cell: f64, interrupt: Interrupt) -> Self {
        Self {
            lists,
            kernel,
            cell,
            // Columns that are used together have neighboring offsets.
            positions: from_fn(Column::new),
            vectors: from_fn(|d| Column::new(D + d)),
            sums: (0..most_sums(D)).map(|n| Column::new(2 * D + n)).collect(),
            scalars: from_fn(|n| Column::new(2 * D + most_sums(D) + n)),
            image_shear: None,
            interrupt,
        }
    }

    /// 1/ε.
    pub fn inverse_smoothing(&self) -> f64 {
        1.0 / self.kernel.smoothing_length
    }

    /// Makes the neighbor lists of these positions.
    pub fn list(&mut self, positions: &[Vector<D>]) -> Result<(), Interrupted> {
        self.lists.rebuild(positions, &self.interrupt)?;
        self.fit_sums();
        Ok(())
    }

    /// Makes the neighbor lists of the present reference positions, as a restart does.
    pub fn list_reference(&mut self) -> Result<(), Interrupted> {
        self.lists.rebuild_from_reference(&self.interrupt)?;
        self.fit_sums();
        Ok(())
    }

    fn fit_sums(&mut self) {
        let places = self.lists.pencils.slot_count();
        for column in &mut self.sums {
            column.resize(places);
        }
    }

    /// Gathers positions.
    pub fn gather_positions(&mut self, positions: &[Vector<D>]) {
        let (lists, inverse) = (&self.lists, 1.0 / self.kernel.smoothing_length);
        for (d, column) in self.positions.iter_mut().enumerate() {
            column.refill(lists.pencils.by_slot(FAR, |i| lists.unwrapped(i, positions)[d] * inverse));
        }
    }

    /// Gathers a vector of each particle, times a factor, into the vector columns.
    pub fn gather_vectors(&mut self, factor: f64, value: impl Fn(usize) -> Vector<D>) {
        self.image_shear = None;
        for (d, column) in self.vectors.iter_mut().enumerate() {
            column.refill(self.lists.pencils.by_slot(0.0, |i| value(i)[d] * factor));
        }
    }

    /// Gathers velocities, times a factor, into the vector columns: with the mean flow at the gathered positions, where there is one.
    pub fn gather_velocities(
        &mut self,
        factor: f64,
        mean_shear: Option<&MeanShear>,
        velocity: impl Fn(usize) -> Vector<D>,
    ) {
        self.gather_vectors(factor, velocity);
        let Some(MeanShear { axis, rate, middle, .. }) = mean_shear else { return };
        let (rate, smoothing_length) = (rate * factor, self.kernel.smoothing_length);
        self.image_shear = Some((*axis, rate));
        for (velocity, place) in self.vectors[0].iter_mut().zip(&self.positions[*axis][..]) {
            if *place < FAR {
                *velocity += rate * (place * smoothing_length - middle);
            }
        }
    }

    /// Gathers a number of each particle into a scalar column; padding slots get `padding`.
    pub fn gather(&mut self, slot: usize, padding: f64, value: impl Fn(usize) -> f64) {
        self.scalars[slot].refill(self.lists.pencils.by_slot(padding, value));
    }

    /// Sums over all pairs. `V` is 1 for positions alone and 2 with the gathered vectors, `S` the number of scalar columns,
    /// `N` the number of sums.
    pub fn sum_pairs<const V: usize, const S: usize, const N: usize>(
        &mut self,
        share: impl Fn(&Pair<'_, D, V, S>) -> Shares<N> + Sync,
    ) -> Result<(), Interrupted> {
        self.sum_pairs_where(|_, _| true, share)
    }

    /// Sums over pairs; places at which `meets` of the scalar columns is false do not visit the neighbors that they list.
    pub fn sum_pairs_where<const V: usize, const S: usize, const N: usize>(
        &mut self,
        meets: impl Fn(&[&[f64]; S], usize) -> bool + Sync,
        share: impl Fn(&Pair<'_, D, V, S>) -> Shares<N> + Sync,
    ) -> Result<(), Interrupted> {
        let inverse_smoothing = self.inverse_smoothing();
        let Self { lists, positions, vectors, scalars, sums, image_shear, interrupt, .. } = self;
        let by_vector = [&positions[..], &vectors[..]];
        let columns: Columns<'_, D, V, S> =
            Columns { vectors: from_fn(|v| slices(by_vector[v])), scalars: slices(&scalars[..]) };
        let image_shear = *image_shear;
        let pair_loop = PairLoop { pencils: &lists.pencils, inverse_smoothing, image_shear, interrupt };
        pair_loop.sum(&columns, sums, |place| meets(&columns.scalars, place), share)
    }

    /// Places and the particles that they hold.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.lists.pencils.occupied()
    }

    /// One of the sums of a place.
    pub fn sum(&self, n: usize, place: usize) -> f64 {
        self.sums[n][place]
    }

    /// The first D sums of a place.
    pub fn vector_sum(&self, place: usize) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| self.sums[d][place])
    }

    /// A gathered scalar of a place.
    pub fn scalar(&self, slot: usize, place: usize) -> f64 {
        self.scalars[slot][place]
    }

    /// Replaces a gathered scalar of every place, padding slots included, by a function of its value and the first sum.
    pub fn update_scalar(&mut self, slot: usize, value: impl Fn(f64, f64) -> f64) {
        for (scalar, sum) in self.scalars[slot].iter_mut().zip(&self.sums[0][..]) {
            *scalar = value(*scalar, *sum);
        }
    }
}
