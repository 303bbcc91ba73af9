//! The spacing of a scene against that of points from outside, which may be stretched.

use crate::closest_point::{CloudMetric, Stretch};
use crate::geometry::Vector;
use crate::parallel::Interrupt;
use crate::scene::cloud;
use crate::spec::Violation;

/// Points that lie farther apart than this many spacings of the scene are fitted in their own metric. Within it one
/// radius in multiples of the spacing finds enough neighbors.
const TOO_FINE: f64 = 1.3;
/// Factor by which a spacing may differ from those of points with a metric of their own, which does not depend on it.
const WIDEST: f64 = 4.0;

/// The metric of points that are stretched, or of which the spacing is too fine; None of others.
///
/// # Errors
/// A spacing that is not that of the points. Of stretched points it may be that in any direction.
pub(super) fn metric<const D: usize>(
    points: &[Vector<D>],
    level: &[f64],
    spacing: f64,
    interrupt: &Interrupt,
) -> Result<Option<CloudMetric<D>>, Vec<Violation>> {
    let cells = cloud::sorted(points, spacing);
    let refused = cloud::check_spacing_in(&cells, points, spacing);
    let stretch = Stretch::new(&cells, points, level);
    if !stretch.is_large() && refused.is_none() && stretch.mean_spacing <= TOO_FINE * spacing {
        return Ok(None);
    }
    // An interrupt leaves the cloud as it is. The run then ends before its first step.
    let metric = CloudMetric::new(points, level, interrupt).and_then(|metric| metric.completed(points, interrupt));
    let Ok(metric) = metric else { return Ok(None) };
    let (shortest, longest) = metric.spacings();
    if (shortest / WIDEST..=longest * WIDEST).contains(&spacing) {
        return Ok(Some(metric));
    }
    if let (Some(found), false) = (refused, stretch.is_large()) {
        return Err(vec![found]);
    }
    let detail = format!("the points are stretched: they lie {shortest:.3e} to {longest:.3e} apart, by the direction");
    Err(vec![Violation::new("/spacing", "conflict", detail, spacing, longest)])
}
