//! The closest point of the front to a place, by a local reconstruction through the particles about it (GBPM 3.3.1 to 3.3.3).

use super::foot_points::{FootPoint, FootPoints};
use super::grid::Grid;
use super::local_graph::{GraphJet, LocalGraph, LocalPoint, MOST_ACROSS, PARAMETER, Terms, closest};
use super::method::FrontMethod;
use super::motion::Law;
use super::segments::{Segments, turned};
use super::topology::{height_over, may_pass};
use crate::geometry::Vector;
use crate::geometry::frame::Frame;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::neighbors::{CellList, Neighbor, NeighborSearch};

/// How far past its particles a reconstruction is trusted, in spacings, where particles are not exact by themselves: the paper's
/// zero loses the ends of thin filaments.
const MOST_EXTRAPOLATION: f64 = 0.3;
/// Cosine between the normal of the base point and that of the answer below which the graph has folded.
const LEAST_AGREEMENT: f64 = 0.2;
/// Cosine of normals within a stencil below which the front turns too much for the degree asked for.
const TURNED: f64 = 0.7;
/// The same where bends have a narrow quadratic, on a curve and on a surface.
const BENT: [f64; 2] = [0.9, 0.94];
/// How far from the nearest of its particles an answer may lie, in spacings: past the last of them, and between two.
const MOST_LONELY: f64 = 1.0;
/// How near the next particle of a segment is where it goes on, and those of a corner's two sides to each other, in spacings.
const AHEAD: f64 = 1.5;
const CORNER: f64 = 2.0;
/// 1/cos² of the angle from a way within which a particle is on it: along an edge of a body there always are some, which must not
/// stand for what lies beyond it.
const CONE: f64 = 1.4;
/// Normals whose cosine is smaller are those of the two sides of a thin sheet rather than of a corner, and those of one side
/// whose cosine is larger are of one that is straight there.
const OPPOSITE: f64 = -0.5;
const STRAIGHT: f64 = 0.8;
/// A distance from a particle that is none, in spacings.
const NO_WAY: f64 = 1e-3;
/// The largest |κ| h of a front that its particles resolve.
const SHARPEST: f64 = 2.0;
/// How far the directions of a graph may be from those of its particles, root mean square, where particles are exact by themselves:
/// whatever two sides of a sharp tip or the ends of a gap are made to share is not the front. On a curve, and on a surface.
const MOST_MISFIT: [f64; 2] = [0.05, 0.2];
/// Cosine between the normal of a particle and the upward direction below which it asks for no slope.
const STEEPEST: f64 = 0.2;
/// How far behind a segment still counts as on it, in spacings.
const NOTHING: f64 = 1e-6;
/// Segments that are tried at one place.
const MOST_SEGMENTS: usize = 3;
/// How much farther than the best answer so far the first particle of another segment may lie, in spacings.
const SEGMENT_MARGIN: f64 = 0.5;
/// How the neighbourhood grows.
const GROWTH: f64 = 1.4;

/// Why there is no foot-point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// Too few particles of one segment are near.
    Starved,
    /// The particles near do not determine a polynomial.
    Undetermined,
    /// The closest point lies beyond the particles, or past a corner.
    Extrapolated,
    /// The front turns too sharply for the spacing, or the polynomial has not the directions of its particles.
    Unresolved,
    /// The closest point lies behind another segment, its particles do not.
    Swept,
}

/// What a reconstruction reads.
pub(super) struct Reconstruction<'a, const D: usize, const M: usize> {
    pub feet: &'a FootPoints<D>,
    pub cells: &'a CellList<D>,
    pub method: &'a FrontMethod,
    /// Of the degree asked for, and of the quadratic that takes its place where that does not do.
    pub terms: &'a Terms<M>,
    pub quadratic: &'a Terms<M>,
    /// How segments are told apart beside their normals.
    pub segments: Segments,
    pub grid: Grid,
    pub law: &'a Law<D>,
    /// Whether nothing may be drawn from in front of another segment to behind it.
    pub merges: bool,
}

/// Storage of a thread.
#[derive(Debug)]
pub(super) struct Room<const D: usize, const M: usize> {
    near: Vec<Neighbor<D>>,
    chosen: Vec<usize>,
    bases: Vec<usize>,
    points: Vec<LocalPoint<M>>,
    slopes: Vec<Option<[f64; M]>>,
    squares: LeastSquares,
}

