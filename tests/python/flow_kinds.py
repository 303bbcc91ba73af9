"""Writes one flow on a grid in every form that VTK and h5py write: FOLDER/NAME.vti and FOLDER/NAME.vtkhdf."""

import sys
from pathlib import Path

import h5py
import numpy
import vtk
from vtk.util.numpy_support import numpy_to_vtk

COUNTS = (9, 7, 5)
ORIGIN = (-1.0, 0.5, 2.0)
SPACING = (0.25, 0.5, 0.125)


def velocity(counts, time=0.0):
    """u = (x + 10 t, 2 y, z − x) at the nodes, x fastest."""
    axes = [ORIGIN[d] + SPACING[d] * numpy.arange(counts[d]) for d in range(3)]
    z, y, x = numpy.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    return numpy.stack([x + 10 * time, 2 * y, z - x], axis=-1)


def image(counts, dtype):
    data = vtk.vtkImageData()
    data.SetDimensions(*counts)
    data.SetOrigin(*ORIGIN)
    data.SetSpacing(*SPACING)
    array = numpy_to_vtk(velocity(counts).reshape(-1, 3).astype(dtype), deep=True)
    array.SetName("velocity")
    data.GetPointData().AddArray(array)
    scalar = numpy_to_vtk(numpy.arange(array.GetNumberOfTuples(), dtype=float), deep=True)
    scalar.SetName("pressure")
    data.GetPointData().AddArray(scalar)
    return data


def write_vti(path, counts=COUNTS, dtype=float, mode="Appended", encode=True, compressor="ZLib", header=64, big=False):
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image(counts, dtype))
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetEncodeAppendedData(encode)
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetHeaderTypeToUInt{header}")()
    if big:
        writer.SetByteOrderToBigEndian()
    writer.Write()


def write_vtkhdf(path, counts=COUNTS, times=None, libver="earliest", offsets=None, **more):
    with h5py.File(path, "w", libver=libver) as file:
        group = file.create_group("VTKHDF")
        group.attrs["Version"] = (2, 0)
        group.attrs.create("Type", b"ImageData", dtype=h5py.string_dtype("ascii", 9))
        group.attrs["WholeExtent"] = (0, counts[0] - 1, 0, counts[1] - 1, 0, counts[2] - 1)
        group.attrs["Origin"], group.attrs["Spacing"] = ORIGIN, SPACING
        group.attrs["Direction"] = (1.0, 0, 0, 0, 1, 0, 0, 0, 1)
        points = group.create_group("PointData")
        if times is None:
            points.create_dataset("velocity", data=velocity(counts), **more)
            return
        stored = [times[k] for k in sorted(set(offsets))] if offsets else times or [0.0]
        points.create_dataset("velocity", data=numpy.stack([velocity(counts, time) for time in stored]), **more)
        steps = group.create_group("Steps")
        steps.attrs["NSteps"] = len(times)
        steps["Values"] = numpy.array(times)
        if offsets:
            steps.create_group("PointDataOffsets")["velocity"] = offsets


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    write_vti(folder / "ascii.vti", mode="Ascii")
    for compressor in ("ZLib", "None"):
        for header in (32, 64):
            name = f"{compressor}_{header}".lower()
            write_vti(folder / f"binary_{name}.vti", mode="Binary", compressor=compressor, header=header)
            write_vti(folder / f"appended_{name}.vti", compressor=compressor, header=header)
            write_vti(folder / f"raw_{name}.vti", encode=False, compressor=compressor, header=header)
    write_vti(folder / "float32_big.vti", dtype=numpy.float32, encode=False, big=True)
    write_vti(folder / "large_blocks.vti", counts=(65, 40, 9))
    write_vti(folder / "plane.vti", counts=(9, 7, 1))
    write_vtkhdf(folder / "one_time.vtkhdf")
    write_vtkhdf(folder / "plane.vtkhdf", counts=(9, 7, 1))
    write_vtkhdf(folder / "newest.vtkhdf", libver="latest", chunks=(2, 3, 4, 3), compression="gzip", shuffle=True)
    write_vtkhdf(folder / "times.vtkhdf", times=[0.0, 0.5, 2.0])
    write_vtkhdf(folder / "times_newest.vtkhdf", libver="latest", times=[0.0, 0.5, 2.0], chunks=(1, 5, 7, 9, 3))
    write_vtkhdf(folder / "offsets.vtkhdf", times=[0.0, 0.5, 2.0], offsets=[0, 1, 1])
    write_vtkhdf(folder / "refused_without_times.vtkhdf", times=[])
    write_vtkhdf(folder / "refused_with_a_time_of_nan.vtkhdf", times=[0.0, float("nan")])


main(Path(sys.argv[1]))
