//! A surface that is given by uploaded points: they are read and examined, and normals are estimated where none came with
//! them. No exact answer is known on such a surface. Its report has no errors, and the plan refuses problems that need an
//! exact answer.

use super::data_fields;
use super::edges::{self, Edges};
use super::methods::Scheme;
use super::plan::{Normals, SurfaceScene, choices};
use super::preparation::Preparation;
use super::problems::ProblemChoice;
use super::simulations::{self, Outside, Run};
use super::spec::{CleanWord, EdgesChoice, SurfaceChoice};
use super::surfaces::{Extent, Sampling, Shape};
use crate::geometry::Vector;
use crate::parallel::Interrupt;
use crate::point_clouds::cleaning::Cleaning;
use crate::point_clouds::examination::{Flaw, NormalSource, Unusable, unit_normals};
use crate::point_clouds::given_normals::Verdict;
use crate::point_clouds::normals;
use crate::point_clouds::periodic::Repeated;
use crate::point_clouds::triangulation::{given_triangles, triangles};
use crate::point_clouds::{Examined, PreparedCloud};
use crate::scene::BuildContext;
use crate::scene::cloud::{self, Clouds};
use crate::schemes::surface_equation::{Copies, Form, Method, SurfaceCloud};
use crate::simulation::{Finding, Mark, Simulation};
use crate::spec::Violation;
use serde_json::Value;

/// Place of the points in a scene.
const PLACE: &str = "/surface";

/// 1. Reads the points and the normals that came with them. 2. Prepares them, with stars or within one radius. 3. Plans method
///    and problem anew with their spacing. 4. Reports what was found about points and normals.
pub(super) fn build<const D: usize, const M: usize>(
    scene: &SurfaceScene,
    context: BuildContext,
) -> Result<Box<dyn Simulation>, Vec<Violation>> {
    let BuildContext { clouds, interrupt, cpu_clock, .. } = context;
    let points = cloud::points::<D>(&clouds, PLACE).map_err(|refused| vec![refused])?;
    let given = given_normals::<D>(&clouds, scene.normals)?;
    let is_ball = matches!(scene.scheme, Scheme::Dcpse(Method { form: Form::Intrinsic { .. }, .. }));
    let found = if is_ball {
        Found::within_radius(scene, (&clouds, points), given)?
    } else {
        Found::with_stars(scene, (&clouds, &points), given.as_deref(), &interrupt)?
    };
    let Found { cloud, measure, outside } = found;
    let shape = Shape::Points(Extent::of(&cloud.points, measure));
    let (method, problem) = planned(scene, &shape, cloud.rows)?;
    let run = Run { seed: scene.given.seed, fixed: scene.fixed, interrupt, cpu_clock, clouds };
    simulations::build::<D, M>(&problem, (&shape, cloud, method), run, Some(outside))
}

/// Method and problem for points whose extent is known.
fn planned(scene: &SurfaceScene, shape: &Shape, count: usize) -> Result<(Method, ProblemChoice), Vec<Violation>> {
    let mut violations = Vec::new();
    let points = (shape, Sampling::Fibonacci, count as u64);
    let (scheme, problem) = choices(&mut scene.given.clone(), points, &mut violations);
    match (scheme, problem) {
        (Some(Scheme::Dcpse(method)), Some(problem)) if violations.is_empty() => Ok((method, problem)),
        _ => Err(violations),
    }
}

/// A cloud, and what was found about it.
struct Found<const D: usize> {
    cloud: SurfaceCloud<D>,
    /// Its length or area.
    measure: f64,
    outside: Outside,
}

