//! Distances along a surface from points of it, by the heat method (Crane 2013).
//!
//! 1. (1 − t Δ_S) u = 0 with u = 1 at the sources and √t = 0.7 spacings: by Varadhan's formula φ = −√t ln u is about the distance.
//! 2. A distance has |∇_S φ| = 1. So Δ_S φ⁺ = ∇_S·(∇_S φ/|∇_S φ|) is solved, and again with φ⁺ for φ.
//!
//! Both systems are conservative, and the second side is Σ_j ℓ_ij (φ_j − φ_i)/g_ij, where g is the mean of |∇_S φ| at both points,
//! from fits. Points next to a source hold their distance along an arc, so that the kink at the source is in no fit that counts.

use super::cloud::SurfaceCloud;
use super::conservative;
use super::method::{Operators, Wanted};
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::LARGEST;
use crate::geometry::Vector;
use crate::linear_algebra::sparse_cholesky::SparseCholesky;
use crate::parallel::Interrupt;
use crate::point_clouds::StarGraph;
use crate::point_clouds::local_spacing::median;
use crate::schemes::measured_errors::against_exact;
use crate::simulation::quantity::quantities;
use crate::simulation::section::check_length;
use crate::simulation::{Check, Diagnostic, ErrorEntry, Finding, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

quantities! {
    /// Fields that frames show.
    FIELDS {
        DISTANCE = "distance", "length", "Distance along the surface from the nearest source; NaN before the first step, and on parts without a source.";
    }
}

/// The sources, and the distance from them.
#[derive(Debug)]
pub struct GeodesicDistance {
    /// Points that distances are measured from.
    sources: Vec<usize>,
    /// How far the places that were asked for are from these points, at most.
    farthest_source: f64,
    exact: Option<Vec<f64>>,
    distance: Vec<f64>,
    /// Whether each point lies on a part with a source; empty before the step.
    is_reached: Vec<bool>,
    /// Largest change in the last repetition, by the largest distance.
    change: f64,
    /// Median of ||∇φ| − 1| at the end: kinks, where ways meet, do not count.
    off_one: f64,
}

/// √t by the mean distance of points, and by the least one at most, as where a body is so long that u would underflow. Measured with
/// 4,000 points of a sphere and √t = 0.3, 0.5, 0.7, 1, 2 h: errors of 1.00, .77, .66, .54, .34 thousandths of the distance from one
/// point, and of 16, 9.9, 9.5, 12, 23 thousandths from two.
const SMOOTHING: f64 = 0.7;
const MOST_SMOOTHING: f64 = 1000.0;
/// Least u that has all its digits.
const LEAST_HEAT: f64 = 1e16 * f64::MIN_POSITIVE;
/// Points nearer to a source than this many local spacings hold their distance.
const HELD: f64 = 2.5;
/// Solutions of the second part. More of them trade smooth errors for rough ones where ways around a body meet.
const REPETITIONS: usize = 3;
/// |∇φ| is at least this, as where ways around a body meet.
const LEAST_SLOPE: f64 = 0.1;
/// Median of ||∇φ| − 1| above which a distance is doubtful. Measured on spheres: up to 1.2 % where the distance is off by 1.2 % at most, and 2.2 % and more
/// where it is by 2 to 5 %, as on independent random points. The mean does not tell them apart, since kinks count in it.
const ROUGH: f64 = 1.5e-2;
/// Places farther from the surface than this many local spacings are told.
const FAR: f64 = 3.0;

impl GeodesicDistance {
    /// Distances from the points of a cloud that are nearest to the given places. `exact` gives the distance between two points,
    /// where it is known.
    #[must_use]
    pub fn new<const D: usize>(
        places: &[Vector<D>],
        cloud: &SurfaceCloud<D>,
        exact: Option<impl Fn(&Vector<D>, &Vector<D>) -> f64>,
    ) -> Self {
        let points = &cloud.points[..cloud.rows];
        let nearest = |place: &Vector<D>| {
            let distances = points.iter().map(|x| (x - place).norm_squared()).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
        };
        let sources: Vec<usize> = places.iter().map(nearest).collect();
        let off = |(place, i): (&Vector<D>, &usize)| (points[*i] - place).norm() / cloud.spacings[*i];
        let farthest_source = places.iter().zip(&sources).map(off).fold(0.0, f64::max);
        let least = |exact: &dyn Fn(&Vector<D>, &Vector<D>) -> f64, x: &Vector<D>| {
            sources.iter().map(|source| exact(&points[*source], x)).fold(f64::INFINITY, f64::min)
        };
        let exact = exact.map(|exact| points.iter().map(|x| least(&exact, x)).collect());
        let distance = vec![0.0; cloud.rows];
        let is_reached = Vec::new();
        Self { sources, farthest_source, exact, distance, is_reached, change: f64::NAN, off_one: f64::NAN }
    }

    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields() -> Vec<&'static Quantity> {
        FIELDS.to_vec()
    }

    /// Points on parts without a source.
    fn unreached(&self) -> usize {
        self.is_reached.iter().filter(|is_reached| !**is_reached).count()
    }

    /// Distances of points next to sources, along arcs between their normals.
    fn held<const D: usize>(&self, cloud: &SurfaceCloud<D>) -> Vec<Option<f64>> {
        let mut held: Vec<Option<f64>> = vec![None; cloud.rows];
        for source in &self.sources {
            let radius = HELD * cloud.spacings[*source];
            let (from, normal) = (cloud.points[*source], cloud.normals[*source]);
            let (mut open, mut seen) = (vec![*source], std::collections::BTreeSet::from([*source]));
            while let Some(i) = open.pop() {
                let arc = arc(&(cloud.points[i] - from), &normal, &cloud.normals[i]);
                if arc > radius {
                    continue;
                }
                held[i] = Some(held[i].map_or(arc, |known| known.min(arc)));
                let next = cloud.graph.neighbors(i).iter().map(|j| *j as usize).filter(|j| seen.insert(*j));
                open.extend(next.collect::<Vec<usize>>());
            }
        }
        held
    }

    /// Both parts of the method. Nothing is kept once the interrupt is raised.
    fn find<const D: usize>(
        &mut self,
        cloud: &SurfaceCloud<D>,
        operators: &Operators,
        interrupt: &Interrupt,
    ) -> Result<(), String> {
        let graph = &cloud.graph;
        let held = self.held(cloud);
        let mut is_reached = vec![false; graph.part_count];
        self.sources.iter().for_each(|source| is_reached[graph.parts[*source] as usize] = true);
        let is_on = |i: usize| is_reached[graph.parts[i] as usize];
        let spacing = (graph.areas.iter().sum::<f64>() / cloud.rows as f64).powf(1.0 / (D - 1) as f64);
        let mut value = self.varadhan(graph, SMOOTHING * spacing, is_on, interrupt)?;
        let second = system(graph, 0.0, 1.0, |i| held[i].is_some() || !is_on(i))?;
        let mut next = vec![0.0; cloud.rows];
        for _ in 0..REPETITIONS {
            if interrupt.is_raised() {
                return Ok(());
            }
            let slopes = slopes(operators, &value);
            right_side(cloud, &held, (&value, &slopes), &mut next);
            second.solve_in_place(&mut next);
            let largest = (0..cloud.rows).filter(|i| is_on(*i)).fold(0.0_f64, |most, i| most.max(next[i]));
            let off = |i: usize| (next[i] - value[i]).abs();
            self.change = (0..cloud.rows).filter(|i| is_on(*i)).map(off).fold(0.0, f64::max) / largest;
            std::mem::swap(&mut value, &mut next);
        }
        let slopes = slopes(operators, &value);
        let mut off: Vec<f64> = (0..cloud.rows).filter(|i| is_on(*i)).map(|i| (slopes[i] - 1.0).abs()).collect();
        self.off_one = median(&mut off);
        if let Some(i) = (0..cloud.rows).find(|i| is_on(*i) && !value[*i].is_finite()) {
            return Err(format!("the distance of point {i} is not finite"));
        }
        self.is_reached = (0..cloud.rows).map(is_on).collect();
        for (i, distance) in self.distance.iter_mut().enumerate() {
            *distance = if is_on(i) { value[i] } else { f64::NAN };
        }
        Ok(())
    }

    /// −√t ln u with the least √t that is not less than a given one and leaves a positive number everywhere.
    fn varadhan(
        &self,
        graph: &StarGraph,
        least: f64,
        is_on: impl Fn(usize) -> bool,
        interrupt: &Interrupt,
    ) -> Result<Vec<f64>, String> {
        let mut length = least;
        loop {
            let mut value = self.heat(graph, length)?;
            if interrupt.is_raised() || (0..graph.len()).all(|i| value[i] > LEAST_HEAT || !is_on(i)) {
                value.iter_mut().for_each(|value| *value = -length * value.max(f64::MIN_POSITIVE).ln());
                return Ok(value);
            }
            if length > MOST_SMOOTHING * least {
                return Err("the heat does not reach all points of the parts that have a source".to_owned());
            }
            length *= 2.0;
        }
    }

    /// u of (1 − t Δ_S) u = 0 with u = 1 at the sources, for √t.
    fn heat(&self, graph: &StarGraph, length: f64) -> Result<Vec<f64>, String> {
        let mut mask = vec![false; graph.len()];
        self.sources.iter().for_each(|source| mask[*source] = true);
        let is_source = |i: usize| mask[i];
        let system = system(graph, 1.0, length * length, is_source)?;
        let mut value = vec![0.0; graph.len()];
        for source in &self.sources {
            value[*source] = 1.0;
            for (j, conductance) in graph.neighbors(*source).iter().zip(graph.conductances(*source)) {
                if !is_source(*j as usize) {
                    value[*j as usize] += length * length * conductance;
                }
            }
        }
        system.solve_in_place(&mut value);
        Ok(value)
    }
}

