//! The lattice of the particles at the start: conventional cells, each with a few particles, that fill the box.
//!
//! Under a background pressure a lattice is stable only for some ratios of smoothing length and spacing (linear theory of
//! lattice waves, docs/results/droplet-notes.md). Where it is not, it melts, and its energy becomes motion.

use super::spec::{Droplet, LatticeWord};
use crate::geometry::Vector;
use crate::geometry::block::indices;
use crate::spec::Violation;

/// A lattice that fills a box.
#[derive(Debug, Clone)]
pub(super) struct StartLattice<const D: usize> {
    /// Cells along each axis.
    cells: [usize; D],
    /// Particles of a cell, in parts of its edges.
    basis: &'static [[f64; 3]],
}

/// A conventional cell.
struct Cell {
    /// Edges, in lengths V^(1/D) with the volume V of a particle.
    edges: [f64; 3],
    basis: &'static [[f64; 3]],
}

fn cell(word: LatticeWord) -> Cell {
    let root = 3.0_f64.sqrt();
    match word {
        LatticeWord::Cubic => Cell { edges: [1.0; 3], basis: &[[0.5, 0.5, 0.5]] },
        LatticeWord::Hexagonal => {
            // Triangles of edge a = (2/√3)^½, in rows a √3/2 apart.
            let a = (2.0 / root).sqrt();
            Cell { edges: [a, a * root, 1.0], basis: &[[0.25, 0.25, 0.5], [0.75, 0.75, 0.5]] }
        }
        LatticeWord::BodyCentered => {
            Cell { edges: [2.0_f64.cbrt(); 3], basis: &[[0.25, 0.25, 0.25], [0.75, 0.75, 0.75]] }
        }
        LatticeWord::FaceCentered => Cell {
            edges: [4.0_f64.cbrt(); 3],
            basis: &[[0.25, 0.25, 0.25], [0.75, 0.75, 0.25], [0.75, 0.25, 0.75], [0.25, 0.75, 0.75]],
        },
    }
}

impl<const D: usize> StartLattice<D> {
    /// The lattice with the cells nearest to a spacing that fill a box with these edge lengths, at most `most` along an axis.
    pub fn new(word: LatticeWord, lengths: &Vector<D>, spacing: f64, most: f64) -> Self {
        let Cell { edges, basis } = cell(word);
        let counts = |d: usize| (lengths[d] / (edges[d] * spacing)).round().clamp(0.0, most) as usize;
        Self { cells: std::array::from_fn(counts), basis }
    }

    /// Number of particles, as a real number that does not overflow.
    pub fn count(&self) -> f64 {
        self.cells.iter().map(|cells| *cells as f64).product::<f64>() * self.basis.len() as f64
    }

    /// Edges of a cell in a box with these lengths.
    pub fn edges(&self, lengths: &Vector<D>) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| lengths[d] / self.cells[d] as f64)
    }

    /// Positions in a box with a lower corner and edge lengths, the first axis fastest, and those in layers of so many cells around
    /// the box.
    pub fn positions(
        &self,
        low: &Vector<D>,
        lengths: &Vector<D>,
        layers: &[usize; D],
    ) -> (Vec<Vector<D>>, Vec<Vector<D>>) {
        let (mut inside, mut around) = (Vec::with_capacity(self.count() as usize), Vec::new());
        let counts: [usize; D] = std::array::from_fn(|d| self.cells[d] + 2 * layers[d]);
        for k in 0..counts.iter().product::<usize>() {
            let cell = indices(k, &counts);
            let is_inside = (0..D).all(|d| (layers[d]..layers[d] + self.cells[d]).contains(&cell[d]));
            let positions = if is_inside { &mut inside } else { &mut around };
            for part in self.basis {
                positions.push(Vector::<D>::from_fn(|d, _| {
                    low[d] + (cell[d] as f64 - layers[d] as f64 + part[d]) * lengths[d] / self.cells[d] as f64
                }));
            }
        }
        (inside, around)
    }
}

/// Number of particles of a run at most.
const MOST_PARTICLES: f64 = 1e9;

/// The particles of the start.
pub(super) fn start_lattice<const D: usize>(
    spec: &Droplet,
    word: LatticeWord,
    lengths: &Vector<D>,
    is_box: bool,
    errors: &mut Vec<Violation>,
) -> StartLattice<D> {
    let lattice = StartLattice::new(word, lengths, spec.spacing, MOST_PARTICLES);
    if is_box && !(1.0..=MOST_PARTICLES).contains(&lattice.count()) {
        let least = (lengths.product() / MOST_PARTICLES).powf(1.0 / D as f64);
        let allowed = format!("a number ≥ {least:.3e} and below every side");
        errors.push(Violation::new("/spacing", "range", "too many particles, or none", spec.spacing, allowed));
    }
    lattice
}

#[cfg(test)]
mod tests {
    use super::{LatticeWord, StartLattice, Vector};

    fn nearest<const D: usize>(word: LatticeWord, cells: [f64; D]) -> (f64, usize, f64) {
        let lengths = Vector::<D>::from(cells);
        let lattice = StartLattice::new(word, &lengths, 1.0, 1e9);
        let (positions, around) = lattice.positions(&Vector::<D>::zeros(), &lengths, &[0; D]);
        assert!(around.is_empty());
        assert_eq!(positions.len() as f64, lattice.count());
        let wrap = |x: Vector<D>| Vector::<D>::from_fn(|d, _| x[d] - (x[d] / lengths[d]).round() * lengths[d]);
        let mut distances: Vec<f64> = positions[1..].iter().map(|x| wrap(x - positions[0]).norm()).collect();
        distances.sort_by(f64::total_cmp);
        let number = distances.iter().filter(|r| **r < 1.02 * distances[0]).count();
        (distances[0], number, lengths.product() / lattice.count())
    }

    /// Distance of the nearest particles for a volume of 1, and their number.
    #[test]
    fn lattices_have_their_neighbors_and_fill_the_box() {
        let edge = (2.0 / 3.0_f64.sqrt()).sqrt();
        let fcc = 4.0_f64.cbrt();
        let check = |(distance, number, volume): (f64, usize, f64), expected: f64, neighbors: usize| {
            assert!((distance - expected).abs() < 1e-12 && number == neighbors, "{distance}, {number}");
            assert!((volume - 1.0).abs() < 1e-12);
        };
        check(nearest::<2>(LatticeWord::Cubic, [8.0, 6.0]), 1.0, 4);
        check(nearest::<2>(LatticeWord::Hexagonal, [8.0 * edge, 5.0 * 3.0_f64.sqrt() * edge]), edge, 6);
        check(nearest::<3>(LatticeWord::Cubic, [5.0; 3]), 1.0, 6);
        check(nearest::<3>(LatticeWord::BodyCentered, [5.0 * 2.0_f64.cbrt(); 3]), 0.75_f64.sqrt() * 2.0_f64.cbrt(), 8);
        check(nearest::<3>(LatticeWord::FaceCentered, [5.0 * fcc; 3]), 0.5_f64.sqrt() * fcc, 12);
    }
}
