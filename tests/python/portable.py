"""Two builds of one program, for this machine and for any x86-64, must agree: the same scenes by both, every error of the
reports within 1e-6 of each other. Usage: portable.py NATIVE PORTABLE"""

import json
import pathlib
import subprocess
import sys
import tempfile

SCENES = [
    {"kind": "redistance", "spacing": 0.03125},
    {"kind": "vortex", "spacing": 0.03125, "steps": 40, "end_time": 1},
    {"kind": "droplet", "spacing": 0.08, "end_time": 0.05},
    {"kind": "droplet", "case": "dividing", "spacing": 0.05, "end_time": 0.02},
    {"kind": "droplet", "dimension": 3, "spacing": 0.12, "end_time": 0.01},
    {"kind": "droplet", "spacing": 0.08, "end_time": 0.05, "discretization": "dcpse"},
    {"kind": "surface_pde", "problem": "poisson", "method": {"type": "surface_dcpse", "order": 4}},
]
# Fused and separate roundings differ in the last digit; runs this short do not amplify that further.
RELATIVE = 1e-6
# Errors that are round-off themselves.
ABSOLUTE = 1e-9


def errors(binary, scene, directory):
    body = directory / "body.json"
    body.write_text(json.dumps({"scene": scene}))
    subprocess.run([binary, "run", str(body), "--out", str(directory / "out")], check=True, capture_output=True)
    report = json.loads(next((directory / "out").rglob("report.json")).read_text())
    return {(e["quantity"], e["norm"], e["time"]): e["value"] for e in report["errors"]}


def main():
    failed = False
    for scene in SCENES:
        found = []
        for binary in sys.argv[1:3]:
            with tempfile.TemporaryDirectory() as directory:
                found.append(errors(binary, scene, pathlib.Path(directory)))
        native, portable = found
        assert native and native.keys() == portable.keys(), scene
        distance = max(abs(native[k] - portable[k]) / max(abs(native[k]), ABSOLUTE / RELATIVE) for k in native)
        failed |= not distance <= RELATIVE
        print(f"{distance:.1e}  {json.dumps(scene)}")
    sys.exit(1 if failed else 0)


main()
