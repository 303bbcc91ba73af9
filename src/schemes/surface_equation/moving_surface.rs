//! ∂•u + u ∇_S·v = d Δ_S u on a surface that moves with v, where ∂• is the rate at a point that goes along.
//!
//! Every point carries the mass m_i = A_i u_i of its [`MaterialCells`]; what neighbors exchange is d ℓ_ij (u_j − u_i) with the
//! conductances of the stars where the points are now. So Σ A u is kept to rounding. Masses are advanced by the second backward
//! differentiation formula, begun with a backward Euler step.

use super::advection::Course as ExactCourse;
use super::cloud::SurfaceCloud;
use super::conservative;
use super::material_cells::MaterialCells;
use super::motion::Motion;
use super::quantities::{INTEGRAL, LARGEST, LEAST, NORMAL, REFERENCE, TIME, VALUE};
use super::solver::{LinearSystem, Solver, Workspace};
use crate::geometry::Vector;
use crate::linear_algebra::krylov::Stopping;
use crate::parallel::Interrupt;
use crate::point_clouds::StarGraph;
use crate::point_clouds::local_spacing::{self, Nearest};
use crate::point_clouds::stars::{CANDIDATES, Stars, refined_normals};
use crate::point_clouds::triangulation::triangles;
use crate::schemes::measured_errors::{against_exact, entry};
use crate::simulation::course::check_finite;
use crate::simulation::quantity::quantities;
use crate::simulation::section::check_length;
use crate::simulation::{
    Check, Course, CpuClock, Diagnostic, ErrorEntry, Fields, Finding, Health, LoadError, Mark, Observables, Phases,
    Region, Report, Section, Selection, Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

quantities! {
    /// Scalars of the series that only moving surfaces have.
    pub OBSERVABLES {
        AREA = "area", "length^2", "Area of the cells of all points; length on a curve.";
    }
}

/// A field that diffuses on a surface in motion.
pub struct MovingSurface<const D: usize> {
    parts: MovingParts<D>,
    points: Vec<Vector<D>>,
    normals: Vec<Vector<D>>,
    /// Stars where the points are now.
    graph: StarGraph,
    cells: MaterialCells,
    areas: Vec<f64>,
    values: Vec<f64>,
    /// Masses before the last step.
    previous: Vec<f64>,
    triangles: Vec<[u32; 3]>,
    initial_integral: f64,
    /// Integral of |u| at the start.
    initial_size: f64,
    /// Open stars at the start.
    initial_open: usize,
    /// Largest by least area of a cell at the start.
    initial_unevenness: f64,
    iterations: u64,
    workspace: Workspace,
    /// What a solver left of the integral of each part, and its area, a buffer.
    defects: Vec<[f64; 2]>,
    interrupt: Interrupt,
    origin: Option<String>,
    marks: Vec<Mark>,
    preparation: Vec<Diagnostic>,
    course: Course,
}

/// What moves, and how.
pub struct MovingParts<const D: usize> {
    /// The motion of the points.
    pub motion: Motion<D>,
    /// d.
    pub diffusivity: f64,
    /// The exact field later on, where it is known.
    pub exact: Option<ExactCourse>,
}

/// How the systems of steps are solved.
const STOPPING: Stopping = Stopping { tolerance: 1e-12, max_iterations: 5000 };
/// Open stars beyond those at the start, by the number of points, above which a surface counts as torn.
const TORN: f64 = 1e-2;
/// Change of Σ A u by Σ A |u| that is more than rounding.
const MOST_DRIFT: f64 = 1e-9;
/// Share of the pieces of the surface that may be turned inside out.
const MOST_TURNED: f64 = 1e-2;
/// Largest by least area of a cell, by that at the start, above which points are too uneven.
const UNEVEN: f64 = 100.0;

/// Normals, stars and their graph of points whose normals are about the given ones.
fn look<const D: usize>(
    points: &[Vector<D>],
    normals: Vec<Vector<D>>,
    rounds: usize,
) -> (Vec<Vector<D>>, Stars, StarGraph) {
    let nearest = Nearest::new(points, CANDIDATES[D - 2]);
    let spacings = local_spacing::smoothed::<D>(&local_spacing::at_each_point(points, &nearest), &nearest);
    let normals = refined_normals(points, &nearest, normals, &spacings, rounds);
    let stars = Stars::new(points, &nearest, &normals, &spacings);
    let graph = StarGraph::new(&stars);
    (normals, stars, graph)
}

/// Largest by least area of a cell.
fn unevenness(areas: &[f64]) -> f64 {
    let extremes = |(least, most): (f64, f64), area: &f64| (least.min(*area), most.max(*area));
    let (least, most) = areas.iter().fold((f64::INFINITY, 0.0), extremes);
    most / least
}

/// Pieces of a curve between neighbors.
fn pieces(graph: &StarGraph) -> Vec<[u32; 3]> {
    let of = |i: usize| {
        let later = graph.neighbors(i).iter().filter(move |j| **j as usize > i);
        later.map(move |j| [i as u32, *j, *j])
    };
    (0..graph.len()).flat_map(of).collect()
}

impl<const D: usize> MovingSurface<D> {
    /// A field at the start on a cloud without images.
    #[must_use]
    pub fn new(
        cloud: SurfaceCloud<D>,
        values: Vec<f64>,
        parts: MovingParts<D>,
        fixed: FixedStep,
        interrupt: Interrupt,
        cpu_clock: CpuClock,
    ) -> Self {
        let SurfaceCloud { points, normals, triangles: given, .. } = cloud;
        let (normals, stars, graph) = look(&points, normals, 0);
        let triangles = if given.is_empty() { triangles(&points, &normals, &stars) } else { given };
        let pieces = if D == 2 { pieces(&graph) } else { triangles.clone() };
        let cells = MaterialCells::new((&points, &normals), &graph.areas, pieces);
        let areas = cells.areas(&points);
        let initial_integral = areas.iter().zip(&values).map(|(area, value)| area * value).sum();
        let initial_size: f64 = areas.iter().zip(&values).map(|(area, value)| area * value.abs()).sum();
        Self {
            previous: areas.iter().zip(&values).map(|(area, value)| area * value).collect(),
            initial_size: initial_size.max(f64::MIN_POSITIVE),
            initial_integral,
            initial_open: graph.open_count(),
            initial_unevenness: unevenness(&areas),
            parts,
            points,
            normals,
            graph,
            cells,
            areas,
            values,
            triangles,
            iterations: 0,
            workspace: Workspace::default(),
            defects: Vec::new(),
            interrupt,
            origin: None,
            marks: Vec::new(),
            preparation: Vec::new(),
            course: Course::new(fixed.into(), Phases::new(cpu_clock), BTreeMap::new()),
        }
    }

    /// The same on points from outside: what they are, what was found, and what was counted.
    #[must_use]
    pub fn on_points(
        mut self,
        origin: String,
        (findings, marks): (Vec<Finding>, Vec<Mark>),
        counted: Vec<Diagnostic>,
    ) -> Self {
        (self.origin, self.course.findings, self.marks, self.preparation) = (Some(origin), findings, marks, counted);
        self
    }

    /// Every field that frames of this scheme show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(has_reference: bool) -> Vec<&'static crate::simulation::Quantity> {
        if has_reference { vec![&VALUE, &REFERENCE] } else { vec![&VALUE] }
    }

    /// Moves the points, and looks at the stars where they are then.
    fn advance(&mut self, from: Clock, to: Clock) -> Result<(), StepError> {
        let Self { parts, points, normals, interrupt, .. } = self;
        let step = to.time - from.time;
        let moved = match &parts.motion {
            Motion::Normal { speed } => {
                // The mean of the normals at both ends.
                let guess: Vec<Vector<D>> =
                    points.iter().zip(normals.iter()).map(|(x, n)| x + n * (speed * step)).collect();
                let (later, ..) = look(&guess, normals.clone(), 1);
                let along = normals.iter().zip(&later).map(|(n, m)| (n + m) * (0.5 * speed * step));
                points.iter().zip(along).map(|(x, d)| x + d).collect()
            }
            motion => {
                let moved = motion.moved(points, from.time, step, interrupt);
                moved.map_err(|error| StepError::from_path(error, to))?
            }
        };
        let (later, _, graph) = look(&moved, std::mem::take(normals), 1);
        (self.points, self.normals, self.graph) = (moved, later, graph);
        self.areas = self.cells.areas(&self.points);
        Ok(())
    }

    /// A step of the formula (3 m⁺ − 4 m + m⁻)/2Δt = d L⁺ u⁺ with m = A u.
    fn diffuse(&mut self, from: Clock, to: Clock) -> Result<(), StepError> {
        let is_first = from.step == 0;
        let masses = self.mass();
        let right: Vec<f64> = if is_first {
            masses.clone()
        } else {
            masses.iter().zip(&self.previous).map(|(now, before)| (4.0 * now - before) / 3.0).collect()
        };
        self.previous = masses;
        self.advance(from, to)?;
        let share = if is_first { 1.0 } else { 2.0 / 3.0 } * (to.time - from.time) * self.parts.diffusivity;
        self.solve(share, &right, to)
    }

    fn mass(&self) -> Vec<f64> {
        self.areas.iter().zip(&self.values).map(|(area, value)| area * value).collect()
    }

    /// Solves (A − share L) u = right.
    fn solve(&mut self, share: f64, right: &[f64], to: Clock) -> Result<(), StepError> {
        let Self { graph, areas, values, interrupt, workspace, .. } = self;
        let rows = conservative::exchange_matrix(graph, |i| areas[i], share, |_| false);
        let unsolved = |reason: String| StepError::Unsolved { reason, step: to.step, time: to.time };
        let mut system = LinearSystem::new(rows, None, Solver::Cg(STOPPING), true).map_err(unsolved)?;
        let found = system.solve(right, values, interrupt, workspace);
        interrupt.check()?;
        self.iterations += found.map_err(unsolved)?.iterations;
        conservative::keep_integrals(&self.graph, &self.areas, right, &mut self.values, &mut self.defects);
        Ok(())
    }

    fn drift(&self) -> f64 {
        (self.mass().iter().sum::<f64>() - self.initial_integral).abs() / self.initial_size
    }

    /// Largest by least area of a cell, by that at the start.
    fn unevenness(&self) -> f64 {
        unevenness(&self.areas) / self.initial_unevenness
    }

    /// Open stars beyond those at the start, by the number of points.
    fn torn(&self) -> f64 {
        self.graph.open_count().saturating_sub(self.initial_open) as f64 / self.points.len() as f64
    }

    fn errors(&self) -> Vec<ErrorEntry> {
        let time = self.clock().time;
        let mut errors = Vec::new();
        if let Some(exact) = &self.parts.exact {
            errors = against_exact("value", &self.values, &exact(time), time, "exact solution at the points");
        }
        errors.push(entry("mass", "relative", self.drift(), time, "the integral at the start, by that of |u|"));
        errors
    }
}

