//! Files from outside: what they are to be used as, and what was found in them. They are hostile until a short-lived
//! process under limits ([`crate::inspection`]) has looked into them: HDF5 files by our own reading
//! ([`crate::formats::structure`]), of which libhdf5 sees no byte, meshes by our own parsers ([`crate::formats::mesh`]).
//! Points leave that process in a plain format ([`crate::formats::cloud_file`]), so that no other process opens the file.

use meniscus::scene::CloudSize;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a file is to be used as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Purpose {
    /// A checkpoint to begin with.
    Checkpoint,
    /// Particles with their level.
    Points,
    /// A surface: points, normals where there are some, faces where there are some.
    Surface,
    /// Places to ask about.
    Queries,
    /// A closed mesh of triangles, or the corners of a polygon in order.
    Mesh,
    /// Values in the order of the points of a surface.
    Values,
    /// Velocities on a regular grid.
    Flow,
}

impl Purpose {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Checkpoint, Self::Points, Self::Surface, Self::Queries, Self::Mesh, Self::Values, Self::Flow];

    /// The word that stands for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Checkpoint => "checkpoint",
            Self::Points => "points",
            Self::Surface => "surface",
            Self::Queries => "queries",
            Self::Mesh => "mesh",
            Self::Values => "values",
            Self::Flow => "flow",
        }
    }

    /// From its word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|purpose| purpose.word() == word)
    }
}

/// Outcome of an inspection, a line of JSON from the process that looks into a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Inspection {
    /// The file is what it is to be used as; of points, the points follow the line.
    Ready(Contents),
    /// It is not, for a reason that the client is told.
    Rejected(String),
}

/// What an inspection found in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Contents {
    /// An uploaded checkpoint.
    Checkpoint(CheckpointContents),
    /// Points, with or without a surface.
    Points(PointContents),
    /// Values at points.
    Values(ValueContents),
    /// Velocities on a grid.
    Flow(FlowContents),
}

/// A checkpoint that was uploaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CheckpointContents {
    /// Resolved body of the job that wrote it.
    pub body: Value,
    /// Step of the simulation.
    pub step: u64,
    /// Scene time of that step.
    pub time: f64,
    /// Instruction set that it was written on.
    pub isa: String,
    /// Program that wrote it.
    pub build: String,
    /// Job that wrote it.
    pub job: String,
    /// Arrays of the state.
    pub arrays: Vec<ArrayContents>,
}

/// An array of an uploaded checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArrayContents {
    /// Name of the array.
    pub name: String,
    /// Numbers per entry; 0 marks whole numbers.
    pub components: usize,
}

/// Points that were uploaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointContents {
    /// Number of points.
    pub points: u64,
    /// Fields that they have.
    pub fields: Vec<String>,
    /// Lower corner of the box around them.
    pub low: [f64; 3],
    /// Upper corner of the box around them.
    pub high: [f64; 3],
    /// Whether a surface came with normals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normals: Option<bool>,
    /// Faces, of a surface from a mesh file.
    #[serde(flatten)]
    pub faces: Option<FaceContents>,
    /// Points of a mesh that were left out because no face has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points_left_out: Option<u64>,
    /// Surface area of a closed mesh, or the length of a polygon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
    /// Volume that a closed mesh encloses, or the area of a polygon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
}

/// Values that were uploaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ValueContents {
    /// Number of values in a column.
    pub values: u64,
    /// The columns.
    pub columns: Vec<ColumnContents>,
}

/// Velocities on a grid that were uploaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlowContents {
    /// Nodes along x, y and z.
    pub nodes: [usize; 3],
    /// The first node.
    pub low: [f64; 3],
    /// The last node.
    pub high: [f64; 3],
    /// Number of times.
    pub times: u64,
    /// The first of them.
    pub first_time: f64,
    /// The last of them.
    pub last_time: f64,
    /// The largest speed at a node.
    pub fastest: f64,
}

/// A column of values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColumnContents {
    /// Its name.
    pub name: String,
    /// The least value; None where no value is finite.
    pub least: Option<f64>,
    /// The greatest value.
    pub greatest: Option<f64>,
}

/// Faces of a mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FaceContents {
    /// Number of faces.
    pub faces: usize,
    /// Whether every edge has two faces; None without faces.
    pub is_closed: Option<bool>,
}

impl Contents {
    /// Number of points, values or nodes; None for a checkpoint.
    #[must_use]
    pub fn points(&self) -> Option<u64> {
        self.size().map(|size| size.points)
    }

    /// Number of points or values, and the area of a mesh; None for a checkpoint.
    #[must_use]
    pub fn size(&self) -> Option<CloudSize> {
        match self {
            Self::Checkpoint(_) => None,
            Self::Values(found) => Some(found.values.into()),
            Self::Flow(found) => Some((found.nodes.iter().product::<usize>() as u64).into()),
            Self::Points(PointContents { points, area, points_left_out, .. }) => {
                Some(CloudSize { points: *points, area: *area, left_out: points_left_out.unwrap_or(0) })
            }
        }
    }
}

/// Points that a file may hold at most.
pub const MOST_POINTS: u64 = 20_000_000;

#[cfg(test)]
mod tests {
    use super::{Contents, Inspection};
    use serde_json::json;

    #[test]
    fn contents_come_back_from_their_json_and_keep_what_clients_saw() {
        let points = json!({"points": 3, "fields": ["phi"], "low": [0.0, 0.0, 0.0], "high": [1.0, 1.0, 0.0]});
        let mesh = json!({
            "points": 3, "fields": ["normal"], "low": [0.0, 0.0, 0.0], "high": [1.0, 1.0, 0.0],
            "normals": true, "faces": 0, "is_closed": null,
        });
        let checkpoint = json!({
            "body": {"scene": {}}, "step": 7, "time": 0.5, "isa": "x86_64", "build": "0.1.0", "job": "job_1",
            "arrays": [{"name": "phi", "components": 1}],
        });
        let closed = json!({
            "points": 4, "fields": [], "low": [0.0, 0.0, 0.0], "high": [1.0, 1.0, 1.0], "faces": 4, "is_closed": true,
            "area": 2.5, "volume": 0.125,
        });
        let values = json!({"values": 3, "columns": [{"name": "u", "least": -1.0, "greatest": 2.5}]});
        let flow = json!({
            "nodes": [9, 7, 1], "low": [0.0, 0.0, 0.0], "high": [1.0, 1.0, 0.0], "times": 2, "first_time": 0.0,
            "last_time": 1.0, "fastest": 3.5,
        });
        for (json, has_points) in
            [(points, true), (mesh, true), (closed, true), (checkpoint, false), (values, true), (flow, true)]
        {
            let contents: Contents = serde_json::from_value(json.clone()).unwrap();
            assert_eq!(contents.points().is_some(), has_points);
            assert_eq!(serde_json::to_value(&contents).unwrap(), json);
            assert_eq!(serde_json::to_value(Inspection::Ready(contents)).unwrap(), json!({"ready": json}));
        }
    }
}