/// Length of the arc over a chord between points with these normals: chord · (α/2)/sin(α/2).
fn arc<const D: usize>(chord: &Vector<D>, n: &Vector<D>, m: &Vector<D>) -> f64 {
    let half = 0.5 * (n - m).norm();
    // 2 asin(half)/2 by half.
    let bend = if (1e-6..0.7).contains(&half) { half.asin() / half } else { 1.0 };
    chord.norm() * bend
}

/// A decomposition of A·`own` + `exchange`·Σ ℓ (x_i − x_j), with the identity in rows and columns of held points.
fn system(
    graph: &StarGraph,
    own: f64,
    exchange: f64,
    is_held: impl Fn(usize) -> bool,
) -> Result<SparseCholesky, String> {
    let rows = conservative::exchange_matrix(graph, |i| own * graph.areas[i], exchange, is_held);
    SparseCholesky::from_rows(&rows).map_err(|failed| failed.to_string())
}

/// |∇φ| at each point.
fn slopes(operators: &Operators, value: &[f64]) -> Vec<f64> {
    let (mut squares, mut component) = (vec![0.0; value.len()], vec![0.0; value.len()]);
    for operator in &operators.rows {
        operator.apply(value, &mut component);
        squares.iter_mut().zip(&component).for_each(|(square, c)| *square += c * c);
    }
    squares.iter().map(|square| square.sqrt()).collect()
}

