//! One fit of the particles of a segment over a frame, and the closest point on it.

use super::{Failure, Outcome, Reconstruction, Segment, TUNING, Workspace};
use crate::geometry::Vector;
use crate::geometry::frame::Frame;
use crate::schemes::grid_based_particle::foot_points::FootPoint;
use crate::schemes::grid_based_particle::local_graph::{
    FitData, GraphJet, LocalGraph, LocalPoint, PARAMETER, Terms, closest,
};
use crate::schemes::grid_based_particle::local_shape::LocalShape;
use crate::schemes::grid_based_particle::segments::shorter_difference;
use crate::schemes::grid_based_particle::support::{clamp_to_box, extrapolation};

/// Coordinates along a frame and across it, with an origin and a unit of length.
pub(super) struct LocalCoordinates<'a, const D: usize, const M: usize, const C: usize> {
    pub origin: Vector<D>,
    pub unit: f64,
    /// 1/unit.
    pub inverse: f64,
    pub frame: &'a Frame<D, M, C>,
}

impl<const D: usize, const M: usize, const C: usize> LocalCoordinates<'_, D, M, C> {
    /// The local coordinates of a place.
    fn local(&self, x: &Vector<D>) -> LocalPoint<M> {
        let d = (x - self.origin) * self.inverse;
        let mut point: LocalPoint<M> = (self.frame.tangents.map(|t| t.dot(&d)), Default::default());
        for (height, up) in point.1.iter_mut().zip(&self.frame.normals) {
            *height = up.dot(&d);
        }
        point
    }

    /// The place of a point of the graph.
    fn position(&self, s: &[f64; M], jets: &[GraphJet<M>; C]) -> Vector<D> {
        let mut position = self.origin;
        for (up, jet) in self.frame.normals.iter().zip(jets) {
            position += up * (jet.value * self.unit);
        }
        for (t, s) in self.frame.tangents.iter().zip(s) {
            position += t * (s * self.unit);
        }
        position
    }
}

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// The closest point of a segment by one fit, with C = D − M directions across the front.
    ///
    /// 1. Write the chosen particles in local coordinates. 2. Fit a polynomial for each direction across. 3. Find the closest
    ///    point of their graph. 4. Check that it can be trusted. 5. Fit the parameter, where particles carry one.
    pub(super) fn fit_over<const C: usize>(
        &self,
        segment: &Segment<'_, D>,
        frame: &Frame<D, M, C>,
        terms: &Terms<M>,
        workspace: &mut Workspace<D, M>,
    ) -> Outcome<D> {
        let (base, unit) = (segment.base, segment.unit);
        let coordinates = LocalCoordinates { origin: self.feet.positions[base], unit, inverse: 1.0 / unit, frame };
        self.localize(segment, &coordinates, workspace);
        let graphs = self.fit_graphs::<C>(terms, workspace)?;
        let (along, heights) = coordinates.local(segment.place);
        let heights: [f64; C] = std::array::from_fn(|c| heights[c]);
        let start = clamp_to_box(&along, &workspace.points);
        let (s, jets) = closest(&graphs, &along, &heights, start).ok_or(Failure::Unresolved)?;
        let beyond = extrapolation(&s, &workspace.points);
        self.check_extrapolation(beyond)?;
        let shape = LocalShape::new(frame, &jets);
        self.check_shape(&shape, base)?;
        let position = coordinates.position(&s, &jets);
        self.check_support(segment, &position, beyond > 0.0, workspace)?;
        self.check_directions(frame, &graphs, workspace)?;
        if self.merges && self.passes_another(base, &position, &workspace.near) {
            return Err(Failure::Swept);
        }
        let parameter = self.fit_parameter(base, &s, terms, workspace)?;
        let (curvature, gauss_curvature) = (shape.curvature / unit, shape.gauss_curvature / (unit * unit));
        let part = self.feet.parts[base];
        Ok(FootPoint { position, normal: shape.direction, curvature, gauss_curvature, part, parameter })
    }

    /// Writes the chosen particles in local coordinates, with their parameters relative to that of the base.
    fn localize<const C: usize>(
        &self,
        segment: &Segment<'_, D>,
        coordinates: &LocalCoordinates<'_, D, M, C>,
        workspace: &mut Workspace<D, M>,
    ) {
        let parameters = &self.feet.parameters;
        workspace.points.clear();
        workspace.points.extend(workspace.chosen.iter().map(|j| {
            let mut point = coordinates.local(&self.feet.positions[*j]);
            point.1[PARAMETER] = shorter_difference(parameters[*j] - parameters[segment.base]);
            point
        }));
        self.find_slopes(coordinates.frame, workspace);
    }

    /// The slopes that the normals of the chosen particles ask of a graph; none where normals do not take part.
    fn find_slopes<const C: usize>(&self, frame: &Frame<D, M, C>, workspace: &mut Workspace<D, M>) {
        workspace.slopes.clear();
        if C > 1 || self.config.method.normal_weight == 0.0 {
            return;
        }
        workspace.slopes.extend(workspace.chosen.iter().map(|j| {
            let n = &self.feet.normals[*j];
            let up = frame.normals[0].dot(n);
            (up > TUNING.steepest).then(|| frame.tangents.map(|t| -t.dot(n) / up))
        }));
    }

    /// The polynomials of the heights over the frame.
    fn fit_graphs<'t, const C: usize>(
        &self,
        terms: &'t Terms<M>,
        workspace: &mut Workspace<D, M>,
    ) -> Result<[LocalGraph<'t, M>; C], Failure> {
        let Workspace { points, slopes, squares, .. } = workspace;
        let method = &self.config.method;
        let data = FitData { points, weight: method.weight, slopes, slope_weight: method.normal_weight };
        let mut graphs = [terms.nothing(); C];
        for (c, graph) in graphs.iter_mut().enumerate() {
            *graph = terms.fit(&data, c, squares).ok_or(Failure::Undetermined)?;
        }
        Ok(graphs)
    }

    /// The parameter at a point of the graph, by a fit to those of the particles (GBPM 3.3.3).
    fn fit_parameter(
        &self,
        base: usize,
        s: &[f64; M],
        terms: &Terms<M>,
        workspace: &mut Workspace<D, M>,
    ) -> Result<f64, Failure> {
        let parameter = self.feet.parameters[base];
        if self.config.segments.parameter.is_none() {
            return Ok(parameter);
        }
        let Workspace { points, squares, .. } = workspace;
        let data = FitData { points, weight: self.config.method.weight, slopes: &[], slope_weight: 0.0 };
        let fitted = terms.fit(&data, PARAMETER, squares).ok_or(Failure::Undetermined)?;
        Ok((parameter + fitted.jet(s).value).rem_euclid(1.0))
    }
}
