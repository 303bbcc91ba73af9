"""Operators as SciPy reads them: an archive by load_npz, text by mmread. Prints what holds of both as JSON."""

import json
import sys

import numpy as np
import scipy.io
import scipy.sparse


def read(paths):
    """The matrix and the areas of one operator, from an archive or from two texts."""
    if paths[0].endswith(".npz"):
        return scipy.sparse.load_npz(paths[0]), np.load(paths[0])["areas"]
    return scipy.sparse.csr_matrix(scipy.io.mmread(paths[0])), np.asarray(scipy.io.mmread(paths[1])).ravel()


matrix, areas = read(sys.argv[1:])
weighted = scipy.sparse.diags(areas) @ matrix
size = abs(weighted).max()
print(
    json.dumps(
        {
            "rows": matrix.shape[0],
            "entries": int(matrix.nnz),
            "area": float(areas.sum()),
            "asymmetry": float(abs(weighted - weighted.T).max() / size),
            "constants": float(abs(matrix @ np.ones(matrix.shape[1])).max() / abs(matrix).max()),
        }
    )
)
