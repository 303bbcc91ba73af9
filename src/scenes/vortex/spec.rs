//! The parameters of a `vortex` scene.

use crate::geometry::flows::FlowChoice;
use crate::scenes::gbpm_spec::GbpmSpec;
use crate::scenes::integrators::IntegratorChoice;
use crate::scenes::pcp_spec::{Neighborhood, PcpSpec};
use crate::scenes::shapes::{PlainShape, Shape};
use crate::spec::choice::with_defaults;
use crate::spec::{Given, Interval, POSITIVE, Preset, Whole, whole};

const STEPS: Whole = whole(1, 1_000_000_000);

crate::choice! {
    /// When to redistance.
    pub enum Redistancing {
        /// for_output with a dual field, every second step with an overwritten one
        Auto = "auto",
        /// after every so many steps
        Every = "every" {
            /// number of steps
            steps: u64 = 1, in STEPS;
            /// why this was chosen, where `auto` chose it
            chosen: Option<String>;
        }
        /// when a frame, an error or the end needs it
        ForOutput = "for_output" {
            /// why this was chosen, where `auto` chose it
            chosen: Option<String>;
        }
    }
}

crate::words! {
    /// How the level-set function is kept.
    pub enum Field {
        /// a transported value that is never touched, distances apart
        Dual = "dual",
        /// the distance replaces the level (the paper)
        Overwrite = "overwrite",
    }
}

crate::choice! {
    /// The method.
    pub enum Method {
        /// the best method measured for the choice of field
        Auto = "auto",
        /// particle closest point
        Pcp = "pcp" {
            /// parameters of the fits and queries
            method: PcpSpec => flatten;
        }
        /// grid-based particles: the front itself
        Gbpm = "gbpm" {
            /// parameters of the reconstructions
            method: GbpmSpec => flatten;
        }
    }
}

crate::group! {
    /// An interface carried by a prescribed flow.
    pub struct Vortex {
        /// 2 or 3; when not given, that of the shape, else 2
        dimension: Option<usize>, in whole(2, 3);
        /// the velocity field
        flow: FlowChoice = with_defaults("single_vortex");
        /// the surface at the start
        shape: Shape = Shape::plain(PlainShape::Circle { center: Some([0.5, 0.75].into()), radius: 0.15 });
        /// distance h of neighboring particles
        spacing: f64 = 0.015_625, in POSITIVE;
        /// particles are centers of cells moved by up to this many h along every axis
        jitter: f64 = 0.0, in Interval::at_least(0.0).and_below(0.5);
        /// seed of the jitter
        seed: u64 = 1, in whole(0, 9_007_199_254_740_991);
        /// scene time at the end
        end_time: f64 = 8.0, in POSITIVE => restart_safe;
        /// time step Δt; when neither it nor steps is given, end_time/240, and by cfl with gbpm
        time_step: Option<f64>, in POSITIVE;
        /// number of equal steps, instead of time_step
        steps: Option<u64>, in STEPS;
        /// path integrator
        integrator: IntegratorChoice = IntegratorChoice::Rk4;
        /// width of the narrow band in h
        band_h: f64 = 40.0, in POSITIVE;
        /// when to redistance
        redistance: Redistancing = Redistancing::Auto;
        /// dual: a transported value that is never touched, distances apart; overwrite: the distance replaces it (the paper)
        field: Field = Field::Dual;
        /// the method
        method: Method = Method::Auto;
    }
}

/// What section 4.2 of the PCP paper states; with `method: "gbpm"` sections 4.1 to 4.3 and 4.7 of the GBPM paper.
pub(super) fn paper(given: Given) -> Preset {
    let has_step = given.has(Vortex::steps()) || given.has(Vortex::time_step());
    if given.names(Vortex::method(), "gbpm") {
        let implied = given.read(Vortex::shape()).and_then(|shape| shape.dimension());
        let is_in_space = given.read(Vortex::dimension()).flatten().or(implied) == Some(3);
        let has_own_degree = given.has_inside(Vortex::method(), GbpmSpec::degree())
            && given.read_inside(Vortex::method(), GbpmSpec::degree()) != Some(Some(2));
        let method = GbpmSpec { cfl: (!has_step).then_some(0.75), ..GbpmSpec::paper(is_in_space, has_own_degree) };
        return Preset::default()
            .set(Vortex::integrator(), IntegratorChoice::TvdRk2)
            .set(Vortex::method(), Method::Gbpm { method });
    }
    let has_neighborhood = given.has_inside(Vortex::method(), PcpSpec::neighborhood())
        || given.has_inside(Vortex::method(), PcpSpec::cutoff_h());
    let neighborhood = (!has_neighborhood).then_some(Neighborhood::Radius { cutoff_h: 15.0 });
    Preset::default()
        .set(Vortex::flow(), FlowChoice::SingleVortex { period: Some(8.0) })
        .set(Vortex::shape(), Shape::plain(PlainShape::Circle { center: Some([0.5, 0.75].into()), radius: 0.15 }))
        .set(Vortex::end_time(), 8.0)
        .set(Vortex::integrator(), IntegratorChoice::Rk4)
        .set(Vortex::band_h(), 40.0)
        .set(Vortex::jitter(), 0.0)
        .set(Vortex::redistance(), Redistancing::Every { steps: 1, chosen: None })
        .set(Vortex::field(), Field::Overwrite)
        .set(Vortex::method(), Method::Pcp { method: PcpSpec::paper(4, neighborhood, 1e-10, 100) })
        .set_if(!has_step, Vortex::time_step(), Some(1.0 / 30.0))
}
