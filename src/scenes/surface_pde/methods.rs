//! The method of a scene: order, support and form of its operators.

use super::spec::{FormWord, MethodSpec, MetricWord, NormalsChoice, ProblemSpec, SupportsWord, SurfacePde};
use super::surfaces::{Sampling, Shape};
use crate::operators::Support;
use crate::operators::charts::tangent::Metric;
use crate::schemes::surface_equation::{Form, Method};
use crate::spec::choice::with_defaults;
use crate::spec::{Choice, Parameter, Violation};
use serde_json::{Value, json};

/// The method of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scheme {
    Dcpse(Method),
    Embedding { order: usize, spacing: f64 },
}

/// Degree and r_c/δn of an order: the smallest support that holds twice as many neighbors as there are functions, about; larger
/// ones have larger errors (measured on plane waves). Points as drawn at random want more: with less, operators have growing modes.
fn support(order: u64, is_curve: bool, is_copies: bool, sampling: Sampling) -> Option<(usize, f64)> {
    let degree = match order {
        2 | 4 | 6 => order as usize + 1,
        _ => return None,
    };
    let is_raw = sampling == Sampling::Random { is_relaxed: false };
    let cutoff = match (is_copies, is_curve, order) {
        (true, true, _) => 4.1,
        (true, false, _) => 2.9,
        // On a curve neighbors lie in a row.
        (false, true, 2) => 3.4,
        (false, true, 4) => 5.4,
        (false, true, _) => 7.4,
        (false, false, _) if is_raw => 3.0 + 0.25 * order as f64,
        (false, false, 2) => 2.4,
        (false, false, 4) => 3.3,
        (false, false, _) => 4.2,
    };
    Some((degree, cutoff))
}

/// Radius of supports along stars for a Laplacian of order 2, in local spacings. They grow where a row would not be bounded, so that they
/// can begin small; errors grow with their square (docs/results/surface-notes.md, points from outside). Slopes want more.
const LAPLACIAN_OF_ORDER_2: f64 = 2.2;

/// Points of a surface with fewer of them do not support fits of order 4.
const FEW_FOR_ORDER_4: u64 = 160;

/// The points that operators are made on.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub shape: &'a Shape,
    pub sampling: Sampling,
    pub count: u64,
    pub metric: Metric,
    /// Whether the problem asks for slopes of a field or of the surface, not for the Laplacian alone.
    pub has_slopes: bool,
}

fn wrong_order(order: u64, allowed: Value) -> Violation {
    Violation::new("/method/order", "range", "there is no method of this order", order, allowed)
}