impl<const D: usize> Simulation for MovingSurface<D> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    fn advance(&mut self) -> Result<(), StepError> {
        let (from, to) = (self.course.clock(), self.course.next());
        let (torn, uneven) = (self.torn(), self.unevenness());
        let seconds = self.course.phases.clock();
        let begin = seconds();
        let done = self.diffuse(from, to);
        self.course.phases.book("evolution", seconds() - begin);
        done?;
        self.interrupt.check()?;
        check_finite("value", &self.values, to)?;
        check_finite("area", &self.areas, to)?;
        let turned = self.cells.turned(&self.points, &self.normals);
        if turned > MOST_TURNED {
            let reason = format!(
                "{:.1} % of the triangles of the surface are turned inside out: it passes through itself, or a step is too long",
                100.0 * turned
            );
            return Err(StepError::Unsolved { reason, step: to.step, time: to.time });
        }
        if self.torn() > TORN && torn <= TORN {
            let open = self.graph.open_count();
            let message =
                format!("{open} points have neighbors on one side alone: the surface is stretched too far for them");
            let finding = Finding::warning("torn", message, (to.step, to.time));
            self.course
                .findings
                .push(finding.with_count(open as u64).with_advice("more points, or a shorter run, help"));
        }
        if self.unevenness() > UNEVEN && uneven <= UNEVEN {
            let message =
                format!("the largest cell by the least one is {:.0} times what it was at the start", self.unevenness());
            let finding = Finding::warning("uneven", message, (to.step, to.time));
            self.course
                .findings
                .push(finding.with_advice("points that crowd in one place leave few for others; more points help"));
        }
        self.course.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let extreme = |start: f64, choose: fn(f64, f64) -> f64| self.values.iter().copied().fold(start, choose);
        vec![
            (&TIME, self.clock().time),
            (&INTEGRAL, self.mass().iter().sum()),
            (&LEAST, extreme(f64::INFINITY, f64::min)),
            (&LARGEST, extreme(f64::NEG_INFINITY, f64::max)),
            (&AREA, self.areas.iter().sum()),
        ]
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        let mut fields = Fields::new(&self.points, selection);
        fields.scalar(&VALUE, || self.values.clone());
        if let Some(exact) = &self.parts.exact {
            fields.scalar(&REFERENCE, || exact(self.clock().time));
        }
        fields.vector(&NORMAL, || self.normals.iter().copied());
        fields.particle_id();
        fields.marks.clone_from(&self.marks);
        fields.triangles.clone_from(&self.triangles);
        fields
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_vectors("positions", &self.points);
        state.put_vectors("normals", &self.normals);
        state.put_reals("value", &self.values);
        state.put_reals("previous", &self.previous);
        state.put_count("iterations", self.iterations);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let count = self.points.len();
        let (positions, normals) = (state.vectors::<D>("positions")?, state.vectors::<D>("normals")?);
        check_length("positions", positions.len(), count)?;
        check_length("normals", normals.len(), count)?;
        let (values, previous) = (state.reals_of("value", count)?, state.reals_of("previous", count)?);
        let iterations = state.count("iterations")?;
        self.values.copy_from_slice(values);
        self.previous.copy_from_slice(previous);
        // Stars are a function of points and normals.
        let (normals, _, graph) = look(&positions, normals, 0);
        (self.points, self.normals, self.graph, self.iterations) = (positions, normals, graph, iterations);
        self.areas = self.cells.areas(&self.points);
        if clock.step > 0 {
            // They were told at the start.
            self.course.findings.clear();
        }
        self.course.step = clock.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let mut method = BTreeMap::from([
            ("operator", "conservative, on the stars of each step".to_owned()),
            ("motion", self.parts.motion.name()),
            ("integrator", format!("BDF2, {} iterations", self.iterations)),
        ]);
        method.extend(self.origin.iter().map(|origin| ("points", origin.clone())));
        let mut diagnostics = self.preparation.clone();
        diagnostics.push(Diagnostic::count(
            "solver.iterations",
            self.iterations,
            "Iterations of the solver in all steps.",
        ));
        diagnostics.push(Diagnostic::new(
            "cells.unevenness",
            self.unevenness(),
            "Largest by least area of a cell, by that at the start.",
        ));
        Report { errors: self.errors(), health: self.health(), diagnostics, method }
    }

    fn health(&self) -> Health {
        let finite = self.values.iter().all(|value| value.is_finite());
        let checks = vec![
            Check::at_most("mass_drift", Some(self.drift()), MOST_DRIFT, ""),
            Check::watched("torn_share", Some(self.torn()), ""),
            Check::watched("unevenness", Some(self.unevenness()), ""),
        ];
        Health { finite, max_cfl: 0.0, volume_drift: None, checks }
    }

    fn weights(&self, region: Region) -> Option<Vec<f64>> {
        matches!(region, Region::All | Region::Surface).then(|| self.areas.clone())
    }

    fn particle_count(&self) -> usize {
        self.points.len()
    }
}