/// −Σ_j ℓ_ij (φ_j − φ_i)/g_ij, with what held neighbors give; the values at held points.
fn right_side<const D: usize>(
    cloud: &SurfaceCloud<D>,
    held: &[Option<f64>],
    (value, slopes): (&[f64], &[f64]),
    out: &mut [f64],
) {
    let SurfaceCloud { points, graph, .. } = cloud;
    for (i, out) in out.iter_mut().enumerate() {
        *out = held[i].unwrap_or(0.0);
        if held[i].is_some() {
            continue;
        }
        for (j, conductance) in graph.neighbors(i).iter().zip(graph.conductances(i)) {
            let j = *j as usize;
            let slope = (0.5 * (slopes[i] + slopes[j])).max(LEAST_SLOPE);
            // Where ways around a body meet, the fitted slope is less than that of each side.
            let most = (points[i] - points[j]).norm();
            *out += conductance * (((value[i] - value[j]) / slope).clamp(-most, most) + held[j].unwrap_or(0.0));
        }
    }
}

impl<const D: usize> Problem<D> for GeodesicDistance {
    fn wanted(&self) -> Vec<Wanted> {
        (0..D).map(Wanted::Gradient).collect()
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { cloud, operators, interrupt, phases, to, .. } = tools;
        let found = phases.measure("solver/distances", || self.find(cloud, operators, interrupt));
        interrupt.check()?;
        found.map_err(|reason| StepError::Unsolved { reason, step: to.step, time: to.time })
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields()
    }