/// The method of a scene on points; the spec gets what was left open.
pub(super) fn scheme(spec: &mut SurfacePde, points: Points, errors: &mut Vec<Violation>) -> Option<Scheme> {
    let by_stars = points.is_given()
        || matches!(spec.problem, ProblemSpec::GeodesicDistance { .. } | ProblemSpec::Eigenvalues { .. });
    let is_by_cells = matches!(spec.problem, ProblemSpec::Advection { .. } | ProblemSpec::MovingDiffusion { .. });
    let default = || {
        with_defaults(match by_stars {
            _ if is_by_cells => "conservative",
            true => "auto",
            false => "surface_dcpse",
        })
    };
    match spec.method.get_or_insert_with(default) {
        MethodSpec::ClosestPoint { order, spacing } => {
            if *order != 2 && *order != 4 {
                errors.push(wrong_order(*order, json!([2, 4])));
            }
            // The default of points from outside is not a wish for normals.
            let default = NormalsChoice::Given { metric: MetricWord::Heights };
            let is_wish = |normals: &&NormalsChoice| **normals != NormalsChoice::Exact && **normals != default;
            if let Some(given) = spec.normals.as_ref().filter(is_wish) {
                let detail = "the embedding method has exact closest points and asks for no normals";
                errors.push(Violation::new("/normals", "conflict", detail, given.name(), json!(["exact"])));
            }
            let grid = *spacing.get_or_insert(points.shape.spacing(points.count));
            Some(Scheme::Embedding { order: *order as usize, spacing: grid })
        }
        MethodSpec::Auto { order, cutoff_dn } if is_by_cells => {
            for (name, given) in [("order", order.to_json()), ("cutoff_dn", cutoff_dn.to_json())] {
                if !given.is_null() {
                    let (at, detail) = (format!("/method/{name}"), "this problem takes cells, and no fits");
                    errors.push(Violation::new(at, "conflict", detail, given, Value::Null));
                }
            }
            points.conservative(errors)
        }
        MethodSpec::Auto { order, cutoff_dn } => points.auto(order, cutoff_dn, &spec.problem, errors),
        MethodSpec::Conservative => points.conservative(errors),
        MethodSpec::SurfaceDcpse { order, form: FormWord::Copies, cutoff_dn, layers, normal_spacing, supports } => {
            if let Some(given) = supports {
                let detail = "the neighbors of copies lie within one radius";
                errors.push(Violation::new("/method/supports", "conflict", detail, given.to_json(), Value::Null));
            }
            points.by_copies(*order, cutoff_dn, (layers, normal_spacing), errors)
        }
        MethodSpec::SurfaceDcpse { order, form: FormWord::Intrinsic, cutoff_dn, layers, normal_spacing, supports } => {
            for (name, given) in [("layers", layers.to_json()), ("normal_spacing", normal_spacing.to_json())] {
                if !given.is_null() {
                    let (at, detail) = (format!("/method/{name}"), "there are no copies in the intrinsic form");
                    errors.push(Violation::new(at, "conflict", detail, given, Value::Null));
                }
            }
            let default = if points.is_given() { SupportsWord::Stars } else { SupportsWord::Ball };
            if *supports.get_or_insert(default) == SupportsWord::Stars {
                return points.by_stars(*order, cutoff_dn, (false, false), errors);
            }
            points.within_radius(*order, cutoff_dn, errors)
        }
    }
}

