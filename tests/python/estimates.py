"""Estimates before a run against what the run took, on a service that measures the machine by itself at its start.

python estimates.py MENISCUS: a line a scene with estimated over reached, and the median error of the time left after a tenth of a run.
The estimate is asked for before the first of three runs and held against the median of the time that they took: the same run takes
.3 more or less on a machine that others use too.
"""

import json
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request

SPHERE = {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}
SCENES = [
    {"kind": "redistance", "spacing": 0.0078125, "repeat": 100},
    {"kind": "redistance", "spacing": 0.00390625, "repeat": 300},
    {"kind": "redistance", "dimension": 3, "spacing": 0.03125, "repeat": 15},
    {"kind": "redistance", "dimension": 3, "spacing": 0.02},
    {"kind": "redistance", "spacing": 0.00390625, "repeat": 100, "preset": "paper"},
    {"kind": "redistance", "spacing": 0.01, "repeat": 60, "shape": {"type": "circle", "radius": 0.6},
     "method": {"type": "pcp", "degree": 6}},
    {"kind": "vortex", "spacing": 0.015625},
    {"kind": "vortex", "spacing": 0.0078125},
    {"kind": "vortex", "spacing": 0.015625, "field": "overwrite"},
    {"kind": "vortex", "spacing": 0.0078125, "preset": "paper"},
    {"kind": "vortex", "dimension": 3, "flow": "vortex_3d", "spacing": 0.03, "shape": SPHERE},
    {"kind": "vortex", "spacing": 0.004, "end_time": 2,
     "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 3.14}},
    {"kind": "droplet", "end_time": 0.3},
    {"kind": "droplet", "spacing": 0.02, "end_time": 0.1, "geometry": "colorfield"},
    {"kind": "droplet", "case": "dividing", "end_time": 0.12},
    {"kind": "droplet", "dimension": 3, "spacing": 0.08, "end_time": 0.02},
]
RUNS = 3


class Service:
    """A service on a directory of its own, with one slot of one thread."""

    def __init__(self, program):
        self.directory = tempfile.TemporaryDirectory()
        self.log = open(f"{self.directory.name}/log", "w+")
        command = [program, "serve", "--data", f"{self.directory.name}/data", "--bind", "127.0.0.1:0", "--slots", "1", "--threads", "1"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log, text=True)
        self.url = self.process.stdout.readline().split()[-1]

    def ask(self, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        with urllib.request.urlopen(urllib.request.Request(self.url + path, data)) as answer:
            return json.load(answer)

    def wait_until_measured(self):
        deadline = time.time() + 120
        while self.ask("/v1/estimates", {"scene": SCENES[0]})["wall_s"] is None:
            assert time.time() < deadline, "the machine was not measured"
            time.sleep(0.2)


def run(service, scene):
    """The job at its end, and (time, fraction, time left) of every record on the way."""
    job = service.ask("/v1/jobs", {"scene": scene})
    seen = []
    while job["state"] not in ("succeeded", "failed", "canceled"):
        time.sleep(0.02)
        job = service.ask(f"/v1/jobs/{job['id']}")
        progress = job["progress"]
        record = (progress["fraction"], progress["eta_s"])
        if progress["eta_s"] is not None and (not seen or seen[-1][1:] != record):
            seen.append((time.time(), *record))
    assert job["state"] == "succeeded", job["message"]
    return job, seen, time.time()


def main(program):
    service = Service(program)
    service.wait_until_measured()
    within, first, every = {}, [], []
    print("particles  memory    disk    time   (took)  left  scene")
    for scene in SCENES:
        estimate = service.ask("/v1/estimates", {"scene": scene})
        runs = [run(service, scene) for _ in range(RUNS)]
        usage = runs[0][0]["usage"]
        took = statistics.median(job["usage"]["wall_s"] for job, _, _ in runs)
        ratios = {
            "particles": estimate["particles"] / runs[0][0]["progress"]["particles"],
            "memory": estimate["memory_bytes"] / usage["peak_memory_bytes"],
            "disk": estimate["disk_bytes"] / usage["disk_bytes"],
            "time": estimate["wall_s"] / took,
        }
        for name, ratio in ratios.items():
            within[name] = within.get(name, 0) + (0.7 <= ratio <= 1.3)
        numbers = "  ".join(f"{ratio:6.2f}" for ratio in ratios.values())
        late = []
        for _, seen, end in runs:
            errors = [abs(left - (end - at)) / (end - at) for at, fraction, left in seen if 0.1 <= fraction < 1]
            first += errors[:1]
            late += errors
        every += late
        error = f"{100 * statistics.median(late):3.0f} %" if late else "    –"
        print(f"   {numbers}  {took:6.2f} s  {error}  {json.dumps(scene)}")
    print("within 30 %:", ", ".join(f"{name} {count} of {len(SCENES)}" for name, count in within.items()))
    for what, errors in [("at the first record after a tenth of a run", first), ("at every record after it", every)]:
        print(f"time left, {what}: median error {100 * statistics.median(errors):.0f} % of {len(errors)}")
    service.process.send_signal(signal.SIGTERM)
    service.process.wait()


main(sys.argv[1])
