//! Formats that are known by their first bytes and not read, so that a refusal can name them.

/// First bytes, and what begins with them.
const KNOWN: &[(&[u8], &str)] = &[
    (b"\x1F\x8B", "a gzip archive"),
    (b"PK\x03\x04", "a zip archive (or 3MF, XLSX, NPZ)"),
    (b"BZh", "a bzip2 archive"),
    (b"\xFD7zXZ", "an xz archive"),
    (b"\x28\xB5\x2F\xFD", "a zstd archive"),
    (b"7z\xBC\xAF", "a 7z archive"),
    (b"# vtk DataFile", "a legacy VTK file"),
    (b"<?xml", "an XML file (VTP, VTU, X3D or another)"),
    (b"<VTKFile", "an XML file of VTK"),
    (b"glTF", "a glTF file"),
    (b"\x89HDF", "an HDF5 file that is damaged"),
    (b"CDF", "a NetCDF file"),
    (b"\x93NUMPY", "a NumPy file"),
    (b"OFF", "an OFF file"),
    (b"COFF", "an OFF file"),
    (b"NOFF", "an OFF file"),
    (b"Kaydara FBX", "an FBX file"),
    (b"BLENDER", "a Blender file"),
    (b"LASF", "a LAS file"),
    (b"ASTM-E57", "an E57 file"),
    (b"# .PCD", "a PCD file"),
    (b"$MeshFormat", "a Gmsh file"),
    (b"ISO-10303", "a STEP file"),
    (b"{", "a JSON file"),
    (b"%PDF", "a PDF"),
    (b"\x89PNG", "a PNG picture"),
];

/// What the bytes are, where they are known not to be read.
pub(super) fn format(bytes: &[u8]) -> Option<&'static str> {
    KNOWN.iter().find(|(head, _)| bytes.starts_with(head)).map(|(_, name)| *name)
}
