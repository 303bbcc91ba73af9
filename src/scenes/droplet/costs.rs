//! What parts of a droplet scene cost.

use super::plan::DropletScene;
use crate::polynomials::multi_index::term_count;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::{self, Discretization, TensionLaw};

/// Work of an exchange of a surfactant in a pair, by that of surface tension on a particle.
const EXCHANGE: f64 = 12.0;
/// Bytes of a pair that exchanges a surfactant.
const PAIR_BYTES: f64 = 16.0;

impl<const D: usize> DropletScene<D> {
    /// Work of the forces: sums over pairs, or fits.
    pub(super) fn momentum_work(&self, pairs: f64, particles: f64) -> f64 {
        let Discretization::Dcpse(support) = self.config.discretization else { return pairs };
        let cutoff = support.radius / self.config.spacing;
        let nodes = if D == 2 { 3.1 } else { 4.2 } * cutoff.powi(D as i32);
        let terms = term_count::<D>(support.degree) as f64;
        particles * nodes * (40.0 + 0.25 * terms * terms)
    }

    /// Work of the exchange of a surfactant at a moment, by that of surface tension on a particle.
    pub(super) fn exchange_work(&self) -> f64 {
        EXCHANGE * self.surfactant_pairs()
    }

    /// Pairs of particles that exchange a surfactant: those of a band of 4 ε with feet within the radius of the exchange.
    fn surfactant_pairs(&self) -> f64 {
        if !matches!(self.config.tension_law, Some(TensionLaw::Surfactant(_))) {
            return 0.0;
        }
        let width = 4.0 * self.config.smoothing_length;
        let radius = weakly_compressible_sph::EXCHANGE_RADIUS_H;
        let patch = if D == 2 { 2.0 * radius } else { std::f64::consts::PI * radius * radius };
        self.near(width) * width / self.spec.spacing * patch
    }

    pub(super) fn surfactant_bytes(&self) -> u64 {
        (PAIR_BYTES * self.surfactant_pairs()) as u64
    }

    /// Particles within a band of this width about the drop, about: that of a ball of its measure, which is taken for a fifth of the
    /// box where it is not known.
    pub(super) fn near(&self, width: f64) -> f64 {
        let lengths = self.lengths();
        let surface = self.surface.as_ref();
        let measure = surface.map_or(lengths.product() / 5.0, |surface| surface.whole.area_or_volume());
        let area = match self.shape {
            Shape::Layer { .. } => 2.0 * lengths.product() / lengths[1],
            _ if D == 2 => 2.0 * (std::f64::consts::PI * measure).sqrt(),
            _ => (36.0 * std::f64::consts::PI).cbrt() * measure.powf(2.0 / 3.0),
        };
        (area * width / self.config.spacing.powi(D as i32)).min(self.count() as f64)
    }
}