impl<const D: usize> Found<D> {
    /// Examines points for supports of one radius. Flaws of points and normals are reported.
    fn within_radius(
        scene: &SurfaceScene,
        (clouds, points): (&Clouds, Vec<Vector<D>>),
        given: Option<Vec<Vector<D>>>,
    ) -> Result<Self, Vec<Violation>> {
        let examined = Examined::new(&points).map_err(|reason| refuse(reason.to_string()))?;
        let measure = points.len() as f64 * examined.spacing.powi(D as i32 - 1);
        let shape = Shape::Points(Extent::of(&points, measure));
        let (method, _) = planned(scene, &shape, points.len())?;
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
            named(source),
            flaws.iter().map(|flaw| format!("; {flaw}")).collect::<String>()
        );
        let rows: Vec<usize> = (0..points.len()).collect();
        let data = data_fields::values(&scene.spec, clouds, clouds.get(PLACE), &rows)?;
        let findings = flaws.iter().map(finding).collect();
        let marks = flaws.iter().map(|flaw| Mark { code: flaw.name(), points: flaw.points().all.clone() }).collect();
        let cloud = SurfaceCloud { rows: points.len(), points, normals, data, ..SurfaceCloud::default() };
        Ok(Self { cloud, measure, outside: Outside { origin, findings, marks, counted: Vec::new() } })
    }

    /// Prepares points for supports along stars, and for the conservative form.
    fn with_stars(
        scene: &SurfaceScene,
        (clouds, points): (&Clouds, &[Vector<D>]),
        given: Option<&[Vector<D>]>,
        interrupt: &Interrupt,
    ) -> Result<Self, Vec<Violation>> {
        let cleaning = match scene.spec.surface {
            SurfaceChoice::Points { clean: CleanWord::Refuse, .. } => Cleaning::Refuse,
            SurfaceChoice::Points { clean: CleanWord::Off, .. } => Cleaning::Off,
            _ => Cleaning::Drop,
        };
        let Seen { prepared, whole, source } = Seen::new(points, given, (cleaning, &scene.spec.edges), interrupt)?;
        let must_be_right = matches!(scene.normals, Normals::Given { must_be_there: true });
        if must_be_right && prepared.verdict.as_ref().is_some_and(|verdict| verdict.is_wrong_together) {
            let detail = "the normals of the points do not stand on the surface, so they cannot be taken as exact \
                          (/normals/metric); `heights` estimates others";
            return Err(refuse(detail.to_owned()));
        }
        if must_be_right && prepared.verdict.as_ref().is_some_and(Verdict::is_unchecked) {
            let detail = "the points resolve the surface too little to check their normals, so these cannot be taken as \
                          exact (/normals/metric); `heights` uses them as a guess alone";
            return Err(refuse(detail.to_owned()));
        }
        let is_equation = !scene.problem.is_pointwise();
        let rows = prepared.points.len();
        let edges = Edges::new(whole.as_ref().unwrap_or(&prepared), rows, &scene.spec.edges);
        edges.check(&prepared, &scene.spec.edges)?;
        let without_face = clouds.get(PLACE).map_or(0, |cloud| cloud.left_out);
        let Preparation { findings, marks, mut counted } =
            Preparation::new(&prepared, is_equation, edges.held_count(), without_face);
        counted.extend(edges.counted(rows));
        let measure = prepared.graph.areas.iter().sum();
        let origin = format!(
            "{} of them, {:.4e} apart, {} normals, {} {}, {} of {measure:.6e}",
            prepared.points.len(),
            prepared.spacing,
            named(prepared.source),
            prepared.graph.part_count,
            if prepared.graph.part_count == 1 { "part" } else { "parts" },
            if D == 2 { "a length" } else { "an area" },
        );
        let triangles = shown_triangles(clouds, &prepared, whole.as_ref())?;
        let data = data_fields::values(&scene.spec, clouds, clouds.get(PLACE), &prepared.kept)?;
        let PreparedCloud { points, normals, spacings, graph, .. } = prepared;
        let areas = Some(graph.areas.clone());
        let copies = whole.map(|PreparedCloud { points, normals, spacings, graph, .. }| Copies {
            points,
            normals,
            spacings,
            graph,
            conormals: Vec::new(),
            source,
        });
        let mut cloud =
            SurfaceCloud { rows, copies, points, normals, areas, spacings, graph, data, ..SurfaceCloud::default() };
        cloud.triangles = triangles;
        let held = edges::held_values(&scene.spec.edges, &scene.shape, &cloud)?;
        edges.put_into(&mut cloud, &held);
        Ok(Self { cloud, measure, outside: Outside { origin, findings, marks, counted } })
    }
}

