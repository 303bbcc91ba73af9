//! What a scene takes from outside: a shape made of particles with their level, a closed mesh, a surface with its normals,
//! places to ask about, values at points, or the velocities of a flow.
//!
//! The engine opens no file. A scene says by pointer what it needs; the caller that builds it hands over the arrays.

use crate::geometry::flows::GridNodes;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::spec::Violation;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Values with a name, one a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column {
    /// The name.
    pub name: String,
    /// The values.
    pub values: Vec<f64>,
}

/// Points, with a level, normals, triangles or other values where they have some; or values alone.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cloud {
    /// x, y, z; z is 0 for points of the plane.
    pub positions: Vec<[f64; 3]>,
    /// φ, one number a point.
    pub level: Option<Vec<f64>>,
    /// Normals of a surface, of any length, one a point.
    pub normals: Option<Vec<[f64; 3]>>,
    /// Corners of the triangles of a surface, as indices of points; empty where it has none.
    pub triangles: Vec<[u32; 3]>,
    /// Points of the file that are not here because no face has them.
    pub left_out: u64,
    /// Index in the file of each point, where points were left out; else empty.
    pub kept: Vec<u32>,
    /// Further values at the points.
    pub columns: Vec<Column>,
    /// Where the values of the columns lie, if at the nodes of a grid and not at `positions`: all of one time before the next.
    pub grid: Option<GridNodes>,
}

impl Cloud {
    /// Index in the file of a point.
    #[must_use]
    pub fn place_in_file(&self, point: usize) -> usize {
        self.kept.get(point).map_or(point, |place| *place as usize)
    }

    /// Number of points of the file.
    #[must_use]
    pub fn points_in_file(&self) -> usize {
        self.positions.len() + self.left_out as usize
    }

    /// The values of a name; those of the only column where no name is given.
    ///
    /// # Errors
    /// A sentence that lists the names there are.
    pub fn column(&self, name: Option<&str>) -> Result<&[f64], String> {
        let names = || self.columns.iter().map(|column| format!("{:?}", column.name)).collect::<Vec<_>>().join(", ");
        match (name, self.columns.as_slice()) {
            (_, []) => Err("the file has no values beside its points".to_owned()),
            (None, [only]) => Ok(&only.values),
            (None, _) => Err(format!("the file has several columns; name one of {}", names())),
            (Some(name), columns) => columns
                .iter()
                .find(|column| column.name == name)
                .map(|column| column.values.as_slice())
                .ok_or_else(|| format!("the file has no column {name:?}; it has {}", names())),
        }
    }
}

/// What stands at a pointer of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CloudReference {
    /// Where in the scene.
    pub pointer: &'static str,
    /// What the points are used as.
    pub role: CloudRole,
    /// What is named there.
    pub source: CloudSource,
}

/// What points from outside are used as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudRole {
    /// Particles with their level.
    Points,
    /// A surface with normals and faces, where there are some.
    Surface,
    /// Places to ask about.
    Queries,
    /// A closed mesh of triangles, or in the plane the corners of a polygon in order.
    Mesh,
    /// Values in the order of the points of a surface.
    Values,
    /// The velocities of a flow on a grid.
    Flow,
}

impl CloudRole {
    /// The `type` that names it in a scene, and what comes from a file then.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Mesh => ("mesh", "a mesh comes"),
            Self::Values => ("data", "values come"),
            Self::Flow => ("grid", "a flow comes"),
            Self::Points | Self::Surface | Self::Queries => ("points", "points come"),
        }
    }
}

/// Where points come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CloudSource {
    /// A local file.
    File(String),
    /// An upload, by its id.
    Upload(String),
}

/// Clouds by the pointers that name them.
pub type Clouds = BTreeMap<&'static str, Cloud>;

/// The size of points from outside, before they are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudSize {
    /// Number of points.
    pub points: u64,
    /// Surface area of a mesh, or length of a polygon.
    pub area: Option<f64>,
    /// Points of the file that are not among them.
    pub left_out: u64,
}

impl From<u64> for CloudSize {
    fn from(points: u64) -> Self {
        Self { points, area: None, left_out: 0 }
    }
}

/// Sizes by the pointers that name points, as far as they are known.
pub type CloudSizes = BTreeMap<&'static str, CloudSize>;

crate::group! {
    /// Where points come from, as a scene names it.
    pub struct PointsSource {
        /// id of an upload that is ready
        upload: Option<String>;
        /// path of a file (valid for `meniscus run` alone)
        file: Option<String>;
    }
}

impl PointsSource {
    /// The points that stand at a pointer of the scene. None, with an error, where none or two are named.
    pub fn reference(
        &self,
        pointer: &'static str,
        role: CloudRole,
        errors: &mut Vec<Violation>,
    ) -> Option<CloudReference> {
        let (name, come) = role.words();
        let source = match (&self.file, &self.upload) {
            (Some(file), None) => CloudSource::File(file.clone()),
            (None, Some(upload)) => CloudSource::Upload(upload.clone()),
            (given, upload) => {
                let code = if given.is_some() { "conflict" } else { "required" };
                let detail = format!("{come} from an upload, or in `meniscus run` from a file; name one of them");
                let got = json!({"type": name, "upload": upload, "file": given});
                errors.push(Violation::new(pointer, code, detail, got, json!({"type": name, "upload": "upl_…"})));
                return None;
            }
        };
        Some(CloudReference { pointer, role, source })
    }
}

