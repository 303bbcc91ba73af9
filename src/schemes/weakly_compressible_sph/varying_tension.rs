//! Surface tension that is not the same everywhere: its values and gradients at the particles of the band.

use super::droplets::Droplets;
use super::flow_state::FlowState;
use super::smoothed_delta::smoothed_delta;
use super::surfactant::{Amounts, Scales, Surfactant};
use super::tension_law::TensionLaw;
use crate::closest_point::SurfaceColumns;
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;

/// Tension and coverage at the particles of the band, and their means.
#[derive(Debug, Default)]
pub(super) struct TensionField<const D: usize> {
    /// Tension τ of each particle; NaN where none is known.
    pub tension: Vec<f64>,
    /// Its gradient along the interface.
    pub gradient: Vec<Vector<D>>,
    /// Coverage of each particle; NaN where none is known. Empty without a surfactant.
    pub coverage: Vec<f64>,
    /// Mean tension of each group of droplets over its interface.
    pub means: Vec<f64>,
    /// Particles whose values are known, and their shares of the interface.
    pub known: Vec<(usize, f64)>,
    /// Part of the interface whose particles know no tension, by all of it.
    pub unknown_share: f64,
    sums: Vec<[f64; 2]>,
}

/// A tension by a law.
#[derive(Debug)]
pub(super) struct VaryingTension<const D: usize> {
    /// The tension τ₀ of the law.
    coefficient: f64,
    smoothing_length: f64,
    domain: Domain<D>,
    /// Middle of the box.
    middle: Vector<D>,
    source: Source<D>,
    pub field: TensionField<D>,
}

/// What the tension comes from.
#[derive(Debug)]
enum Source<const D: usize> {
    Slope(Vector<D>),
    Surfactant(Box<Surfactant<D>>),
}

/// What is known when tensions are found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surroundings<'a, const D: usize> {
    pub columns: &'a SurfaceColumns,
    pub flow: &'a FlowState<D>,
    pub droplets: &'a Droplets<D>,
    /// Particles near the interface.
    pub candidates: &'a [usize],
}

/// The middle of a box.
fn middle_of<const D: usize>(domain: &Domain<D>) -> Vector<D> {
    Vector::<D>::from_fn(|d, _| match domain.axes()[d] {
        Axis::Unbounded => 0.0,
        Axis::Periodic { start, length } => start + 0.5 * length,
    })
}

impl<const D: usize> VaryingTension<D> {
    /// The tension by a law about a coefficient τ₀.
    pub fn new(
        (law, coefficient): (TensionLaw<D>, f64),
        domain: &Domain<D>,
        scales: Scales,
        particles: &mut Particles<D>,
    ) -> Self {
        let middle = middle_of(domain);
        let source = match law {
            TensionLaw::Slope { slope, .. } => Source::Slope(slope),
            TensionLaw::Surfactant(config) => {
                let surfactant = Surfactant::new(config, (domain.clone(), middle), scales, particles);
                Source::Surfactant(Box::new(surfactant))
            }
        };
        let (smoothing_length, domain) = (scales.smoothing_length, domain.clone());
        Self { coefficient, smoothing_length, domain, middle, source, field: TensionField::default() }
    }

    /// Moves the surfactant on by the time since the last evaluation, 0 for the start, and finds tensions anew.
    pub fn advance(
        &mut self,
        particles: &mut Particles<D>,
        surroundings: Surroundings<'_, D>,
        elapsed: f64,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        if let Source::Surfactant(surfactant) = &mut self.source {
            let Surroundings { columns, flow, candidates, .. } = surroundings;
            surfactant.find_members(particles, columns, flow, candidates);
            if elapsed > 0.0 {
                surfactant.exchange(particles, elapsed, interrupt)?;
            } else {
                surfactant.start(particles);
            }
        }
        self.find(particles, surroundings);
        Ok(())
    }

    /// Finds tensions of a state that was loaded.
    pub fn derive(&mut self, particles: &Particles<D>, surroundings: Surroundings<'_, D>) {
        if let Source::Surfactant(surfactant) = &mut self.source {
            let Surroundings { columns, flow, candidates, .. } = surroundings;
            surfactant.find_members(particles, columns, flow, candidates);
        }
        self.find(particles, surroundings);
    }

    fn find(
        &mut self,
        particles: &Particles<D>,
        Surroundings { columns, flow, droplets, candidates }: Surroundings<'_, D>,
    ) {
        let Self { coefficient, source, field, .. } = self;
        field.clear(particles.len());
        match source {
            Source::Slope(slope) => {
                let (phi, foot) = (particles.scalar(columns.phi), particles.vector(columns.closest_point));
                let (normal, band) = (particles.vector(columns.normal), particles.flag(columns.in_band));
                for i in candidates.iter().copied().filter(|i| band[*i] == 1) {
                    let area = flow.volume[i] * smoothed_delta(phi[i], self.smoothing_length);
                    if area > 0.0 {
                        let way = self.domain.displacement(&self.middle, &foot[i]);
                        field.known.push((i, area));
                        field.tension[i] = *coefficient * (1.0 + slope.dot(&way));
                        field.gradient[i] = (*slope - normal[i] * normal[i].dot(slope)) * *coefficient;
                    }
                }
            }
            Source::Surfactant(surfactant) => {
                let config = surfactant.config;
                field.coverage.clear();
                field.coverage.resize(particles.len(), f64::NAN);
                surfactant.find_coverage(|i, area, coverage, gradient| {
                    field.known.push((i, area));
                    field.coverage[i] = coverage;
                    field.tension[i] = *coefficient * config.tension(coverage);
                    field.gradient[i] = gradient * (*coefficient * config.tension_slope(coverage));
                });
            }
        }
        field.find_means(droplets);
    }

