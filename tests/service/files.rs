//! Files, parts of files, digests, backups, and runs without a service.

use crate::service;
use crate::support::{Service, program, steady_job};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn files_come_whole_in_parts_and_as_one_stream_that_proves_itself() {
    let (directory, service) = service(&[]);
    let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.05}}));
    service.wait_for(&id, &["succeeded"]);
    let path = format!("/v1/jobs/{id}/files/frames/000001.vtkhdf");
    let whole = service.get(&path);
    let tag = whole.header("etag").unwrap().to_owned();
    let listed = service.files(&id);
    let frame = listed.iter().find(|f| f["path"] == "frames/000001.vtkhdf").unwrap();
    assert_eq!(tag, format!("\"{}\"", frame["sha256"].as_str().unwrap()));
    assert_eq!(whole.bytes.len() as u64, frame["size_bytes"].as_u64().unwrap());
    assert!(whole.header("repr-digest").unwrap().starts_with("sha-256=:"));
    let part = service.request("GET", &path, &[("range", "bytes=100-199")], None);
    assert_eq!((part.status, part.bytes.as_slice()), (206, &whole.bytes[100..200]));
    assert_eq!(part.header("content-range").unwrap(), format!("bytes 100-199/{}", whole.bytes.len()));
    let tail = service.request("GET", &path, &[("range", "bytes=-7"), ("if-range", &tag)], None);
    assert_eq!((tail.status, tail.bytes.as_slice()), (206, &whole.bytes[whole.bytes.len() - 7..]));
    assert_eq!(service.request("GET", &path, &[("range", "bytes=0-9"), ("if-range", "\"other\"")], None).status, 200);
    assert_eq!(service.request("GET", &path, &[("range", "bytes=99999999-")], None).status, 416);
    assert_eq!(service.request("GET", &path, &[("if-none-match", &tag)], None).status, 304);
    assert_eq!(service.request("HEAD", &path, &[], None).status, 200);
    // tar and sha256sum, as a person would use them.
    let archive = directory.path().join("files.tar");
    std::fs::write(&archive, service.get(&format!("/v1/jobs/{id}/files.tar")).bytes).unwrap();
    run(Command::new("tar").arg("-xf").arg(&archive).arg("-C").arg(directory.path()));
    let sums = run(Command::new("sha256sum").args(["-c", "SHA256SUMS"]).current_dir(directory.path().join(&id)));
    assert_eq!(sums.lines().count(), listed.len() - 1);
    assert!(sums.lines().all(|line| line.ends_with(": OK")));
    // Checkpoints the same way, by redirection to the newest.
    let latest = service.get(&format!("/v1/jobs/{id}/checkpoints/latest/content"));
    assert_eq!(latest.status, 307);
    let content = service.get(latest.header("location").unwrap());
    let row = &service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"][0];
    assert_eq!(content.bytes.len() as u64, row["size_bytes"].as_u64().unwrap());
}

#[test]
fn a_backup_of_a_live_directory_is_a_service_of_its_own() {
    let (directory, service) = service(&["--slots", "1"]);
    let done = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.05}}));
    service.wait_for(&done, &["succeeded"]);
    let running = service.submit(&steady_job());
    service.wait_for(&running, &["running"]);
    let copy = directory.path().join("copy");
    run(Command::new(program()).arg("backup").arg(&copy).arg("--data").arg(&service.data));
    service.wait_for(&running, &["succeeded"]);
    let other = Service::start(&copy, &["--slots", "1"]);
    assert_eq!(other.frames(&done), service.frames(&done));
    for file in other.files(&done) {
        let path = format!("/v1/jobs/{done}/files/{}", file["path"].as_str().unwrap());
        assert_eq!(other.get(&path).bytes, service.get(&path).bytes);
    }
    // The job that was running goes on from what the copy holds, to the same end.
    other.wait_for(&running, &["succeeded"]);
    assert_eq!(other.frames(&running), service.frames(&running));
    assert_eq!(other.series(&running), service.series(&running));
}

#[test]
fn a_run_in_the_foreground_and_its_resumption_equal_the_service() {
    let (directory, service) = service(&[]);
    let scene = |repeat: u64| json!({"kind": "redistance", "spacing": 0.05, "repeat": repeat});
    let id = service.submit(&json!({"scene": scene(9)}));
    service.wait_for(&id, &["succeeded"]);
    let at = |name: &str| directory.path().join(name);
    let foreground = |body: &Value, name: &str| {
        std::fs::write(at("body.json"), body.to_string()).unwrap();
        run(Command::new(program()).arg("run").arg(at("body.json")).arg("--out").arg(at(name)))
    };
    let said = foreground(&scene(9), "bare");
    assert!(said.contains("phi") && said.contains("results in"));
    let frame = |out: &Path, number: u32| std::fs::read(out.join(format!("frames/{number:06}.vtkhdf"))).unwrap();
    let served = service.get(&format!("/v1/jobs/{id}/files/frames/000001.vtkhdf")).bytes;
    assert_eq!(frame(&at("bare"), 1), served);
    // A checkpoint half way, taken up by `resume`.
    foreground(&json!({"scene": scene(9), "checkpoint": {"every_steps": 4, "keep": 3}}), "kept");
    let checkpoint = at("kept").join("checkpoints/000000000004.h5");
    run(Command::new(program()).arg("resume").arg(&checkpoint).arg("--out").arg(at("resumed")));
    assert_eq!(frame(&at("resumed"), 2), served);
    let damaged = at("damaged.h5");
    let mut bytes = std::fs::read(&checkpoint).unwrap();
    // Longer than any gap between data sets, whose bytes mean nothing.
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4096].iter_mut().for_each(|byte| *byte ^= 1);
    std::fs::write(&damaged, bytes).unwrap();
    let refused = Command::new(program()).arg("resume").arg(&damaged).arg("--out").arg(at("refused")).output().unwrap();
    assert!(!refused.status.success());
    std::fs::write(at("body.json"), "{\"kind\": \"redistance\", \"spacin\": 1}").unwrap();
    let refused = Command::new(program()).arg("run").arg(at("body.json")).arg("--out").arg(at("no")).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("did you mean spacing?"));
}
