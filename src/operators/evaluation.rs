//! Evaluation of functionals without rows, for moving points, whose weights are used only once.

use super::basis::Basis;
use super::charts::{Chart, Functional, Node};
use super::fits::{BLOCK, FitOutcome, Fits, RowSink, Support, SupportDiagnostics, Workspace};
use crate::linear_algebra::number::Lanes;
use crate::parallel::{Interrupt, Interrupted, PerThread};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};
use std::sync::{Mutex, PoisonError};

/// Functionals with one support, and the workspaces of all threads.
pub struct Evaluation<const M: usize> {
    basis: Basis<M>,
    support: Support,
    functionals: Vec<Functional<M>>,
    workspace: PerThread<(Workspace<M>, FitOutcome<M>)>,
}

/// Largest number of fields that are evaluated together.
pub const MAX_FIELDS: usize = 4;

impl<const M: usize> Evaluation<M> {
    /// The evaluation of functionals with fits of the given support.
    #[must_use]
    pub fn new(support: Support, functionals: Vec<Functional<M>>) -> Self {
        Self { basis: Basis::new(support.degree), support, functionals, workspace: PerThread::new() }
    }

    /// Number of results per point for a number of fields.
    #[must_use]
    pub fn numbers(&self, fields: usize) -> usize {
        self.functionals.len() * fields
    }

    /// Writes the functionals of all fields at every point of the chart to `out`.
    ///
    /// The results of a point are ordered by functional, then by field. Fields beyond [`MAX_FIELDS`] are ignored.
    /// Results of a point whose moment conditions cannot be met are NaN.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn evaluate(
        &self,
        chart: &dyn Chart<M>,
        fields: &[&[f64]],
        out: &mut [f64],
        interrupt: &Interrupt,
    ) -> Result<SupportDiagnostics, Interrupted> {
        let fields = &fields[..fields.len().min(MAX_FIELDS)];
        let numbers = self.numbers(fields.len());
        let fits = Fits { chart, basis: &self.basis, radius: self.support.radius, functionals: &self.functionals };
        let fit_diagnostics = Mutex::new(SupportDiagnostics::default());
        out.par_chunks_mut(BLOCK * numbers).enumerate().with_min_len(1).for_each(|(block, out)| {
            self.workspace.with(|(workspace, outcome)| {
                outcome.fit_diagnostics = SupportDiagnostics::default();
                outcome.heights.clear();
                let first = block * BLOCK;
                let mut sums = Sums { first, fields, numbers, out };
                let points = first..first + sums.out.len() / numbers;
                fits.run(points, interrupt, workspace, &mut sums, outcome);
                // The order in which counts and a minimum are combined does not matter.
                fit_diagnostics.lock().unwrap_or_else(PoisonError::into_inner).add(&outcome.fit_diagnostics);
            });
        });
        interrupt.check()?;
        Ok(fit_diagnostics.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Receives the weights of fits and writes the sums Σ_j w_j (f_j − f_i).
struct Sums<'a> {
    first: usize,
    fields: &'a [&'a [f64]],
    numbers: usize,
    out: &'a mut [f64],
}

impl<const M: usize> RowSink<M> for Sums<'_> {
    fn take(&mut self, functional: usize, i: usize, nodes: &[Node<M>], weights: Option<(&[Lanes], usize)>) {
        let count = self.fields.len();
        // An unknown value must not look like a number.
        let mut sums = [f64::NAN; MAX_FIELDS];
        if let Some((weights, lane)) = weights {
            let mut own = [0.0; MAX_FIELDS];
            own.iter_mut().zip(self.fields).for_each(|(own, field)| *own = field[i]);
            sums = [0.0; MAX_FIELDS];
            for (node, weights) in nodes.iter().zip(weights) {
                let weight = weights.as_array()[lane];
                for ((sum, field), own) in sums.iter_mut().zip(self.fields).zip(own) {
                    *sum += weight * (field[node.index as usize] - own);
                }
            }
        }
        let from = (i - self.first) * self.numbers + functional * count;
        self.out[from..from + count].copy_from_slice(&sums[..count]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Evaluation, Functional, Support};
    use crate::geometry::domain::Axis;
    use crate::geometry::random::CounterRandom;
    use crate::geometry::{Domain, Vector};
    use crate::neighbors::CellList;
    use crate::operators::{FlatChart, construct};
    use crate::parallel::Interrupt;

    #[test]
    fn values_are_those_of_the_rows() {
        let random = CounterRandom::new(2);
        let points: Vec<_> =
            (0..300_i64).map(|i| Vector::<2>::from_fn(|d, _| 0.5 + 0.5 * random.symmetric(&[i, d as i64]))).collect();
        let mut cells = CellList::new(Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]));
        cells.rebuild(points.iter().copied(), 0.2);
        let chart = FlatChart::new(&points, &cells);
        let support = Support { degree: 3, radius: 0.2 };
        let functionals = vec![Functional::Gradient(0), Functional::LaplaceBeltrami];
        let fields: [Vec<f64>; 2] =
            [0, 1].map(|f| (0..300).map(|i| random.symmetric(&[i, 7 + f])).collect::<Vec<f64>>());
        let built = construct::<2>(&chart, support, &functionals, &Interrupt::default()).unwrap();
        let mut out = vec![0.0; 4 * 300];
        let evaluation = Evaluation::<2>::new(support, functionals);
        let interrupt = Interrupt::default();
        let fit_diagnostics = evaluation.evaluate(&chart, &[&fields[0], &fields[1]], &mut out, &interrupt).unwrap();
        assert_eq!(fit_diagnostics, built.fit_diagnostics);
        for (f, field) in fields.iter().enumerate() {
            for (k, rows) in built.operators.iter().enumerate() {
                let mut expected = vec![0.0; 300];
                rows.apply(field, &mut expected);
                let size = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                assert!((0..300).all(|i| (out[4 * i + 2 * k + f] - expected[i]).abs() < 1e-10 * size));
            }
        }
    }
}
