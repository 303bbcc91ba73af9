//! The spacing of a scene against that of points from outside, which may be stretched.

use crate::closest_point::CloudMetric;
use crate::geometry::Vector;
use crate::parallel::Interrupt;
use crate::scene::cloud;
use crate::spec::Violation;

/// The metric of points that are stretched; None of others.
///
/// # Errors
/// A spacing that is not that of the points. Of stretched points it may be that in any direction.
pub(super) fn metric<const D: usize>(
    points: &[Vector<D>],
    level: &[f64],
    spacing: f64,
    interrupt: &Interrupt,
) -> Result<Option<CloudMetric<D>>, Vec<Violation>> {
    // An interrupt leaves the cloud as it is. The run then ends before its first step.
    let metric = CloudMetric::new(points, interrupt).ok().filter(|metric| metric.is_stretched(level));
    let Some(metric) = metric else {
        return cloud::check_spacing(points, spacing).map_or(Ok(None), |found| Err(vec![found]));
    };
    let (shortest, longest) = metric.spacings();
    if (shortest / 3.0..=longest * 3.0).contains(&spacing) {
        return Ok(Some(metric));
    }
    let detail = format!("the points are stretched: they lie {shortest:.3e} to {longest:.3e} apart, by the direction");
    Err(vec![Violation::new("/spacing", "conflict", detail, spacing, longest)])
}
