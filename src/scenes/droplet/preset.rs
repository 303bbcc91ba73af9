//! The preset `paper` of a `droplet` scene.

use super::cases::Case;
use super::spec::{CaseName, Droplet, GeometryChoice, IntegratorWord, TensionWord};
use crate::scenes::pcp_spec::{Neighborhood, PcpSpec};
use crate::spec::{Given, Preset};

/// Values that sections 4.3 and 4.4 of the PCP paper state.
pub(super) fn paper(given: Given) -> Preset {
    let case = given.read(Droplet::case()).unwrap_or(CaseName::Oscillating);
    let implied = given.read(Droplet::shape()).flatten().and_then(|shape| shape.dimension());
    let dimension = given.read(Droplet::dimension()).flatten().or(implied).unwrap_or(2);
    let spacing = given.read(Droplet::spacing()).filter(|h| *h > 0.0).unwrap_or(1.0 / 32.0);
    let (degree, cutoff_h) = Case::new(case, dimension, spacing).fits;
    let has_neighborhood = given.has_inside(Droplet::geometry(), PcpSpec::neighborhood())
        || given.has_inside(Droplet::geometry(), PcpSpec::cutoff_h());
    let neighborhood = (!has_neighborhood).then_some(Neighborhood::Radius { cutoff_h });
    let method = PcpSpec::paper(degree, neighborhood, 1e-12, 1000);
    let has_step = given.has(Droplet::steps()) || given.has(Droplet::time_step());
    Preset::default()
        .set(Droplet::tension_force(), TensionWord::Csf)
        .set(Droplet::integrator(), IntegratorWord::PredictorCorrector)
        .set(Droplet::geometry(), GeometryChoice::Pcp { band_h: None, method })
        // 2e-4 at 1/32, 1e-4 at 1/64, 5e-5 at 1/128.
        .set_if(
            !has_step && !given.has(Droplet::numbers()) && case != CaseName::Dividing,
            Droplet::time_step(),
            Some(2e-4 * 32.0 * spacing),
        )
}