impl<const D: usize, const M: usize> Default for Room<D, M> {
    fn default() -> Self {
        Self {
            near: Vec::new(),
            chosen: Vec::new(),
            bases: Vec::new(),
            points: Vec::new(),
            slopes: Vec::new(),
            squares: LeastSquares::default(),
        }
    }
}

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// The closest point of the front to a place, that of a grid point of a level with some spacing or a particle of it.
    ///
    /// 1. The particles about p, nearest first. 2. The nearest is the base of a segment: the particles whose normals agree
    ///    with its own. 3. A reconstruction of the segment, and its closest point. 4. The same for the nearest particle that belongs to
    ///    no segment so far, as long as its segment may be nearer. The nearest answer wins.
    ///
    /// # Errors
    /// [`Failure`] of the nearest segment where none has an answer.
    pub fn closest(&self, p: &Vector<D>, spacing: f64, room: &mut Room<D, M>) -> Result<FootPoint<D>, Failure> {
        let first_reach = self.method.tube_radius + if M == 1 { 1.4 } else { 1.0 };
        let mut reach = first_reach * spacing;
        self.gather(p, reach, room);
        // About a new grid point of a finer level there are the particles of the coarser one.
        while room.near.is_empty() && reach < first_reach * self.grid.spacing {
            reach *= GROWTH;
            self.gather(p, reach, room);
        }
        room.bases.clear();
        let mut best: Result<(f64, FootPoint<D>), Failure> = Err(Failure::Starved);
        for segment in 0..MOST_SEGMENTS {
            let next = room.near.iter().find(|near| !room.bases.iter().any(|base| self.agrees(*base, near.index)));
            let Some(base) = next.copied() else { break };
            if let Ok((distance, _)) = best
                && base.r2.sqrt() > distance + SEGMENT_MARGIN * spacing
            {
                break;
            }
            room.bases.push(base.index);
            let unit = spacing.max(self.grid.spacing_of(self.feet.nodes[base.index]));
            let found = self.of_segment(p, base.index, unit, &mut reach, room);
            match found {
                Ok(foot) => {
                    let distance = (foot.position - p).norm();
                    if best.as_ref().map_or(true, |(nearest, _)| distance < *nearest) {
                        best = Ok((distance, foot));
                    }
                }
                Err(failure) if segment == 0 => best = Err(failure),
                Err(_) => {}
            }
        }
        best.map(|(_, foot)| foot)
    }

    /// Whether two particles are of one segment (GBPM 3.3.2).
    pub fn agrees(&self, i: usize, j: usize) -> bool {
        self.segments.match_labels(self.feet, i, j)
            && self.feet.normals[i].dot(&self.feet.normals[j]) > self.method.cosine
    }

    fn gather(&self, p: &Vector<D>, reach: f64, room: &mut Room<D, M>) {
        self.cells.gather(p, reach, &mut room.near);
        room.near.sort_unstable_by(|a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
    }

    /// Particles of the segment of a base, nearest first, each some way from those taken before.
    fn choose(&self, base: usize, number: usize, unit: f64, room: &mut Room<D, M>) {
        let least = (self.method.min_separation * unit).powi(2);
        room.chosen.clear();
        room.chosen.push(base);
        for near in &room.near {
            if room.chosen.len() >= number {
                return;
            }
            let x = &self.feet.positions[near.index];
            let is_apart = |j: &usize| (self.feet.positions[*j] - x).norm_squared() >= least;
            if near.index != base && self.agrees(base, near.index) && room.chosen.iter().all(is_apart) {
                room.chosen.push(near.index);
            }
        }
    }

    /// The closest point of one segment, in units of the coarser spacing of grid point and base: with more particles where
    /// those taken do not determine the polynomial well, as on two rows of a lattice, and then by a quadratic. Under motion by
    /// curvature a bend that the stencil does not resolve gets a quadratic of the nearest of them at once.
    fn of_segment(
        &self,
        p: &Vector<D>,
        base: usize,
        unit: f64,
        reach: &mut f64,
        room: &mut Room<D, M>,
    ) -> Result<FootPoint<D>, Failure> {
        let (mut terms, mut least) = (self.terms, self.method.neighbors);
        self.take(p, base, (least, unit), reach, room);
        let is_wide = terms.count() > self.quadratic.count();
        if let Some(number) = self.law.particles_in_bends().filter(|_| is_wide)
            && self.straightest(base, room) < BENT[M - 1]
        {
            (terms, least) = (self.quadratic, number);
            room.chosen.truncate(least);
        }
        let mut number = least;
        loop {
            let found = self.with_particles(p, base, terms, unit, room);
            number += least.div_ceil(2);
            if found != Err(Failure::Undetermined) {
                return found;
            }
            if number > 2 * least {
                break;
            }
            self.take(p, base, (number, unit), reach, room);
        }
        if terms.count() == self.quadratic.count() {
            return Err(Failure::Undetermined);
        }
        // At the end of a segment particles of one side determine a quadratic still.
        self.take(p, base, (least, unit), reach, room);
        self.with_particles(p, base, self.quadratic, unit, room)
    }

    /// The least cosine between the normal of the base and those of the particles chosen.
    fn straightest(&self, base: usize, room: &Room<D, M>) -> f64 {
        let normals = &self.feet.normals;
        room.chosen.iter().map(|j| normals[*j].dot(&normals[base])).fold(1.0, f64::min)
    }

    /// Chooses so many particles, from farther away where too few are near.
    fn take(&self, p: &Vector<D>, base: usize, (number, unit): (usize, f64), reach: &mut f64, room: &mut Room<D, M>) {
        loop {
            self.choose(base, number, unit, room);
            if room.chosen.len() >= number || *reach * GROWTH > self.law.farthest_search() * unit {
                return;
            }
            *reach *= GROWTH;
            self.gather(p, *reach, room);
        }
    }

    fn with_particles(
        &self,
        p: &Vector<D>,
        base: usize,
        terms: &Terms<M>,
        unit: f64,
        room: &mut Room<D, M>,
    ) -> Result<FootPoint<D>, Failure> {
        if room.chosen.len() < self.quadratic.count() {
            return Err(Failure::Starved);
        }
        let normals = &self.feet.normals;
        let mut first = Err(Failure::Unresolved);
        if self.straightest(base, room) > TURNED {
            first = self.fit(p, base, (&normals[base], terms), unit, room);
            if first.is_ok() || first == Err(Failure::Undetermined) {
                return first;
            }
        }
        // Where the front turns within the stencil, its mean normal is the better upward direction, and less is known of it.
        let mean: Vector<D> = room.chosen.iter().map(|j| normals[*j]).sum();
        let Some(mean) = mean.try_normalize(0.1) else { return first };
        self.fit(p, base, (&mean, self.quadratic), unit, room).or(first)
    }

    /// One fit in the frame of a direction.
    fn fit(
        &self,
        p: &Vector<D>,
        base: usize,
        (direction, terms): (&Vector<D>, &Terms<M>),
        unit: f64,
        room: &mut Room<D, M>,
    ) -> Result<FootPoint<D>, Failure> {
        if D - M == 1 {
            self.fit_across::<1>(p, base, (&Frame::from_normal(direction), terms), unit, room)
        } else {
            self.fit_across::<MOST_ACROSS>(p, base, (&Frame::from_tangent(direction), terms), unit, room)
        }
    }

    /// The same with C = D − M directions across the front.
    fn fit_across<const C: usize>(
        &self,
        p: &Vector<D>,
        base: usize,
        (frame, terms): (&Frame<D, M, C>, &Terms<M>),
        unit: f64,
        room: &mut Room<D, M>,
    ) -> Result<FootPoint<D>, Failure> {
        let origin = self.feet.positions[base];
        let inverse = 1.0 / unit;
        let local = |x: &Vector<D>| -> LocalPoint<M> {
            let d = (x - origin) * inverse;
            let mut point: LocalPoint<M> = (frame.tangents.map(|t| t.dot(&d)), Default::default());
            for (height, up) in point.1.iter_mut().zip(&frame.normals) {
                *height = up.dot(&d);
            }
            point
        };
        let parameters = &self.feet.parameters;
        room.points.clear();
        room.points.extend(room.chosen.iter().map(|j| {
            let mut point = local(&self.feet.positions[*j]);
            point.1[PARAMETER] = turned(parameters[*j] - parameters[base]);
            point
        }));
        self.note_slopes(frame, room);
        let slopes = (&room.slopes[..], self.method.normal_weight);
        let mut graphs = [terms.nothing(); C];
        for (c, graph) in graphs.iter_mut().enumerate() {
            let fitted = terms.fit(&room.points, c, self.method.weight, slopes, &mut room.squares);
            *graph = fitted.ok_or(Failure::Undetermined)?;
        }
        let (across, heights) = local(p);
        let heights: [f64; C] = std::array::from_fn(|c| heights[c]);
        let start = inside(&across, &room.points);
        let (s, jets) = closest(&graphs, &across, &heights, start).ok_or(Failure::Unresolved)?;
        let beyond = extrapolation(&s, &room.points);
        // Where every particle is exact by itself the last ones are the ends of their segments, corners and tips.
        let most = if self.law.keeps_particles_exact() { 0.0 } else { MOST_EXTRAPOLATION };
        if beyond > most {
            return Err(Failure::Extrapolated);
        }
        let shape = shape_of(frame, &jets);
        let is_sharp = shape.sharpest > SHARPEST || shape.sharpest.is_nan();
        if is_sharp || shape.direction.dot(&self.feet.normals[base]) < LEAST_AGREEMENT {
            return Err(Failure::Unresolved);
        }
        let mut position = origin;
        for (up, jet) in frame.normals.iter().zip(&jets) {
            position += up * (jet.value * unit);
        }
        for (t, s) in frame.tangents.iter().zip(s) {
            position += t * (s * unit);
        }
        let most = if beyond > 0.0 { MOST_LONELY } else { self.law.widest_bridge() };
        let square = |j: usize| (self.feet.positions[j] - position).norm_squared();
        let is_nearer = |a: &usize, b: &usize| square(*a).total_cmp(&square(*b));
        let nearest = room.chosen.iter().copied().min_by(is_nearer).unwrap_or(base);
        let is_lonely = square(nearest) > (most * unit).powi(2);
        if is_lonely || (self.law.keeps_particles_exact() && self.is_past_corner(nearest, &position, unit, room)) {
            return Err(Failure::Extrapolated);
        }
        if self.law.keeps_particles_exact() && self.misfit(frame, &graphs, room) > MOST_MISFIT[M - 1] {
            return Err(Failure::Unresolved);
        }
        if self.merges && self.passes_another(base, &position, room) {
            return Err(Failure::Swept);
        }
        // Lagrangian quantities are carried by the same fit (GBPM 3.3.3).
        let mut parameter = parameters[base];
        if self.segments.parameter.is_some() {
            let fitted = terms.fit(&room.points, PARAMETER, self.method.weight, (&[], 0.0), &mut room.squares);
            parameter = (parameter + fitted.ok_or(Failure::Undetermined)?.jet(&s).value).rem_euclid(1.0);
        }
        let (curvature, gauss_curvature) = (shape.curvature / unit, shape.gauss_curvature / (unit * unit));
        let part = self.feet.parts[base];
        Ok(FootPoint { position, normal: shape.direction, curvature, gauss_curvature, part, parameter })
    }
}

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// Whether a place lies ahead of the last particle of its segment at a corner, where the front goes on round it: what is there
    /// is an opening, which nothing may bridge.
    fn is_past_corner(&self, last: usize, place: &Vector<D>, unit: f64, room: &Room<D, M>) -> bool {
        let (x, n) = (&self.feet.positions[last], &self.feet.normals[last]);
        let way = place - x;
        let length = way.norm();
        let is_ahead = |j: usize| {
            let d = self.feet.positions[j] - x;
            let (along, square) = (d.dot(&way), d.norm_squared());
            let is_on_the_way = CONE * along * along >= square * length * length;
            along > 0.0 && is_on_the_way && square <= (AHEAD * unit).powi(2)
        };
        if length < NO_WAY * unit || room.chosen.iter().any(|j| is_ahead(*j)) {
            return false;
        }
        let order = self.cells.permutation();
        let cosine = |place: usize| self.feet.normals[order[place]].dot(n);
        let goes_on = |place: usize| is_ahead(order[place]) && self.agrees(last, order[place]);
        let is_other_side = |place: usize| OPPOSITE < cosine(place) && cosine(place) <= self.method.cosine;
        // The tip of a filament has all directions, a corner those of its sides alone. The edge of a sheet counts as one.
        let is_between = |place: usize| self.method.cosine < cosine(place) && cosine(place) < STRAIGHT;
        !self.cells.any_within(x, AHEAD * unit, goes_on)
            && self.cells.any_within(x, CORNER * unit, is_other_side)
            && (M > 1 || !self.cells.any_within(x, CORNER * unit, is_between))
    }

    /// The slopes that the normals of the chosen particles ask of a graph, where they take part.
    fn note_slopes<const C: usize>(&self, frame: &Frame<D, M, C>, room: &mut Room<D, M>) {
        room.slopes.clear();
        if C > 1 || self.method.normal_weight == 0.0 {
            return;
        }
        room.slopes.extend(room.chosen.iter().map(|j| {
            let n = &self.feet.normals[*j];
            let up = frame.normals[0].dot(n);
            (up > STEEPEST).then(|| frame.tangents.map(|t| -t.dot(n) / up))
        }));
    }

    /// √(Σ w |n_graph − n|² / Σ w) over the particles of a fit, with its weights.
    fn misfit<const C: usize>(
        &self,
        frame: &Frame<D, M, C>,
        graphs: &[LocalGraph<'_, M>; C],
        room: &Room<D, M>,
    ) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (j, (s, _)) in room.chosen.iter().zip(&room.points) {
            let weight = (-self.method.weight * s.iter().map(|s| s * s).sum::<f64>()).exp();
            let jets = std::array::from_fn(|c| graphs[c].jet(s));
            sum += weight * (shape_of(frame, &jets).direction - self.feet.normals[*j]).norm_squared();
            weights += weight;
        }
        (sum / weights).sqrt()
    }
}

