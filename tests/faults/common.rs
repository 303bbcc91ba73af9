//! What the proofs share: the results of an undisturbed run, and files on disk.

use crate::support::Service;
use serde_json::Value;
use std::path::PathBuf;

/// The results that every disturbed run must reach, from an undisturbed one.
pub struct Expected {
    pub frames: Vec<(String, String)>,
    pub series: String,
}

impl Expected {
    pub fn of(service: &Service, body: &Value) -> Self {
        let id = service.submit(body);
        service.wait_for(&id, &["succeeded"]);
        Self { frames: service.frames(&id), series: service.series(&id) }
    }

    pub fn check(&self, service: &Service, id: &str) {
        // The whole files are the same bytes, which is more than their data sets.
        assert_eq!(service.frames(id), self.frames, "{id}");
        assert_eq!(service.series(id), self.series, "{id}");
        let ids: Vec<u64> = service.events(id).iter().map(|e| e["id"].as_u64().unwrap()).collect();
        assert_eq!(ids, (1..=ids.len() as u64).collect::<Vec<_>>(), "{id}: events have gaps");
        let fractions: Vec<f64> = service
            .events(id)
            .iter()
            .filter(|e| e["type"] == "progress")
            .map(|e| e["data"]["fraction"].as_f64().unwrap())
            .collect();
        assert!(fractions.is_sorted(), "{id}: the fraction falls: {fractions:?}");
        // What killed attempts left behind is gone: as many frames and checkpoints on disk as listed.
        let frames = files_below(service, id, "frames");
        assert_eq!(frames.len(), self.frames.len(), "{id}: {frames:?}");
        let listed = service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"].as_array().unwrap().len();
        let checkpoints = files_below(service, id, "checkpoints");
        assert_eq!(checkpoints.len(), listed, "{id}: {checkpoints:?}");
    }
}

/// All files in a folder of every attempt of a job, by name.
pub fn files_below(service: &Service, id: &str, folder: &str) -> Vec<PathBuf> {
    let attempts = service.data.join("jobs").join(id).join("attempts");
    let attempts = std::fs::read_dir(attempts).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = attempts
        .flat_map(|attempt| std::fs::read_dir(attempt.path().join(folder)).into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .collect();
    files.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    files
}

/// The whole checkpoints among them.
pub fn checkpoint_files(service: &Service, id: &str) -> Vec<PathBuf> {
    let is_whole = |path: &PathBuf| path.extension().is_some_and(|e| e == "h5");
    files_below(service, id, "checkpoints").into_iter().filter(is_whole).collect()
}