/// The triangles of the file, else those of the stars.
fn shown_triangles<const D: usize>(
    clouds: &Clouds,
    prepared: &PreparedCloud<D>,
    whole: Option<&PreparedCloud<D>>,
) -> Result<Vec<[u32; 3]>, Vec<Violation>> {
    let given = cloud::triangles(clouds, PLACE).map_err(|refused| vec![refused])?;
    let given = given_triangles(&given, &prepared.places, (&prepared.points, &prepared.normals));
    if !given.is_empty() {
        return Ok(given);
    }
    let (all, rows) = (whole.unwrap_or(prepared), prepared.points.len());
    let mut found = triangles(&all.points, &all.normals, &all.stars);
    found.retain(|corners| corners.iter().all(|corner| (*corner as usize) < rows));
    Ok(found)
}

/// A prepared cloud, and where the surface repeats the whole of points and copies with the point that each is a copy of.
struct Seen<const D: usize> {
    prepared: PreparedCloud<D>,
    whole: Option<PreparedCloud<D>>,
    source: Vec<u32>,
}

impl<const D: usize> Seen<D> {
    fn new(
        points: &[Vector<D>],
        given: Option<&[Vector<D>]>,
        (cleaning, edges): (Cleaning, &EdgesChoice),
        interrupt: &Interrupt,
    ) -> Result<Self, Vec<Violation>> {
        let refused = |reason: Unusable| refuse(reason.to_string());
        let periods = edges::periods::<D>(edges);
        if periods.is_empty() {
            let prepared = PreparedCloud::with_interrupt(points, given, cleaning, interrupt).map_err(refused)?;
            return Ok(Self { prepared, whole: None, source: Vec::new() });
        }
        let repeated = Repeated::new(points, &periods, cleaning).map_err(refused)?;
        let (whole, prepared) = repeated.prepare(given, interrupt).map_err(refused)?;
        Ok(Self { prepared, whole: Some(whole), source: repeated.source })
    }
}

/// Where normals come from, in words.
fn named(source: NormalSource) -> &'static str {
    if source == NormalSource::Given { "their own" } else { "estimated" }
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

#[cfg(test)]
mod tests {
    use super::Vector;
    use crate::geometry::fibonacci;
    use crate::geometry::random::CounterRandom;
    use crate::parallel::Interrupt;
    use crate::scene::{self, BuildContext, Cloud, Clouds};
    use crate::simulation::{CpuClock, OutputPlan};
    use serde_json::json;

    /// On points so rough that none can be trusted, given normals are told to be unchecked, and never taken as exact.
    #[test]
    fn normals_that_cannot_be_checked_are_told_or_refused() {
        let random = CounterRandom::new(3);
        let ball: Vec<Vector<3>> = fibonacci::sphere(300);
        let array = |x: &Vector<3>| [x[0], x[1], x[2]];
        let rough = |(i, x): (usize, &Vector<3>)| array(&(x * (1.0 + 0.4 * random.symmetric(&[i as i64]))));
        let positions: Vec<_> = ball.iter().enumerate().map(rough).collect();
        let build = |metric: &str| {
            let normals = Some(ball.iter().map(array).collect());
            let cloud = Cloud { positions: positions.clone(), normals, ..Cloud::default() };
            let clouds = Clouds::from([("/surface", cloud)]);
            let plan = OutputPlan { every_time: None, series_every_steps: 1 };
            let (interrupt, cpu_clock) = (Interrupt::default(), CpuClock::still());
            let given = json!({"type": "given", "metric": metric});
            let surface = json!({"type": "points", "upload": "upl_x"});
            let body = json!({"kind": "surface_pde", "surface": surface, "problem": "curvature", "normals": given});
            let scene = scene::parse(&body, crate::scenes::SCENES).map_err(|errors| format!("{errors:?}")).unwrap();
            scene.build(BuildContext { plan, interrupt, cpu_clock, clouds })
        };
        let refused = build("normals").err().unwrap();
        assert!(refused[0].detail.contains("`heights`"), "{refused:?}");
        let mut built = build("heights").map_err(|errors| format!("{errors:?}")).unwrap();
        assert!(built.take_findings().iter().any(|finding| finding.code == "normals.unchecked"));
    }
}