/// Direction and curvatures at a point of a front, lengths in units.
struct LocalShape<const D: usize> {
    /// The normal of a surface, the tangent of a curve in space.
    direction: Vector<D>,
    curvature: f64,
    gauss_curvature: f64,
    /// The largest principal curvature by absolute value.
    sharpest: f64,
}

fn shape_of<const D: usize, const M: usize, const C: usize>(
    frame: &Frame<D, M, C>,
    jets: &[GraphJet<M>; C],
) -> LocalShape<D> {
    let jet = &jets[0];
    if C == 1 {
        let (flat, rise) = jet.normal();
        let mut direction = frame.normals[0] * rise;
        for (t, part) in frame.tangents.iter().zip(flat) {
            direction += t * part;
        }
        let (curvature, gauss_curvature) = (jet.curvature(), jet.gauss_curvature());
        return LocalShape { direction, curvature, gauss_curvature, sharpest: jet.sharpest() };
    }
    // r′ = (1, f′), r″ = (0, f″); κ = |r″ across r′|/|r′|².
    let mut direction = frame.tangents[0];
    let mut bend = Vector::<D>::zeros();
    for (up, jet) in frame.normals.iter().zip(jets) {
        direction += up * jet.first[0];
        bend += up * jet.second[0][0];
    }
    let square = direction.norm_squared();
    bend -= direction * (bend.dot(&direction) / square);
    let curvature = bend.norm() / square;
    LocalShape { direction: direction / square.sqrt(), curvature, gauss_curvature: 0.0, sharpest: curvature }
}

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// Whether another segment lies between a particle and a place on its own.
    fn passes_another(&self, base: usize, place: &Vector<D>, room: &Room<D, M>) -> bool {
        let start = &self.feet.positions[base];
        room.near.iter().map(|near| near.index).filter(|j| may_pass(self.feet, base, *j, self.method.cosine)).any(|j| {
            let spacing = self.grid.spacing_of(self.feet.nodes[j]);
            let ahead = |x| {
                height_over(self.feet, j, x, spacing).map(|height| height * self.law.facing(self.feet.curvatures[j]))
            };
            let (Some(from), Some(to)) = (ahead(start), ahead(place)) else { return false };
            from >= -NOTHING * spacing && to < -NOTHING * spacing && to < from
        })
    }
}

/// A place within the box of the points.
fn inside<const M: usize>(s: &[f64; M], points: &[LocalPoint<M>]) -> [f64; M] {
    std::array::from_fn(|a| {
        let (low, high) = points.iter().fold((0.0_f64, 0.0_f64), |(l, h), (x, _)| (l.min(x[a]), h.max(x[a])));
        s[a].clamp(low, high)
    })
}

/// How far s lies outside the points, seen from their middle.
fn extrapolation<const M: usize>(s: &[f64; M], points: &[LocalPoint<M>]) -> f64 {
    let share = 1.0 / points.len().max(1) as f64;
    let mut way = *s;
    for (x, _) in points {
        for (way, x) in way.iter_mut().zip(x) {
            *way -= share * x;
        }
    }
    let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
    if length == 0.0 {
        return 0.0;
    }
    let along = |x: &[f64; M]| x.iter().zip(&way).map(|(x, w)| x * w).sum::<f64>() / length;
    let farthest = points.iter().fold(f64::NEG_INFINITY, |most, (x, _)| most.max(along(x)));
    along(s) - farthest
}
