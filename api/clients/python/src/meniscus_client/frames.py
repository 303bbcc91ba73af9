"""Frames (VTKHDF files) as NumPy arrays."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy


@dataclass
class Frame:
    """The points of a job at one time."""

    #: Scene time.
    time: float
    #: Positions, one row of three numbers a point; in the plane the third is 0.
    points: numpy.ndarray
    #: Fields by name: numbers of shape (points,), vectors of shape (points, 3).
    fields: dict[str, numpy.ndarray]
    #: Corners of triangles, one row of three point numbers each; empty where the frame has none.
    triangles: numpy.ndarray

    @classmethod
    def read(cls, content: bytes) -> Frame:
        """Reads the bytes of a frame; needs the extra ``data``."""
        import h5py
        import numpy

        with h5py.File(io.BytesIO(content)) as file:
            root = file["VTKHDF"]
            fields = {name: values[...] for name, values in root["PointData"].items()}
            triangles = numpy.empty((0, 3), dtype=numpy.int64)
            if "Polygons" in root and len(root["Polygons/Connectivity"]) > 0:
                triangles = root["Polygons/Connectivity"][...].reshape(-1, 3)
            return cls(float(root["FieldData/Time"][0]), root["Points"][...], fields, triangles)
