//! Everything that reads what strangers send, fed with mutations of what is right: no crash, and what is accepted is
//! whole. In this process, so that a panic is seen.

use super::files;
use meniscus::geometry::random::CounterRandom;
use meniscus::scene::CloudSizes;
use meniscus::scene::parse;
use meniscus::scenes::SCENES;
use meniscus::simulation::OutputPlan;
use meniscus_jobs::formats::mesh;
use meniscus_jobs::formats::structure::{self, Bytes};
use meniscus_jobs::spec::body::{self, Allowance, NoSources};
use meniscus_jobs::spec::calibration::Calibration;
use meniscus_jobs::spec::strict_json;
use meniscus_jobs::spec::study;
use serde_json::{Value, json};

/// Draws from a seed and a count.
pub struct Draws {
    random: CounterRandom,
    drawn: i64,
}

impl Draws {
    pub fn new(seed: u64, run: u64) -> Self {
        Self { random: CounterRandom::new(seed ^ run.wrapping_mul(0x9E37_79B9_7F4A_7C15)), drawn: 0 }
    }

    /// A number below `most`.
    pub fn below(&mut self, most: usize) -> usize {
        self.drawn += 1;
        let x = 0.5 + 0.5 * self.random.symmetric(&[self.drawn]);
        ((x * most as f64) as usize).min(most.saturating_sub(1))
    }

    fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }
}

fn odd_value(draws: &mut Draws) -> Value {
    let odd = [
        json!(null),
        json!(true),
        json!(0),
        json!(-1),
        json!(1e-320),
        json!(1e308),
        json!(-0.0),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(0.1),
        json!(""),
        json!("circle"),
        json!("\u{0}"),
        json!([]),
        json!([1, 2, 3]),
        json!([[[]]]),
        json!({}),
        json!({"type": "union", "of": []}),
        json!({"type": "points", "upload": "upl_x"}),
        json!("x".repeat(3000)),
        json!({"type": "circle", "radius": 1e-200}),
        json!({"type": "box", "size": [1e300, 1]}),
        json!(3),
        json!(0.5),
    ];
    draws.pick(&odd).clone()
}

/// Changes something somewhere.
fn mutate(value: &mut Value, draws: &mut Draws, words: &[String]) {
    match value {
        Value::Object(map) if !map.is_empty() && draws.below(8) > 0 => {
            let key = map.keys().nth(draws.below(map.len())).unwrap().clone();
            match draws.below(10) {
                0 => drop(map.shift_remove(&key)),
                1 => drop(map.insert(draws.pick(words).clone(), odd_value(draws))),
                2 => {
                    let taken = map.shift_remove(&key).unwrap();
                    map.insert(draws.pick(words).clone(), taken);
                }
                _ => mutate(map.get_mut(&key).unwrap(), draws, words),
            }
        }
        Value::Array(list) if !list.is_empty() && draws.below(4) > 0 => {
            let k = draws.below(list.len());
            match draws.below(4) {
                0 => drop(list.remove(k)),
                1 => list.insert(k, odd_value(draws)),
                _ => mutate(&mut list[k], draws, words),
            }
        }
        Value::Number(number) if draws.below(3) > 0 => {
            let scale = [0.0, -1.0, 1e-3, 0.5, 2.0, 10.0, 1e6, 1e100][draws.below(8)];
            *value = json!(number.as_f64().unwrap_or(0.0) * scale);
        }
        Value::String(_) if draws.below(2) > 0 => *value = json!(draws.pick(words)),
        _ => *value = odd_value(draws),
    }
}

/// Every name in the schemas of all kinds.
fn words() -> Vec<String> {
    fn collect(value: &Value, into: &mut Vec<String>) {
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| {
                into.push(key.clone());
                collect(value, into);
            }),
            Value::Array(list) => list.iter().for_each(|value| collect(value, into)),
            Value::String(text) if text.len() < 30 => into.push(text.clone()),
            _ => {}
        }
    }
    let mut words = vec!["kind".to_owned(), "preset".to_owned(), "scene".to_owned()];
    for kind in SCENES {
        collect(&kind.json_schema(), &mut words);
    }
    words.sort();
    words.dedup();
    words
}

fn seeds() -> Vec<Value> {
    let mut seeds: Vec<Value> = SCENES.iter().map(|kind| serde_json::from_str(kind.example).unwrap()).collect();
    for kind in SCENES {
        let scenes: Vec<Value> = serde_json::from_str(kind.calibration).unwrap();
        seeds.extend(scenes.into_iter().map(|scene| json!({"scene": scene})));
        let bare = parse(&json!({"kind": kind.kind}), SCENES).ok().unwrap().resolved();
        seeds.push(
            json!({"scene": bare, "limits": {"threads": 1}, "output": {"every_time": 0.1}, "checkpoint": {"keep": 3}}),
        );
        seeds.push(json!({"scene": {"kind": kind.kind, "preset": "paper"}, "labels": {"a": "b"}, "priority": 3}));
    }
    seeds
}

const ALLOWANCE: Allowance = Allowance { threads: 2, memory_bytes: 4 << 30, local_files: false };

