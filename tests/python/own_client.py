"""What the client of api/clients/python does with a real service; the address is the argument."""

import sys

import numpy

from meniscus_client import Ended, Meniscus, Refused

service = Meniscus(sys.argv[1])
body = {
    "name": "by the client",
    "labels": {"made": "python"},
    "scene": {"kind": "vortex", "spacing": 0.05, "end_time": 0.4, "flow": {"type": "single_vortex", "period": 2}},
    "output": {"every_time": 0.1},
}

assert {kind["kind"] for kind in service.scenes()} >= {"vortex", "droplet", "front", "redistance", "surface_pde"}
assert service.estimate(body)["particles"] > 100

# A job: its looks, its series, its frames, its report, and one that goes on from it.
looks = []
job = service.submit(body).wait(timeout_s=120, shows=False, told=lambda view: looks.append(view["state"]))
assert looks[-1] == "succeeded" and job.state == "succeeded", looks
series = job.series()
assert series.index[-1] == 0.4 and "area" in series.columns, series
frames = list(job.frames())
assert len(frames) == 5 and [round(frame.time, 6) for frame in frames] == [0, 0.1, 0.2, 0.3, 0.4]
last = job.frame()
assert last.points.shape == (len(last.fields["phi"]), 3) and last.fields["normal"].shape == last.points.shape
assert numpy.isfinite(last.points).all() and last.triangles.shape == (0, 3)
assert job.report()["cost"]["steps"] > 0 and len(job.checkpoints()) > 0
later = job.restart(end_time=0.5).wait(timeout_s=120, shows=False)
assert later.series().index[-1] == 0.5
assert [found.id for found in service.jobs(**{"label.made": "python"})] == [job.id]

# What the service refuses, and what does not succeed, are errors that say why.
try:
    service.submit({"scene": {"kind": "vortex", "spaceing": 0.1}})
    raise SystemExit("a slip went through")
except Refused as refused:
    assert refused.status == 422 and "/scene/spaceing" in str(refused), refused
try:
    service.job("job_nothing")
    raise SystemExit("a job of nothing")
except Refused as refused:
    assert refused.status == 404
long = service.submit({**body, "scene": {**body["scene"], "end_time": 500, "flow": {"type": "single_vortex", "period": 1000}}})
long.cancel()
try:
    long.wait(timeout_s=60, shows=False)
    raise SystemExit("a canceled job succeeded")
except Ended as ended:
    assert "canceled" in str(ended)

# A study, and one that refines.
study = service.submit_study({
    "base": {"scene": {"kind": "redistance"}},
    "sweep": {"mode": "grid", "axes": {"/scene/spacing": [0.1, 0.07, 0.05]}},
}).wait(timeout_s=120, shows=False)
table = study.table()
assert len(table) == 3 and (table["state"] == "succeeded").all(), table
assert study.report()["errors"][0]["lines"][0]["order"] > 1
refined = service.submit_study({
    "base": {"scene": {"kind": "redistance"}},
    "sweep": {
        "mode": "refine", "axis": "/scene/spacing", "from": 0.08,
        "quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "until": {"tolerance": 1e-4},
    },
}).wait(timeout_s=120, shows=False)
assert refined.report()["tolerance_met"], refined.report()

# A file of one's own.
corners = [f"v {x} {y} {z}" for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
sides = ["f 1 3 4 2", "f 5 6 8 7", "f 1 2 6 5", "f 3 7 8 4", "f 1 5 7 3", "f 2 4 8 6"]
upload = service.upload("\n".join(corners + sides).encode(), "mesh")
assert abs(upload.view["found"]["volume"] - 1) < 1e-12, upload.view
cube = service.submit({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.15, "shape": {"type": "mesh", "upload": upload.id}}})
assert cube.wait(timeout_s=120, shows=False).frame().points.shape[0] > 100
try:
    service.upload(b"no mesh at all", "mesh")
    raise SystemExit("no mesh went through")
except Ended as ended:
    assert "rejected" in str(ended), ended
later.delete()
job.delete()
assert job.id not in {found.id for found in service.jobs()}
print("well")
