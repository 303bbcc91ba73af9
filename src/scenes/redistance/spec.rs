//! The parameters of a `redistance` scene.

use crate::scene::cloud::PointsSource;
use crate::scenes::pcp_spec::{Neighborhood, PcpSpec};
use crate::scenes::shapes::Shape;
use crate::spec::choice::with_defaults;
use crate::spec::{Given, Interval, POSITIVE, Preset, whole};

crate::choice! {
    /// Level-set function at the start.
    pub enum Initial {
        /// √(Σ x²/A²) − 1 of an ellipse or ellipsoid
        Quadric = "quadric",
        /// the exact distance
        Distance = "distance",
        /// the exact distance times 1 + 0.5 x + 0.3 y
        Scaled = "scaled",
    }
}

crate::choice! {
    /// How values get to the nodes of the grid.
    pub enum Kernel {
        /// Λ₄,₄, plain sums
        Lambda44 = "lambda44",
        /// Λ₄,₄, divided by the sum of weights
        Lambda44Normalized = "lambda44_normalized",
        /// Wendland C², weighted by volumes and normalized
        WendlandC2 = "wendland_c2" {
            /// smoothing length ε in h; 1.5 (1/(16 h))^0.35 when not given: it must grow as h falls
            smoothing_h: Option<f64>, in POSITIVE;
        }
        /// Gaussian, weighted by volumes and normalized
        Gaussian = "gaussian" {
            /// smoothing length ε in h; 1.5 (1/(16 h))^0.35 when not given: it must grow as h falls
            smoothing_h: Option<f64>, in POSITIVE;
        }
    }
}

crate::choice! {
    /// The method.
    pub enum Method {
        /// particle closest point
        Pcp = "pcp" {
            /// parameters of the fits and queries
            method: PcpSpec => flatten;
        }
        /// the baseline: interpolation to a grid, then closest points on it by Taylor polynomials of degree 4
        Remesh = "remesh" {
            /// how values get to the nodes
            kernel: Kernel = Kernel::Lambda44Normalized;
        }
    }
}

crate::choice! {
    /// Where the distance is asked for.
    pub enum Queries {
        /// at the particles themselves
        Particles = "particles",
        /// at the points of a VTKHDF file
        Points = "points" {
            /// where the points come from
            source: PointsSource => flatten;
        }
    }
}

crate::group! {
    /// Redistancing of resting particles about a known shape.
    pub struct Redistance {
        /// 2 or 3; when not given, that of the shape, else 2
        dimension: Option<usize>, in whole(2, 3);
        /// the surface; when not given, the ellipse (.75, .5), in 3D the ellipsoid (.75, .5, .5)
        shape: Option<Shape>;
        /// distance h of neighboring particles
        spacing: f64 = 0.015_625, in POSITIVE;
        /// particles are multiples of h moved by up to this many h along every axis
        jitter: f64 = 0.3, in Interval::at_least(0.0).and_below(0.5);
        /// seed of the jitter
        seed: u64 = 1, in whole(0, 9_007_199_254_740_991);
        /// level-set function at the start; quadric for ellipses and ellipsoids, else distance, when not given
        initial: Option<Initial>;
        /// width of the narrow band in h; 12 when neither it nor band is given
        band_h: Option<f64>, in POSITIVE;
        /// width of the narrow band
        band: Option<f64>, in POSITIVE;
        /// number of redistancings in a row
        repeat: u64 = 1, in whole(1, 1_000_000) => restart_safe;
        /// the method
        method: Method = with_defaults("pcp");
        /// where to ask for the distance; with points of a file frames show those
        queries: Queries = Queries::Particles;
    }
}

/// What section 4.1 of the PCP paper states: unweighted fits, r_c = 2.5 h in 2D; 2.4 h (degree 5: 2.6 h) in 3D.
pub(super) fn paper(given: Given) -> Preset {
    let implied = given.read(Redistance::shape()).flatten().and_then(|shape| shape.dimension());
    let is_solid = given.read(Redistance::dimension()).flatten().or(implied) == Some(3);
    let degree = given.read_inside(Redistance::method(), PcpSpec::degree()).unwrap_or(4);
    let cutoff_h = match (is_solid, degree) {
        (false, _) => 2.5,
        (true, 5) => 2.6,
        (true, _) => 2.4,
    };
    let has_neighborhood = given.has_inside(Redistance::method(), PcpSpec::neighborhood())
        || given.has_inside(Redistance::method(), PcpSpec::cutoff_h());
    let neighborhood = (!has_neighborhood).then_some(Neighborhood::Radius { cutoff_h });
    let needs_band = is_solid && !given.has(Redistance::band());
    Preset::default()
        .set(Redistance::jitter(), 0.3)
        .set(Redistance::method(), Method::Pcp { method: PcpSpec::paper(4, neighborhood, 1e-14, 1000) })
        .set_if(needs_band, Redistance::band_h(), Some(12.0))
}
