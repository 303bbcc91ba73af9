"""Writes points as h5py and VTK write them, in every storage that HDF5 has for them, and a manifest of what is in each.

usage: python hdf5_kinds.py OUTDIR

- OUTDIR/NAME.vtkhdf: the same 1,000 points of a sphere of radius 2 with normals and phi, each file in another way
- OUTDIR/manifest.json: [{"name", "what", "points", "normals", "phi", "faces"}]: what h5py reads back, numbers in one row;
  "faces" is missing where the file has none
"""
import json
import sys
from pathlib import Path

import h5py
import numpy
from h5py import h5d, h5p, h5s, h5t

N = 1000
CASES = []


def sphere(n):
    """n points of the unit sphere along a spiral."""
    k = numpy.arange(n) + 0.5
    z, turn = 1 - 2 * k / n, numpy.pi * (1 + 5**0.5) * k
    r = numpy.sqrt(1 - z * z)
    return numpy.column_stack([r * numpy.cos(turn), r * numpy.sin(turn), z])


def case(write):
    """Registers the writer of one file."""
    CASES.append(write)
    return write


def write(path, libver, kind="f8", normal="normal", track=False, **storage):
    """Writes the points with a storage of their data sets and returns the open file."""
    file = h5py.File(path, "w", libver=libver, track_order=track)
    root = file.create_group("VTKHDF", track_order=track)
    root.attrs["Version"] = numpy.array([2, 0], "i8")
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", 8))
    points = sphere(N)
    axes = dict(storage)
    for name in "maxshape", "chunks":
        if name in axes and axes[name] is not True:
            axes[name] = axes[name][:1]
    root.create_dataset("Points", data=(2 * points).astype(kind), **storage)
    data = root.create_group("PointData", track_order=track)
    data.create_dataset(normal, data=points.astype(kind), **storage)
    data.create_dataset("phi", data=points[:, 2].astype(kind), **axes)
    return file


def both(name, **options):
    """Registers a case in the earliest and the latest format."""
    for libver in "earliest", "latest":
        def make(path, libver=libver):
            write(path, libver, **options).close()
        make.__name__, make.__doc__ = f"{name}_{libver}", f"{name} in the {libver} format"
        case(make)


both("contiguous")
both("float_32", kind="f4")
both("big_endian", kind=">f8")
both("big_endian_32", kind=">f4")
both("chunks", chunks=(100, 3))
both("chunks_cut", chunks=(96, 2))
both("one_chunk", chunks=(1000, 3))
both("one_chunk_gzip", chunks=(1000, 3), compression="gzip")
both("one_chunk_larger", chunks=(25000, 3), maxshape=(None, 3))
both("gzip", chunks=(96, 2), compression="gzip")
both("gzip_shuffle", chunks=(100, 3), compression="gzip", shuffle=True)
both("gzip_shuffle_32", chunks=(96, 3), compression="gzip", shuffle=True, kind="f4")
both("fletcher", chunks=(100, 3), fletcher32=True)
both("all_filters", chunks=(96, 2), compression="gzip", shuffle=True, fletcher32=True)
both("extensible", chunks=(7, 3), maxshape=(None, 3))
both("extensible_cut", chunks=(7, 2), maxshape=(None, 3))
both("extensible_room", chunks=(7, 2), maxshape=(None, 9))
both("extensible_gzip", chunks=(7, 3), maxshape=(None, 3), compression="gzip", shuffle=True)
both("extensible_many", chunks=(1, 1), maxshape=(None, 3))
both("extensible_columns", chunks=(7, 3), maxshape=(1000, None))
both("two_free_axes", chunks=(13, 2), maxshape=(None, None))
both("two_free_axes_gzip", chunks=(13, 2), maxshape=(None, None), compression="gzip")
both("two_free_axes_many", chunks=(1, 1), maxshape=(None, None))
both("room", chunks=(96, 2), maxshape=(5000, 4))
both("fixed_many", chunks=(1, 1))
both("fixed_many_gzip", chunks=(1, 3), compression="gzip")
both("ordered", track=True)
both("vtk_name", normal="Normals")


def early(path, libver, fill=None):
    """Points in chunks that are allocated at once: an implicit index in the newest format."""
    with write(path, libver) as file:
        for name, width in ("Points", 3), ("PointData/normal", 3):
            values = file[f"VTKHDF/{name}"][...]
            del file[f"VTKHDF/{name}"]
            plist = h5p.create(h5p.DATASET_CREATE)
            plist.set_chunk((96, 2))
            plist.set_alloc_time(h5d.ALLOC_TIME_EARLY)
            made = h5d.create(file.id, f"VTKHDF/{name}".encode(), h5t.IEEE_F64LE, h5s.create_simple((N, width)), plist)
            made.write(h5s.ALL, h5s.ALL, values)


@case
def implicit_earliest(path):
    """Chunks that are allocated at once, by a version 1 tree."""
    early(path, "earliest")


@case
def implicit_latest(path):
    """Chunks that are allocated at once, one after another."""
    early(path, "latest")


def crowded(path, libver, count, **options):
    """Many further columns, so that links of groups are in dense storage."""
    with write(path, libver, **options) as file:
        for k in range(count):
            file[f"VTKHDF/PointData/a_column_with_a_long_name_{k:04}"] = numpy.full(3, k)
        for k in range(20):
            file["VTKHDF"].attrs[f"remark {k}"] = "x" * 40
            file["VTKHDF/Points"].attrs[f"remark {k}"] = k


