//! What a problem costs: operators, work and memory.

use super::problems::ProblemChoice;
use super::spread::Spread;
use super::starts::Start;
use crate::scene::work::PhaseWork;
use crate::schemes::surface_equation::{EvolutionIntegrator, Solver};

impl ProblemChoice {
    /// Operators that it makes.
    pub fn operators(&self, dimension: usize) -> f64 {
        match self {
            Self::Curvature { of_heights: true } | Self::Advection { .. } | Self::Moving { .. } => 0.0,
            Self::Curvature { .. } | Self::Gradient { .. } | Self::GeodesicDistance { .. } => dimension as f64,
            _ => 1.0,
        }
    }

    /// Operators in memory at once, about.
    pub fn copies(&self) -> f64 {
        match self {
            Self::Curvature { .. }
            | Self::Gradient { .. }
            | Self::Eigenvalues { .. }
            | Self::GeodesicDistance { .. }
            | Self::Poisson { .. }
            | Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => 3.0,
            // Substances whose diffusivity varies have rows of their own.
            Self::Evolution { start: Start::Reaction { diffusivity, .. }, .. } => {
                1.0 + diffusivity.iter().filter(|spread| matches!(spread, Spread::Field(_))).count() as f64
            }
            Self::Evolution { start: Start::Field { diffusivity: Spread::Field(_), .. }, .. } => 2.0,
            _ => 1.0,
        }
    }

    /// Work beside the construction, in products of a row; a controlled integrator makes so many steps of one.
    pub fn work(&self, application: f64, points: f64, steps: f64, inner_steps: f64) -> Vec<PhaseWork> {
        let wide = points.ln().max(1.0);
        match self {
            Self::LaplaceBeltrami { .. } => vec![PhaseWork::every_step("operators/application", application * steps)],
            Self::Curvature { of_heights: true } => Vec::new(),
            Self::Curvature { .. } | Self::Gradient { .. } => {
                vec![PhaseWork::every_step("operators/application", 9.0 * application)]
            }
            Self::Eigenvalues { count } => {
                // Factors, and so many solutions that are made orthogonal to those before.
                let solutions = 3.0 * *count as f64 + 50.0;
                // The small problem is solved some tens of times.
                let small = 30.0 * solutions.powi(3);
                let work = points.powf(1.5) + solutions * points * (wide + solutions) + small;
                vec![PhaseWork::at_milestones("solver/eigenmodes", work)]
            }
            // Stars and a solution in every step.
            Self::Moving { .. } => vec![PhaseWork::every_step("evolution", 400.0 * points * steps)],
            // Three stages of gradients and fluxes, in as many steps as stability asks for: about one a spacing.
            Self::Advection { .. } => vec![PhaseWork::every_step("evolution", 60.0 * points * steps * inner_steps)],
            Self::GeodesicDistance { .. } => {
                let work = 2.0 * points.powf(1.5) + 20.0 * (points * wide + 3.0 * application);
                vec![PhaseWork::every_step("solver/distances", work)]
            }
            Self::Poisson { solver: Solver::SparseLu, .. } => vec![
                PhaseWork::every_step("solver/assembly", application),
                // Nested dissection of a plane fills n ln n entries and takes n^1.5 operations.
                PhaseWork::every_step("solver/factors", points.powf(1.5)),
                PhaseWork::every_step("solver/solution", points * wide),
            ],
            Self::Poisson { .. } => vec![
                PhaseWork::every_step("solver/assembly", application),
                PhaseWork::every_step("solver/factors", 10.0 * application),
                // Iterations grow with the number of points along a line.
                PhaseWork::every_step("solver/solution", application * points.sqrt()),
            ],
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(Solver::SparseLu), .. } => {
                // Factors of the first step and of all others.
                let factors = 2.0 * points.powf(1.5);
                vec![PhaseWork::every_step("solver/solution", factors + points * wide * steps)]
            }
            Self::Evolution { integrator: EvolutionIntegrator::Bdf2(_), .. } => {
                vec![PhaseWork::every_step("solver/solution", 20.0 * application * steps)]
            }
            Self::Evolution { start, integrator, .. } => {
                let fields = start.fields();
                let inner = if let EvolutionIntegrator::Controlled { .. } = integrator { inner_steps } else { 1.0 };
                vec![PhaseWork::every_step("evolution", 6.0 * fields * application * steps * inner)]
            }
        }
    }

    /// Inner steps of one of the scene when stability binds them, for a spacing and a length that the surface is within: 2 δn² by the
    /// diffusivity, and for what is carried half a spacing by the speed.
    pub fn inner_steps(&self, time_step: f64, spacing: f64, reach: f64) -> f64 {
        let rate = match self {
            Self::Evolution { start: Start::Reaction { diffusivity, .. }, .. } => {
                let largest = diffusivity.iter().map(|spread| spread.largest(reach)).fold(0.0, f64::max);
                largest / (2.0 * spacing * spacing)
            }
            Self::Evolution { start: Start::Field { diffusivity, .. }, .. } => {
                diffusivity.largest(reach) / (2.0 * spacing * spacing)
            }
            Self::Advection { velocity, diffusivity, .. } => {
                2.0 * velocity.top_speed(reach) / spacing + 4.0 * diffusivity / (spacing * spacing)
            }
            _ => 1.0 / (2.0 * spacing * spacing),
        };
        (time_step * rate).max(1.0)
    }

    /// Bytes a point that a solver fills beside its system, for rows of so many entries: the basis of GMRES, or a direct decomposition,
    /// n ln n entries of it on a surface (measured: 23 kB at 35 entries and 16,000 points).
    pub fn fill(&self, entries: f64, points: f64) -> f64 {
        if let Self::Eigenvalues { count } = self {
            // Factors, the basis, and the modes.
            return 70.0 * entries * points.ln() + 8.0 * (5.0 * *count as f64 + 100.0);
        }
        match self.solver() {
            _ if matches!(self, Self::Advection { .. } | Self::Moving { .. }) => 400.0,
            _ if matches!(self, Self::GeodesicDistance { .. }) => 2.0 * 70.0 * 7.0 * points.ln(),
            Some(Solver::SparseLu) => 70.0 * entries * points.ln(),
            Some(Solver::Gmres { restart, stopping }) => 8.0 * (stopping.max_iterations.min(restart as u64) + 1) as f64,
            _ => 0.0,
        }
    }
}
