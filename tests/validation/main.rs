#[path = "../support/mod.rs"]
mod support;
use serde_json::json;
use support::{error, run};

#[test]
fn explore() {
    for n in [16, 32, 64, 128] {
        let t = std::time::Instant::now();
        let r = run(&json!({"kind": "redistance", "spacing": 1.0 / f64::from(n), "preset": "paper"}));
        println!("2D paper 1/{n}: rms {:.2e} max {:.2e} cp {:.2e} n {:.2e} k {:.2e} {:?} {:?}", error(&r, "phi", "rms", None), error(&r, "phi", "max", None), error(&r,"closest_point","rms",None), error(&r,"normal","rms",None), error(&r,"curvature","rms",None), t.elapsed(), r.newton);
        let r = run(&json!({"kind": "redistance", "spacing": 1.0 / f64::from(n)}));
        println!("2D def   1/{n}: rms {:.2e} max {:.2e} cp {:.2e} n {:.2e} k {:.2e} {:?}", error(&r, "phi", "rms", None), error(&r, "phi", "max", None), error(&r,"closest_point","rms",None), error(&r,"normal","rms",None), error(&r,"curvature","rms",None), r.rescued_fits);
    }
    for n in [8, 16, 32] {
        let t = std::time::Instant::now();
        let r = run(&json!({"kind": "redistance", "dimension": 3, "spacing": 1.0 / f64::from(n), "preset": "paper"}));
        println!("3D paper 1/{n}: rms {:.2e} max {:.2e} cp {:.2e} n {:.2e} k {:.2e} {:?} {:?}", error(&r, "phi", "rms", None), error(&r, "phi", "max", None), error(&r,"closest_point","rms",None), error(&r,"normal","rms",None), error(&r,"curvature","rms",None), t.elapsed(), r.newton);
    }
}

#[test]
fn vortex() {
    for (n, v) in [(64, json!({"preset":"paper"})), (32, json!({"preset":"paper"})), (64, json!({})), (128, json!({})),
      (64, json!({"method":{"type":"pcp","neighborhood":{"type":"nearest","count":30}}})),
      (64, json!({"method":{"type":"pcp","degree":2,"neighborhood":{"type":"nearest","count":20}}})),
      (64, json!({"method":{"type":"pcp","degree":3,"neighborhood":{"type":"nearest","count":25}}})),
      (64, json!({"field":"overwrite"}))] {
        let t = std::time::Instant::now();
        let mut s = v.clone();
        s["kind"] = json!("vortex"); s["spacing"] = json!(1.0/f64::from(n));
        let r = run(&s);
        println!("vortex 1/{n} {v}: T/2 rms {:.2e} max {:.2e}; T rms {:.2e} max {:.2e} area {:.2e} samples {:.2e} {:?} {:?} {:?}", error(&r,"phi","rms",Some(4.0)), error(&r,"phi","max",Some(4.0)), error(&r,"phi","rms",Some(8.0)), error(&r,"phi","max",Some(8.0)), error(&r,"area","relative",Some(8.0)), error(&r,"samples","max",None), t.elapsed(), r.newton, r.rescued_fits);
    }
}