/// Bodies of jobs: errors or a scene that resolves to itself.
pub fn scenes(count: u64, seed: u64) -> String {
    let (seeds, words) = (seeds(), words());
    let mut accepted = 0;
    for run in 0..count {
        let mut draws = Draws::new(seed, run);
        let mut spec = draws.pick(&seeds).clone();
        for _ in 0..=draws.below(4) {
            mutate(&mut spec, &mut draws, &words);
        }
        let mut text = spec.to_string().into_bytes();
        if draws.below(10) == 0 && !text.is_empty() {
            let k = draws.below(text.len());
            text[k] = draws.below(256) as u8;
        }
        let Ok(spec) = strict_json::parse(&text) else { continue };
        match body::parse(&spec, ALLOWANCE, &NoSources) {
            Err(found) => assert!(!found.violations().is_empty(), "refused without a word: {spec}"),
            Ok(body) => {
                accepted += 1;
                let again = parse(&body.resolved.scene, SCENES)
                    .unwrap_or_else(|found| panic!("what is resolved is refused: {spec}: {found:?}"));
                assert_eq!(again.resolved(), body.resolved.scene, "{spec}");
                let plan = OutputPlan { every_time: None, series_every_steps: 10 };
                let work = again.work(&again.estimate(&CloudSizes::new()), &plan);
                assert!(work.iter().all(|phase| phase.units >= 0.0), "{spec}: {work:?}");
            }
        }
    }
    format!("{count} bodies, {accepted} accepted, no crash (seed {seed})")
}

/// Bodies of studies.
pub fn studies(count: u64, seed: u64) -> String {
    let mut words = words();
    words.extend(
        ["/scene/spacing", "/scene/shape/radius", "/limits/threads", "/", "//", "/~2", "/output/fields/0"]
            .map(str::to_owned),
    );
    let base = json!({"scene": {"kind": "redistance", "spacing": 0.1}});
    let seeds = [
        json!({"base": base, "sweep": {"mode": "grid", "axes": {"/scene/spacing": [0.1, 0.05], "/scene/repeat": [1, 2]}}}),
        json!({"base": base, "sweep": {"mode": "zip", "axes": {"/scene/spacing": [0.1, 0.05]}}, "max_parallel": 2, "on_failure": "stop"}),
        json!({"base": base, "sweep": {"mode": "list", "points": [{"/scene/spacing": 0.1}, {"/scene/shape": "circle"}]}, "name": "x"}),
        json!({"base": base, "sweep": {"mode": "refine", "axis": "/scene/spacing", "from": 0.1, "ratio": 1.5, "levels": {"least": 2, "most": 3},
            "with": {"/scene/spacing": "proportional"}, "quantity": {"error": {"quantity": "phi", "norm": "rms"}},
            "until": {"tolerance": 1e-3, "relative": true}, "budget": {"cpu_s": 3}, "alternatives": {"/scene/repeat": [1, 2]}, "reuse": false}}),
    ];
    let mut accepted = 0;
    for run in 0..count {
        let mut draws = Draws::new(seed, run);
        let mut spec = draws.pick(&seeds).clone();
        for _ in 0..=draws.below(3) {
            mutate(&mut spec, &mut draws, &words);
        }
        match study::parse(&spec, ALLOWANCE, 2, &NoSources, &Calibration::default(), |_| ()) {
            Err(found) => assert!(!found.violations().is_empty(), "refused without a word: {spec}"),
            Ok(study) => {
                accepted += 1;
                let levels = study.refines.is_some();
                assert!(if levels { study.jobs.is_empty() } else { study.points.len() == study.jobs.len() }, "{spec}");
            }
        }
    }
    format!("{count} bodies, {accepted} accepted, no crash (seed {seed})")
}

/// Changes bytes: turned bits, odd numbers in place, cuts, doubled pieces.
pub fn mutate_bytes(bytes: &mut Vec<u8>, draws: &mut Draws) {
    for _ in 0..=draws.below(4) {
        if bytes.is_empty() {
            return;
        }
        let k = draws.below(bytes.len());
        match draws.below(8) {
            0..=2 => bytes[k] ^= 1 << draws.below(8),
            3 => bytes[k] = [0, 1, 0x7F, 0x80, 0xFE, 0xFF][draws.below(6)],
            4 => {
                let value = [0_u64, 1, u64::MAX, u64::MAX - 1, 1 << 63, 96, 0x7FFF_FFFF][draws.below(7)];
                let width = [2, 4, 8][draws.below(3)].min(bytes.len() - k);
                bytes[k..k + width].copy_from_slice(&value.to_le_bytes()[..width]);
            }
            5 => bytes.truncate(k),
            6 => {
                let piece: Vec<u8> = bytes[k..].iter().take(1 + draws.below(64)).copied().collect();
                let at = draws.below(bytes.len());
                bytes.splice(at..at, piece);
            }
            _ => {
                let (from, width) = (draws.below(bytes.len()), 1 + draws.below(32));
                for d in 0..width.min(bytes.len() - k).min(bytes.len() - from) {
                    bytes[k + d] = bytes[from + d];
                }
            }
        }
    }
}