for libver in "earliest", "latest", ("v108", "v108"), ("v110", "v110"), ("v112", "v112"):
    word = libver if isinstance(libver, str) else libver[0]
    for count in 12, 120, 1500:
        def make(path, libver=libver, count=count):
            crowded(path, libver, count)
        make.__name__, make.__doc__ = f"crowded_{count}_{word}", f"{count} further columns, format {word}"
        case(make)

    def ordered(path, libver=libver):
        crowded(path, libver, 200, track=True)
    ordered.__name__, ordered.__doc__ = f"crowded_ordered_{word}", f"200 columns by order, format {word}"
    case(ordered)


@case
def odd_company(path):
    """Beside the points: texts, compounds, booleans, references, soft links, a second name of the points, a null."""
    with write(path, "latest") as file:
        data = file["VTKHDF/PointData"]
        data["words"] = ["a", "bc"]
        data["flags"] = numpy.array([True, False])
        data["pairs"] = numpy.zeros(3, [("a", "f8"), ("b", "i4")])
        data["complex"] = numpy.zeros(3, "c16")
        data["half"] = numpy.zeros(3, "f2")
        data["reference"] = file["VTKHDF/Points"].ref
        data["nothing"] = h5py.Empty("f8")
        file["type"] = numpy.dtype("f8")
        file["soft"] = h5py.SoftLink("/VTKHDF/Points")
        file["again"] = file["VTKHDF/Points"]


@case
def shrunk(path):
    """Points that were 1,500 once: chunks beyond the extent may be left."""
    with write(path, "latest", chunks=(96, 2), maxshape=(None, 3)) as file:
        for name in "Points", "PointData/normal":
            values = file[f"VTKHDF/{name}"]
            values.resize((1500, 3))
            values[1000:] = 7
            values.resize((N, 3))


@case
def paged(path):
    """A file of pages, whose superblock has an extension."""
    with h5py.File(path, "w", libver="latest", fs_strategy="page", fs_page_size=4096) as file:
        root = file.create_group("VTKHDF")
        root["Points"] = 2 * sphere(N)
        root["PointData/normal"] = sphere(N)
        root["PointData/phi"] = sphere(N)[:, 2]


def vtk_cases():
    """Points and a mesh by VTK's own writer, where VTK is there."""
    try:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk
    except ImportError:
        return

    def data(kind, faces):
        if faces:
            source = vtk.vtkSphereSource()
            source.SetThetaResolution(32)
            source.SetPhiResolution(32)
            source.SetRadius(2)
            source.Update()
            made = source.GetOutput()
        else:
            made = vtk.vtkPolyData()
            points = vtk.vtkPoints()
            points.SetData(numpy_to_vtk((2 * sphere(N)).astype(kind), deep=True))
            made.SetPoints(points)
            cells = vtk.vtkCellArray()
            for k in range(N):
                cells.InsertNextCell(1, [k])
            made.SetVerts(cells)
            normals = numpy_to_vtk(sphere(N).astype(kind), deep=True)
            normals.SetName("Normals")
            made.GetPointData().SetNormals(normals)
        at = numpy.array([made.GetPoint(k) for k in range(made.GetNumberOfPoints())])
        phi = numpy_to_vtk(at[:, 2].astype(kind), deep=True)
        phi.SetName("phi")
        made.GetPointData().AddArray(phi)
        return made

    def save(path, made, level=0):
        writer = vtk.vtkHDFWriter()
        writer.SetInputData(made)
        writer.SetFileName(str(path))
        writer.SetCompressionLevel(level)
        writer.Write()

    for kind in "f4", "f8":
        for level in 0, 5:
            def make(path, kind=kind, level=level):
                save(path, data(kind, False), level)
            make.__name__, make.__doc__ = f"vtk_{kind}_{level}", f"by VTK, {kind}, compression {level}"
            case(make)

    @case
    def vtk_mesh(path):
        """A sphere of triangles by VTK."""
        save(path, data("f4", True), 3)

    @case
    def vtk_strips(path):
        """The same as strips."""
        stripper = vtk.vtkStripper()
        stripper.SetInputData(data("f4", True))
        stripper.Update()
        save(path, stripper.GetOutput())


def main():
    """Writes everything."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    vtk_cases()
    manifest = []
    for make in CASES:
        path = out / f"{make.__name__}.vtkhdf"
        make(path)
        with h5py.File(path) as file:
            root = file["VTKHDF"]
            names = [name for name in ("normal", "Normals") if name in root["PointData"]]
            entry = {"name": make.__name__, "what": " ".join(make.__doc__.split())}
            entry["points"] = root["Points"][...].astype("f8").ravel().tolist()
            entry["normals"] = root["PointData"][names[0]][...].astype("f8").ravel().tolist() if names else None
            entry["phi"] = root["PointData/phi"][...].astype("f8").ravel().tolist()
            if "Polygons" in root and (len(root["Polygons/Connectivity"]) or len(root["Strips/Connectivity"])):
                polygons = len(root["Polygons/Offsets"]) - 1
                strips = root["Strips/Offsets"][...]
                entry["faces"] = polygons + int(sum(numpy.diff(strips) - 2))
        manifest.append(entry)
    (out / "manifest.json").write_text(json.dumps(manifest) + "\n")


if __name__ == "__main__":
    main()
