//! A surface that is given by uploaded points: they are read and examined, and normals are estimated where none came with
//! them. No exact answer is known on such a surface. Its report has no errors, and the plan refuses problems that need an
//! exact answer.

use super::plan::{Normals, Scheme, SurfaceScene, choices};
use super::surfaces::{Extent, Sampling, Shape};
use crate::geometry::Vector;
use crate::point_clouds::Examined;
use crate::point_clouds::examination::{Flaw, NormalSource, unit_normals};
use crate::point_clouds::normals;
use crate::scene::BuildContext;
use crate::scene::cloud::{self, Clouds};
use crate::schemes::surface_equation::{SurfaceCloud, SurfaceEquation};
use crate::simulation::{Finding, Mark, Simulation};
use crate::spec::Violation;
use serde_json::Value;

/// Place of the points in a scene.
const PLACE: &str = "/surface";

/// 1. Reads the points and the normals that came with them. 2. Examines the points, which gives their spacing. 3. Plans
///    method and problem anew with that spacing. 4. Estimates normals where none came. 5. Reports flaws of points and normals
///    as findings.
pub(super) fn build<const D: usize, const M: usize>(
    scene: &SurfaceScene,
    context: BuildContext,
) -> Result<Box<dyn Simulation>, Vec<Violation>> {
    let BuildContext { clouds, interrupt, cpu_clock, .. } = context;
    let points = cloud::points::<D>(&clouds, PLACE).map_err(|refused| vec![refused])?;
    let given = given_normals::<D>(&clouds, scene.normals)?;
    drop(clouds);
    let examined = Examined::new(&points).map_err(|reason| refuse(reason.to_string()))?;
    let shape = Shape::Points(Extent::of(&points, examined.spacing));
    let mut violations = Vec::new();
    let (scheme, problem) =
        choices(&mut scene.given.clone(), (&shape, Sampling::Fibonacci, points.len() as u64), &mut violations);
    let (Some(Scheme::Dcpse(method)), Some(problem), true) = (scheme, problem, violations.is_empty()) else {
        return Err(violations);
    };
    let (mut normals, source) = match given {
        Some(given) => (given, NormalSource::Given),
        None => {
            let found = normals::estimate(&points, examined.radius_of_normals());
            (found.map_err(|reason| refuse(reason.to_string()))?, NormalSource::Estimated)
        }
    };
    let flaws = examined.flaws(&mut normals, source, method.support.radius);
    let finding = |flaw: &Flaw| {
        let found = Finding::warning(flaw.name(), flaw.to_string(), (0, 0.0)).about(&flaw.points().first);
        found.with_count(flaw.points().count as u64)
    };
    let origin = format!(
        "{} of them, {:.4e} apart, {} normals{}",
        points.len(),
        examined.spacing,
        if source == NormalSource::Given { "their own" } else { "estimated" },
        flaws.iter().map(|flaw| format!("; {flaw}")).collect::<String>()
    );
    let findings = flaws.iter().map(finding).collect();
    let marks = flaws.iter().map(|flaw| Mark { code: flaw.name(), points: flaw.points().first.clone() }).collect();
    let cloud = SurfaceCloud { rows: points.len(), points, normals, ..SurfaceCloud::default() };
    let problem = problem.build(&shape, &cloud, scene.given.seed, scene.fixed.time_step)?;
    let equation = SurfaceEquation::<D, M>::new(cloud, method, problem, scene.fixed, interrupt, cpu_clock);
    Ok(Box::new(equation.on_points(origin, findings, marks)))
}

/// Unit normals that came with the points, where they are wanted.
fn given_normals<const D: usize>(clouds: &Clouds, wanted: Normals) -> Result<Option<Vec<Vector<D>>>, Vec<Violation>> {
    let Normals::Given { must_be_there } = wanted else { return Ok(None) };
    match cloud::normals::<D>(clouds, PLACE).map_err(|refused| vec![refused])? {
        Some(given) => unit_normals(&given).map(Some).map_err(|reason| refuse(reason.to_string())),
        None if must_be_there => {
            Err(refuse("the points have no normals that could be taken as exact (/normals/metric)".to_owned()))
        }
        None => Ok(None),
    }
}

fn refuse(detail: String) -> Vec<Violation> {
    vec![Violation::new(PLACE, "data", detail, Value::Null, Value::Null)]
}