    /// Energy of the interface, ∮ E dA, or ∮ τ dA where a slope is given.
    pub fn surface_energy(&self) -> f64 {
        let known = self.field.known.iter();
        match &self.source {
            Source::Slope(_) => known.map(|(i, area)| area * self.field.tension[*i]).sum(),
            Source::Surfactant(surfactant) => {
                let energy = |i: usize| surfactant.config.energy(self.field.coverage[i]);
                known.map(|(i, area)| area * self.coefficient * energy(*i)).sum()
            }
        }
    }

    /// What keeps up a slope of the tension supplies ∮ u·∇τ dA.
    pub fn supplied_power(&self, velocity: &[Vector<D>]) -> f64 {
        match &self.source {
            Source::Slope(slope) => {
                let known = self.field.known.iter();
                known.map(|(i, area)| area * self.coefficient * slope.dot(&velocity[*i])).sum()
            }
            Source::Surfactant(_) => 0.0,
        }
    }

    /// The amounts of a surfactant on all particles; none without one.
    pub fn all_amounts<'a>(&self, particles: &'a Particles<D>) -> &'a [f64] {
        match &self.source {
            Source::Slope(_) => &[],
            Source::Surfactant(surfactant) => surfactant.all_amounts(particles),
        }
    }

    /// What there is of a surfactant.
    pub fn amounts(&self, particles: &Particles<D>) -> Option<Amounts> {
        match &self.source {
            Source::Slope(_) => None,
            Source::Surfactant(surfactant) => Some(surfactant.amounts(particles)),
        }
    }

    /// Mean tension over all interfaces.
    pub fn mean(&self) -> f64 {
        let (all, sum) = self
            .field
            .known
            .iter()
            .fold((0.0, 0.0), |(all, sum), (i, area)| (all + area, sum + area * self.field.tension[*i]));
        sum / all
    }

    /// Least and largest tension by τ₀.
    pub fn tension_range(&self) -> [f64; 2] {
        range(self.field.known.iter().map(|(i, _)| self.field.tension[*i] / self.coefficient))
    }

    /// Least and largest coverage; None without a surfactant.
    pub fn coverage_range(&self) -> Option<[f64; 2]> {
        let has_coverage = matches!(self.source, Source::Surfactant(_));
        has_coverage.then(|| range(self.field.known.iter().map(|(i, _)| self.field.coverage[*i])))
    }

    /// How near the band has come to the jump of the tension at a side of the box: 1 where they touch. 0 without a slope.
    pub fn nearness_to_jump(&self, particles: &Particles<D>, columns: &SurfaceColumns) -> f64 {
        let Source::Slope(slope) = &self.source else { return 0.0 };
        let foot = particles.vector(columns.closest_point);
        let mut nearest = 0.0_f64;
        for (d, axis) in self.domain.axes().iter().enumerate() {
            if let (Axis::Periodic { length, .. }, true) = (axis, slope[d] != 0.0) {
                let free = 0.5 * length - 2.0 * self.smoothing_length;
                let way = |i: usize| self.domain.displacement(&self.middle, &foot[i])[d].abs() / free;
                nearest = self.field.known.iter().map(|(i, _)| way(*i)).fold(nearest, f64::max);
            }
        }
        nearest
    }
}

/// Least and largest value; NaN of none.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::NAN; 2], |[least, most], value| [least.min(value), most.max(value)])
}

impl<const D: usize> TensionField<D> {
    fn clear(&mut self, count: usize) {
        self.tension.clear();
        self.tension.resize(count, f64::NAN);
        self.gradient.clear();
        self.gradient.resize(count, Vector::<D>::zeros());
        self.known.clear();
    }

    fn find_means(&mut self, droplets: &Droplets<D>) {
        self.sums.clear();
        self.sums.resize(droplets.groups(), [0.0; 2]);
        // A particle whose neighbors have no share of the interface knows no tension.
        let area = |known: &[(usize, f64)]| known.iter().map(|(_, area)| area).sum::<f64>();
        let whole = area(&self.known);
        self.known.retain(|(i, _)| !self.tension[*i].is_nan());
        self.unknown_share = 1.0 - area(&self.known) / whole;
        for (i, area) in &self.known {
            let [all, sum] = &mut self.sums[droplets.group(*i)];
            *all += area;
            *sum += area * self.tension[*i];
        }
        self.means.clear();
        self.means.extend(self.sums.iter().map(|[all, sum]| sum / all));
    }
}