/// The points of a cloud in `D` dimensions.
///
/// # Errors
/// No cloud, no points, numbers that are none, or a z in the plane.
pub fn points<const D: usize>(clouds: &Clouds, pointer: &'static str) -> Result<Vec<Vector<D>>, Violation> {
    let refuse = |detail: String| Violation::new(pointer, "data", detail, Value::Null, Value::Null);
    let Some(cloud) = clouds.get(pointer) else {
        return Err(refuse("the points were not handed over".to_owned()));
    };
    if cloud.positions.is_empty() {
        return Err(refuse("there are no points".to_owned()));
    }
    if let Some(place) = cloud.positions.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
        return Err(refuse(format!("the position of point {place} is not finite")));
    }
    if D == 2
        && let Some(place) = cloud.positions.iter().position(|x| x[2] != 0.0)
    {
        let z = cloud.positions[place][2];
        return Err(refuse(format!("point {place} has z = {z} in a scene of 2 dimensions; give \"dimension\": 3")));
    }
    Ok(cloud.positions.iter().map(|x| Vector::<D>::from_fn(|d, _| x[d])).collect())
}

/// The points of a cloud that have a level, with it. Frames hold NaN for particles outside their band: those know
/// nothing of the surface and are left out.
///
/// # Errors
/// As [`points`], and no levels or another number of them.
pub fn points_with_levels<const D: usize>(
    clouds: &Clouds,
    pointer: &'static str,
) -> Result<(Vec<Vector<D>>, Vec<f64>), Violation> {
    let refuse = |detail: String| Violation::new(pointer, "data", detail, Value::Null, json!("PointData/phi"));
    let points = points::<D>(clouds, pointer)?;
    let Some(level) = clouds.get(pointer).and_then(|cloud| cloud.level.as_ref()) else {
        return Err(refuse("the points have no phi".to_owned()));
    };
    if level.len() != points.len() {
        return Err(refuse(format!("{} values of phi for {} points", level.len(), points.len())));
    }
    if let Some(place) = level.iter().position(|l| l.is_infinite()) {
        return Err(refuse(format!("phi of point {place} is infinite")));
    }
    let known = points.into_iter().zip(level).filter(|(_, level)| !level.is_nan());
    let (points, level): (Vec<_>, Vec<_>) = known.map(|(x, level)| (x, *level)).unzip();
    if points.is_empty() { Err(refuse("no point has a phi that is a number".to_owned())) } else { Ok((points, level)) }
}

/// The triangles of a cloud, if it has some.
///
/// # Errors
/// A corner that is no point.
pub fn triangles(clouds: &Clouds, pointer: &'static str) -> Result<Vec<[u32; 3]>, Violation> {
    let Some(cloud) = clouds.get(pointer) else { return Ok(Vec::new()) };
    let count = cloud.positions.len();
    match cloud.triangles.iter().position(|corners| corners.iter().any(|corner| *corner as usize >= count)) {
        Some(place) => {
            let detail = format!("triangle {place} names a point that is not there");
            Err(Violation::new(pointer, "data", detail, Value::Null, json!(format!("indices below {count}"))))
        }
        None => Ok(cloud.triangles.clone()),
    }
}

/// The normals of the points of a cloud, if it has some.
///
/// # Errors
/// Another number of them than of points, or a z in the plane.
pub fn normals<const D: usize>(clouds: &Clouds, pointer: &'static str) -> Result<Option<Vec<Vector<D>>>, Violation> {
    let refuse = |detail: String| Violation::new(pointer, "data", detail, Value::Null, json!("PointData/normal"));
    let Some((cloud, normals)) = clouds.get(pointer).and_then(|cloud| Some((cloud, cloud.normals.as_ref()?))) else {
        return Ok(None);
    };
    if normals.len() != cloud.positions.len() {
        return Err(refuse(format!("{} normals for {} points", normals.len(), cloud.positions.len())));
    }
    if D == 2
        && let Some(place) = normals.iter().position(|n| n[2] != 0.0)
    {
        return Err(refuse(format!("the normal of point {place} has z = {} in the plane", normals[place][2])));
    }
    Ok(Some(normals.iter().map(|n| Vector::<D>::from_fn(|d, _| n[d])).collect()))
}

/// A violation where the spacing of a scene is not that of its points: the median distance to the nearest other point
/// must lie between a third and three times it.
#[must_use]
pub fn check_spacing<const D: usize>(points: &[Vector<D>], spacing: f64) -> Option<Violation> {
    check_spacing_in(&sorted(points, spacing), points, spacing)
}

/// The points in cells of an edge of `spacing`.
#[must_use]
pub fn sorted<const D: usize>(points: &[Vector<D>], spacing: f64) -> CellList<D> {
    let mut cells = CellList::new(Domain::unbounded());
    cells.rebuild(points.iter().copied(), spacing);
    cells
}

/// [`check_spacing`] for points that are [`sorted`].
#[must_use]
pub fn check_spacing_in<const D: usize>(cells: &CellList<D>, points: &[Vector<D>], spacing: f64) -> Option<Violation> {
    // A few hundred points tell the median.
    let stride = points.len().div_ceil(500);
    let nearest = |k: usize| {
        let mut least = f64::INFINITY;
        let mut radius = spacing;
        for _ in 0..12 {
            let found = &mut Vec::new();
            cells.gather(&points[k], radius, found);
            least = found.iter().filter(|n| n.index != k && n.r2 > 0.0).map(|n| n.r2.sqrt()).fold(least, f64::min);
            if least.is_finite() {
                break;
            }
            radius *= 2.0;
        }
        least
    };
    let mut distances: Vec<f64> = (0..points.len()).step_by(stride).map(nearest).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances[distances.len() / 2];
    if (spacing / 3.0..=spacing * 3.0).contains(&median) {
        return None;
    }
    let detail = format!("the points lie {median:.3e} apart (median distance to the nearest other one)");
    Some(Violation::new("/spacing", "conflict", detail, spacing, median))
}