impl Points<'_> {
    /// Whether they come from outside.
    fn is_given(self) -> bool {
        matches!(self.shape, Shape::Points(_))
    }

    /// Order of curvatures and eigenvalues where none is asked for. Second derivatives of heights have the errors of order 2 on 300 points
    /// of a sphere: 2.5 %, and 0.1 % with order 4. Noise counts as much with either.
    fn order_where_resolved(self) -> u64 {
        let is_known = !matches!(self.shape, Shape::Points(extent) if !extent.is_known);
        if is_known && self.count < FEW_FOR_ORDER_4 { 2 } else { 4 }
    }

    fn support(self, order: u64, is_copies: bool, errors: &mut Vec<Violation>) -> Option<(usize, f64)> {
        let found = support(order, self.shape.is_curve(), is_copies, self.sampling);
        if found.is_none() {
            errors.push(wrong_order(order, json!([2, 4, 6])));
        }
        found
    }

    /// The automatic choice: order 2, of curvatures and eigenvalues 4 where nothing is asked for and the points resolve the surface for it.
    fn auto(
        self,
        order: &mut Option<u64>,
        cutoff_dn: &mut Option<f64>,
        problem: &ProblemSpec,
        errors: &mut Vec<Violation>,
    ) -> Option<Scheme> {
        if matches!(problem, ProblemSpec::Curvature | ProblemSpec::Eigenvalues { .. }) && order.is_none() {
            // It is known when the points are read, so that it stays open in the resolved body, and the cutoff with it.
            return self.by_stars(self.order_where_resolved(), &mut { *cutoff_dn }, (true, true), errors);
        }
        self.by_stars(*order.get_or_insert(2), cutoff_dn, (true, false), errors)
    }

    /// Fits by stars; the spec gets the cutoff. Supports grow by themselves, so random points take the cutoff of others.
    fn by_stars(
        self,
        order: u64,
        cutoff_dn: &mut Option<f64>,
        (may_switch, may_lower): (bool, bool),
        errors: &mut Vec<Violation>,
    ) -> Option<Scheme> {
        let (degree, by_order) = Self { sampling: Sampling::Given, ..self }.support(order, false, errors)?;
        let is_small = order == 2 && !self.has_slopes && !self.shape.is_curve();
        let cutoff = *cutoff_dn.get_or_insert(if is_small { LAPLACIAN_OF_ORDER_2 } else { by_order });
        self.check_fit(degree, cutoff, errors);
        let support = Support { degree, radius: cutoff * self.shape.spacing(self.count) };
        let form = Form::Stars { metric: self.metric, cutoff, may_switch, may_lower };
        Some(Scheme::Dcpse(Method { support, form }))
    }

    /// Exchange between cells.
    fn conservative(self, errors: &mut Vec<Violation>) -> Option<Scheme> {
        // The support of the lowest order stands for lengths and counts.
        let support = self.by_stars(2, &mut None, (false, false), errors)?;
        let Scheme::Dcpse(Method { support, .. }) = support else { return None };
        Some(Scheme::Dcpse(Method { support, form: Form::Conservative }))
    }

    /// Fits within one radius on tangent planes.
    fn within_radius(self, order: u64, cutoff_dn: &mut Option<f64>, errors: &mut Vec<Violation>) -> Option<Scheme> {
        let (degree, default_cutoff) = self.support(order, false, errors)?;
        let cutoff_dn = *cutoff_dn.get_or_insert(default_cutoff);
        self.check_fit(degree, cutoff_dn, errors);
        let support = Support { degree, radius: cutoff_dn * self.shape.spacing(self.count) };
        Some(Scheme::Dcpse(Method { support, form: Form::Intrinsic { metric: self.metric } }))
    }

    /// Fits in space to copies along normals.
    fn by_copies(
        self,
        order: u64,
        cutoff_dn: &mut Option<f64>,
        (layers, spacing): (&mut Option<u32>, &mut Option<f64>),
        errors: &mut Vec<Violation>,
    ) -> Option<Scheme> {
        let (degree, default_cutoff) = self.support(order, true, errors)?;
        let cutoff_dn = *cutoff_dn.get_or_insert(default_cutoff);
        let (default_layers, default_spacing) = self.copies();
        let layers = *layers.get_or_insert(default_layers);
        let apart = *spacing.get_or_insert(default_spacing);
        if self.metric == Metric::FromHeights || matches!(self.shape, Shape::Bump(_) | Shape::Points(_)) {
            let detail = "copies along normals want exact normals and a closed surface";
            errors.push(Violation::new("/method/form", "conflict", detail, "copies", json!(["intrinsic"])));
        }
        let support = Support { degree, radius: cutoff_dn * apart };
        Some(Scheme::Dcpse(Method { support, form: Form::Copies { layers, spacing: apart } }))
    }

    /// Layers of copies and their distance, where they are not given.
    fn copies(self) -> (u32, f64) {
        let layers = if self.shape.is_curve() { 4 } else { 2 };
        match self.shape {
            Shape::Circle { radius } => (layers, 3.0 * radius / (self.count as f64 - 1.0)),
            shape => (layers, shape.spacing(self.count)),
        }
    }

    /// Whether there are points and neighbors enough for fits of a degree.
    fn check_fit(self, degree: usize, cutoff_dn: f64, errors: &mut Vec<Violation>) {
        let is_curve = self.shape.is_curve();
        let terms = if is_curve { degree as f64 } else { ((degree + 1) * (degree + 2) / 2 - 1) as f64 };
        // Only points whose normals differ by less than 60° count: a quarter of a sphere, less where it is flat.
        let least_count = (8.0 * terms).ceil();
        if (self.count as f64) < least_count {
            let detail = format!("a fit of {terms} functions wants {least_count} points at least on a closed surface");
            let at = if let Shape::Points(_) = self.shape { "/surface" } else { "/count" };
            errors.push(Violation::new(at, "range", detail, self.count, json!({"least": least_count})));
        }
        let least_cutoff = if is_curve { 0.6 * terms } else { (1.2 * terms / std::f64::consts::PI).sqrt() };
        if cutoff_dn < least_cutoff {
            let detail = format!("a support must hold the neighbors that a fit of {terms} functions needs");
            let allowed = json!({"least": least_cutoff});
            errors.push(Violation::new("/method/cutoff_dn", "range", detail, cutoff_dn, allowed));
        }
    }
}
