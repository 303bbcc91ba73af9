"""Opens frames with h5py and with VTK's own reader and prints what they found, as JSON.

The reader says 1 to CanReadFile and gives no error where it then finds nothing, so counts are what is compared.
"""
import json
import sys

import h5py
import numpy
import vtk

found = []
for path in sys.argv[1:]:
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        by_h5py = {
            "points": int(root["NumberOfPoints"][0]),
            "time": float(root["FieldData/Time"][0]),
            "fields": sorted(root["PointData"].keys()),
            "mean_x": float(numpy.mean(root["Points"][:, 0])),
        }
    reader = vtk.vtkHDFReader()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    points = data.GetPointData()
    by_vtk = {
        "points": data.GetNumberOfPoints(),
        "vertices": data.GetNumberOfVerts(),
        "time": data.GetFieldData().GetArray("Time").GetValue(0),
        "fields": sorted(points.GetArrayName(i) for i in range(points.GetNumberOfArrays())),
        "mean_x": float(numpy.mean([data.GetPoint(i)[0] for i in range(data.GetNumberOfPoints())])),
    }
    found.append({"h5py": by_h5py, "vtk": by_vtk})
json.dump(found, sys.stdout)