/// Bytes of a data set at most that the proof reads.
const LARGEST_DATA: u64 = 1 << 20;

/// Bytes of a file whose check sums are not compared, so that what is behind them is reached.
struct WithoutSums<'a>(&'a [u8]);

impl Bytes for WithoutSums<'_> {
    fn size(&self) -> u64 {
        self.0.size()
    }

    fn fill(&self, at: u64, buffer: &mut [u8]) -> bool {
        self.0.fill(at, buffer)
    }

    fn has_sums(&self) -> bool {
        false
    }
}

/// HDF5 files in every format and storage: their structure, and the numbers of all data sets.
pub fn structures(count: u64, seed: u64) -> String {
    let files: Vec<(Vec<u8>, Vec<usize>)> =
        files::points_files().into_iter().map(|bytes| (bytes.clone(), files::parts(&bytes))).collect();
    let (mut accepted, mut read, mut refused) = (0, 0, 0);
    for run in 0..count {
        let mut draws = Draws::new(seed, run);
        let (whole, parts) = draws.pick(&files);
        let mut bytes = whole.clone();
        files::mutate_file(&mut bytes, parts, &mut draws);
        let bytes = WithoutSums(&bytes);
        let Ok(structure) = structure::read(&bytes) else { continue };
        accepted += 1;
        for (place, data_set) in &structure.data_sets {
            if data_set.elements().saturating_mul(data_set.element_bytes) > LARGEST_DATA {
                continue;
            }
            match structure::reals(&bytes, place, data_set) {
                Ok(numbers) => {
                    read += 1;
                    assert_eq!(numbers.len() as u64, data_set.elements(), "run {run} of seed {seed}: {place}");
                }
                Err(refusal) => {
                    refused += 1;
                    assert!(refusal.to_string().contains(place.as_str()), "{refusal}");
                }
            }
        }
    }
    format!("{count} files, {accepted} accepted, {read} data sets read, {refused} refused, no crash (seed {seed})")
}

/// Meshes in every format.
pub fn meshes(count: u64, seed: u64) -> String {
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0\n1 0 0 1 0 0\n0 1 0 1 0 0\n0 0 1 1 0 0\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    let mut binary = ply.split("end_header\n").next().unwrap().replace("ascii", "binary_little_endian").into_bytes();
    binary.extend(b"end_header\n");
    binary.extend((0..24).flat_map(|k| (k as f32).to_le_bytes()));
    for face in [[0_i32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        binary.push(3);
        binary.extend(face.iter().flat_map(|v| v.to_le_bytes()));
    }
    let obj =
        b"# x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 0 0\nf 1//1 3//1 2//1\nf -4 -1 3\nf 2/1/1 3/2/1 4\n".to_vec();
    let xyz = b"0 0 0\n1,0,0\n0 1 0 # c\n\n0;0;1e5\n".to_vec();
    let colors = b"X,Y,Z,R,G,B,NX,NY,NZ\n0,0,1,255,0,7,0,0,1\n0,1,0,255,0,7,0,1,0\n".to_vec();
    let continued = b"\xEF\xBB\xBFv 0 0 \\\r\n0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 \\\r\n3\r\nf 1 2\r\n".to_vec();
    let strips = b"ply\rformat ascii 1.0\rcomment \xF6\relement vertex 4\rproperty float x\rproperty float y\rproperty int q\relement tristrips 1\rproperty list int int vertex_indices\relement edge 1\rproperty list uchar short a\rend_header\r0 0 1\r1 0 2\r0 1 3\r1 1 4\r9 0 1 2 3 -1 3 2 1 -1\r2 1 2\r".to_vec();
    let facets = b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n".to_vec();
    let mut stl = vec![0; 80];
    stl.extend(2_u32.to_le_bytes());
    for triangle in [
        [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0],
    ] {
        stl.extend(triangle.iter().flat_map(|c| c.to_le_bytes()));
        stl.extend([0; 2]);
    }
    let utf_16 = "\u{FEFF}0 0 0 0 0 1\r\n1 0 0 0 0 1\r\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let seeds = [ply.as_bytes().to_vec(), binary, obj, xyz, colors, continued, strips, facets, stl, utf_16];
    let mut accepted = 0;
    for run in 0..count {
        let mut draws = Draws::new(seed, run);
        let mut bytes = draws.pick(&seeds).clone();
        mutate_bytes(&mut bytes, &mut draws);
        let found = mesh::read(&bytes).and_then(|mut mesh| {
            mesh.leave_out_loose_points()?;
            mesh.check().map(|()| mesh)
        });
        if let Ok(mesh) = found {
            accepted += 1;
            assert!(mesh.points.iter().flatten().all(|c| c.is_finite()));
            assert!(mesh.normals.is_empty() || mesh.normals.len() == mesh.points.len());
            assert!(mesh.triangles().as_flattened().iter().all(|corner| (*corner as usize) < mesh.points.len()));
            let _ = mesh.is_closed();
        }
    }
    format!("{count} meshes, {accepted} accepted, no crash (seed {seed})")
}