    fn column(&self, _quantity: &Quantity, clock: Clock) -> Vec<f64> {
        if clock.step == 0 { vec![f64::NAN; self.distance.len()] } else { self.distance.clone() }
    }

    fn watched(&self) -> Watched<'_> {
        // Points that are not reached have no number.
        watch([("distance", &[])])
    }

    fn errors(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        match &self.exact {
            Some(exact) if clock.step > 0 => {
                against_exact("distance", &self.distance, exact, clock.time, "exact distance of the points")
            }
            _ => Vec::new(),
        }
    }

    fn observables(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Observables {
        let reached = self.distance.iter().filter(|distance| !distance.is_nan());
        let largest = if clock.step == 0 { f64::NAN } else { reached.fold(0.0, |most, d| f64::max(most, *d)) };
        vec![(&LARGEST, largest)]
    }

    fn save(&self, section: &mut Section) {
        // A state has no numbers that are none.
        let known = |d: &f64| if d.is_nan() { 0.0 } else { *d };
        section.put_reals("distance", &self.distance.iter().map(known).collect::<Vec<_>>());
        section.put_counts("is_reached", self.is_reached.iter().map(|is_reached| u64::from(*is_reached)));
        section.put_optional("change", Some(self.change).filter(|change| change.is_finite()));
        section.put_optional("off_one", Some(self.off_one).filter(|off| off.is_finite()));
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let distance = section.reals_of("distance", self.distance.len())?;
        let (change, off_one) = (section.optional("change")?, section.optional("off_one")?);
        let is_reached = section.counts("is_reached")?.to_vec();
        if !is_reached.is_empty() {
            check_length("is_reached", is_reached.len(), distance.len())?;
        }
        self.is_reached = is_reached.iter().map(|is_reached| *is_reached > 0).collect();
        let known = |(i, d): (usize, &f64)| if self.is_reached.get(i) == Some(&false) { f64::NAN } else { *d };
        self.distance = distance.iter().enumerate().map(known).collect();
        (self.change, self.off_one) = (change.unwrap_or(f64::NAN), off_one.unwrap_or(f64::NAN));
        Ok(())
    }

    fn translate_format_1(&self, _arrays: &Section) -> Result<Section, LoadError> {
        // Format 1 had no such problem.
        Ok(Section::default())
    }

    fn checks(&self, _steps: u64) -> Vec<Check> {
        vec![Check::watched("slope_off_one", Some(self.off_one).filter(|off| off.is_finite()), "")]
    }

    fn findings(&self, clock: Clock) -> Vec<Finding> {
        let at = (clock.step, clock.time);
        let mut findings = Vec::new();
        let unreached = self.unreached();
        if unreached > 0 {
            let message = format!("{unreached} points lie on parts of the surface without a source");
            let finding = Finding::warning("unreached", message, at).with_count(unreached as u64);
            findings.push(finding.with_advice("a place in `from` on each part gives them a distance"));
        }
        if self.off_one > ROUGH {
            let message = format!(
                "the slope of the distance is off one by {:.1} % at half of the points (doubtful above {:.1} %), and the distance by about as much",
                100.0 * self.off_one,
                100.0 * ROUGH
            );
            let advice = "more points, or more even ones, help";
            findings.push(Finding::warning("rough_distance", message, at).with_advice(advice));
        }
        if self.farthest_source > FAR {
            let message = format!(
                "a place in `from` lies {:.1} local spacings from the nearest point, which distances are measured from",
                self.farthest_source
            );
            findings.push(Finding::warning("source_far", message, at));
        }
        findings
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        if self.change.is_nan() {
            return Vec::new();
        }
        vec![
            Diagnostic::new(
                "distance.change",
                self.change,
                "Largest change in the last repetition, by the largest distance.",
            ),
            Diagnostic::new("distance.slope_off_one", self.off_one, "Median of the difference of |grad| from one."),
            Diagnostic::count("distance.unreached", self.unreached() as u64, "Points on parts without a source."),
        ]
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let sources: Vec<String> = self.sources.iter().take(5).map(ToString::to_string).collect();
        let more = if self.sources.len() > 5 { ", …" } else { "" };
        method.insert("sources", format!("points {}{more}", sources.join(", ")));
    }
}
