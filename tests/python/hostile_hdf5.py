"""Writes hostile and benign HDF5 files, what they name, and a manifest, to test a reader of uploads.

usage: python hostile_hdf5.py OUTDIR

- OUTDIR/hostile/NAME.h5: one file for each known way to make libhdf5 open another file, load code or use up memory and
  time, or to carry such a thing past a reader who looks at the expected data sets only
- OUTDIR/benign/NAME.h5: what an honest user uploads and must get accepted
- OUTDIR/newest/NAME.h5: the same, but written such that only libhdf5 2.0 and later can read it; there if h5py has that
- OUTDIR/targets: real files that hostile files name; a trace of system calls shows whether one was opened.
  libhdf5 looks for plug-ins in HDF5_PLUGIN_PATH: a test sets it to OUTDIR/targets/plugins
- OUTDIR/manifest.json: {"hostile": [{"name", "what", "opens_other_files", "as", "targets"}],
  "benign": [{"name", "what", "as"}], "newest": the same}; "targets" are the paths that a file may lead to. Relative
  names are seen from OUTDIR/hostile, where a test starts its reader: libhdf5 takes them from the file's folder for
  links and virtual data sets, from the working directory for external raw storage

A file that H5Fopen refuses counts among the openers of other files: releases with VOL connectors then load every
plug-in in search of one that can open it.

Each registered function writes one file, its docstring being "what", and asserts with h5py's low-level interface or on
the bytes that the file is what it claims. What h5py does not wrap is called by ctypes in the libhdf5 that h5py loaded.
Files that hang or crash one or another libhdf5 are checked by their bytes only.
"""
import ctypes
import functools
import gzip
import json
import re
import shutil
import struct
import sys
import zlib
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy
from h5py import h5a, h5d, h5f, h5g, h5l, h5o, h5p, h5s, h5t, h5z

CASES = {"hostile": [], "benign": [], "newest": []}
UNDEFINED = 2**64 - 1
NIL, DATASPACE, LINK_INFO, DATATYPE, FILL, LINK, EXTERNAL_FILES, LAYOUT = 0, 1, 2, 3, 5, 6, 7, 8
FILTERS, CONTINUATION, TABLE, MODIFIED, DRIVER, CACHE_IMAGE = 11, 16, 17, 18, 20, 24
MOMENT = 1_700_000_000
POINTS, PHI = "VTKHDF/Points", "VTKHDF/PointData/phi"
POINT_DATA = "VTKHDF/PointData"


class Place:
    """Where a case writes, and the paths that it names."""

    def __init__(self, out, kind, name):
        self.out, self.path, self.targets = out, out / kind / f"{name}.h5", []

    def absolute(self, name):
        """The absolute path of a target; an absolute path stays what it is."""
        self.targets.append(str(self.out / "targets" / name))
        return self.targets[-1]

    def relative(self, name):
        """The path of a target as seen from the folder of the hostile files."""
        self.absolute(name)
        return f"../targets/{name}"


def add(kind, name, what, write, opens=False):
    """Registers the writer of one file."""
    assert all(name != other for other, *_ in CASES[kind]), name
    CASES[kind].append((name, " ".join(what.split()), write, opens))
    return write


def hostile(write):
    """Registers a hostile file that names no other file."""
    return add("hostile", write.__name__, write.__doc__, write)


def opener(write):
    """Registers a hostile file by which libhdf5 may come to open another file or to load a plug-in."""
    return add("hostile", write.__name__, write.__doc__, write, opens=True)


def benign(write):
    """Registers a benign file."""
    return add("benign", write.__name__, write.__doc__, write)


# The expected layout, whole or with parts left out.

def cloud(n):
    """n points, always the same."""
    return numpy.random.default_rng(7).random((n, 3))


def scene(path, without=(), n=8, points=None, phi=None, storage=None, libver="earliest", **options):
    """Writes the expected layout but for the named parts and returns the open file."""
    file = path if isinstance(path, h5py.File) else h5py.File(path, "w", libver=libver, **options)
    if "VTKHDF" in without:
        return file
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = numpy.array([2, 0], "i8")
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", 8))
    points = cloud(n) if points is None else points
    phi = numpy.linspace(-1, 1, n) if phi is None else phi
    if "Points" not in without:
        root.create_dataset("Points", data=points, **pieces(storage, 3))
    if "PointData" not in without:
        data = root.create_group("PointData")
        if "phi" not in without:
            data.create_dataset("phi", data=phi, **pieces(storage, None))
    return file


def pieces(storage, width):
    """The storage of a data set; "rows" in it makes chunks of so many rows."""
    storage = dict(storage or {})
    if rows := storage.pop("rows", None):
        storage["chunks"] = (rows, width) if width else (rows,)
    return storage


def topology(root, n):
    """Adds the count and the four groups of cells that VTK's reader asks for."""
    root["NumberOfPoints"] = numpy.array([n], "i8")
    for name, cells in ("Vertices", n), ("Lines", 0), ("Polygons", 0), ("Strips", 0):
        group = root.create_group(name)
        for count in "NumberOfCells", "NumberOfConnectivityIds":
            group[count] = numpy.array([cells], "i8")
        group["Offsets"] = numpy.arange(cells + 1, dtype="i8")
        group["Connectivity"] = numpy.arange(cells, dtype="i8")


def columns(root, n):
    """Adds the usual further columns."""
    data = root["PointData"]
    data["velocity"] = numpy.zeros((n, 3))
    data["phase"] = numpy.zeros(n, "u1")
    data["particle_id"] = numpy.arange(n, dtype="u8")
    root.create_group("FieldData")["Time"] = numpy.array([0.25])


def recipe(chunk=None):
    """A creation property list without times, so that every run writes the same bytes."""
    plist = h5p.create(h5p.DATASET_CREATE)
    plist.set_obj_track_times(False)
    if chunk:
        plist.set_chunk(chunk)
    return plist


def make(file, name, shape, plist, data=None, dtype=h5t.IEEE_F64LE, maxshape=None):
    """Creates a data set by the low-level interface."""
    parents = h5p.create(h5p.LINK_CREATE)
    parents.set_create_intermediate_group(True)
    dataset = h5d.create(file.id, name.encode(), dtype, h5s.create_simple(shape, maxshape), plist, lcpl=parents)
    if data is not None:
        dataset.write(h5s.ALL, h5s.ALL, numpy.ascontiguousarray(data))
    return dataset


# Looking at what was written.

def link_class(path, name):
    """The class of a link, which is not followed."""
    parent, _, leaf = name.rpartition("/")
    with h5py.File(path) as file:
        group = file[parent or "/"].id
        return group.links.get_info(leaf.encode()).type


def creation(path, name):
    """The property list that a data set was created with."""
    with h5py.File(path) as file:
        return file[name].id.get_create_plist()


def address(path, name="/"):
    """Where the header of an object begins."""
    with h5py.File(path) as file:
        return h5o.get_info(file[name].id).addr


def refused(path):
    """Whether libhdf5 refuses to open the file."""
    try:
        h5py.File(path).close()
    except OSError:
        return True
    return False


# What h5py does not wrap.

@functools.cache
def library():
    """The libhdf5 that h5py loaded."""
    with open("/proc/self/maps") as maps:
        return ctypes.CDLL(min({line.split()[-1] for line in maps if re.search(r"/libhdf5[-.]", line)}))


def call(function, *arguments):
    """Calls a function of libhdf5; an int among the arguments is an identifier."""
    result = getattr(library(), function)(*(ctypes.c_int64(a) if isinstance(a, int) else a for a in arguments))
    assert result >= 0, function


@contextmanager
def filter_class(number):
    """Registers a filter that copies, while a file with it is written; nobody knows it afterwards."""
    kind = ctypes.CFUNCTYPE(ctypes.c_size_t, ctypes.c_uint, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t,
                            ctypes.c_void_p, ctypes.c_void_p)

    class Class(ctypes.Structure):
        _fields_ = [("version", ctypes.c_int), ("id", ctypes.c_int), ("encoder", ctypes.c_uint),
                    ("decoder", ctypes.c_uint), ("name", ctypes.c_char_p), ("can_apply", ctypes.c_void_p),
                    ("set_local", ctypes.c_void_p), ("filter", kind)]

    keep = Class(1, number, 1, 1, b"hostile", None, None, kind(lambda flags, n, values, size, room, buffer: size))
    call("H5Zregister", ctypes.byref(keep))
    try:
        yield
    finally:
        call("H5Zunregister", ctypes.c_int(number))


def user_link(group, name, number, payload):
    """Makes a link of a user-defined class, which is known only meanwhile."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_char_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_size_t,
                            ctypes.c_int64)

    class Class(ctypes.Structure):
        _fields_ = [("version", ctypes.c_int), ("id", ctypes.c_int), ("comment", ctypes.c_char_p),
                    ("create", ctypes.c_void_p), ("move", ctypes.c_void_p), ("copy", ctypes.c_void_p),
                    ("traverse", kind), ("delete", ctypes.c_void_p), ("query", ctypes.c_void_p)]

    keep = Class(0, number, b"hostile", None, None, None, kind(lambda *_: -1), None, None)
    call("H5Lregister", ctypes.byref(keep))
    call("H5Lcreate_ud", group.id.id, name.encode(), ctypes.c_int(number), payload, ctypes.c_size_t(len(payload)), 0, 0)
    call("H5Lunregister", ctypes.c_int(number))


def access(libver):
    """A file access property list for a range of format versions."""
    plist = h5p.create(h5p.FILE_ACCESS)
    bounds = {"earliest": h5f.LIBVER_EARLIEST, "latest": h5f.LIBVER_LATEST}
    plist.set_libver_bounds(bounds[libver], h5f.LIBVER_LATEST)
    plist.set_fclose_degree(h5f.CLOSE_STRONG)
    return plist


def file_with(path, fcpl=None, fapl=None, libver="earliest"):
    """Creates a file with property lists of one's own."""
    fcpl = fcpl or h5p.create(h5p.FILE_CREATE)
    fcpl.set_obj_track_times(False)
    return h5py.File(h5f.create(str(path).encode(), h5f.ACC_TRUNC, fcpl, fapl or access(libver)))


# Changing bytes.

@contextmanager
def edit(path):
    """The bytes of a file, written back afterwards."""
    image = bytearray(path.read_bytes())
    yield image
    path.write_bytes(image)


def number(image, at, size=8):
    """An integer at an offset."""
    return int.from_bytes(image[at:at + size], "little")


def put(image, at, *numbers, form="Q"):
    """Writes integers at an offset."""
    struct.pack_into(f"<{len(numbers)}{form}", image, at, *numbers)


def replace(path, old, new):
    """Replaces bytes that occur once by as many others."""
    with edit(path) as image:
        assert image.count(old) == 1 and len(old) == len(new), old
        image[:] = image.replace(old, new)


def lookup3(data):
    """Bob Jenkins's lookup3, the check sum of metadata."""
    mask = 2**32 - 1

    def turn(x, k):
        return (x << k | x >> (32 - k)) & mask

    a = b = c = (0xDEADBEEF + len(data)) & mask
    words = [number(data[i:i + 4], 0, 4) for i in range(0, len(data), 4)]
    words += [0] * (-len(words) % 3)
    for i in range(0, len(words), 3):
        a, b, c = a + words[i] & mask, b + words[i + 1] & mask, c + words[i + 2] & mask
        if i + 3 < len(words):
            for k in 4, 6, 8, 16, 19, 4:
                a, c = (a - c & mask) ^ turn(c, k), b + c & mask
                a, b, c = b, c, a
    for k in 14, 11, 25, 16, 4, 14, 24:
        c = (c ^ b) - turn(b, k) & mask
        a, b, c = b, c, a
    return b


def opening(image, at):
    """Where the messages in the first block of an object header begin, and their size."""
    if image[at:at + 4] != b"OHDR":
        return at + 16, number(image, at + 8, 4)
    flags = image[at + 5]
    width = 1 << (flags & 3)
    at += 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
    return at + width, number(image, at, width)


def messages(image, at):
    """The messages of an object header: type, offset of the body, size of the body."""
    new = image[at:at + 4] == b"OHDR"
    head = (6 if image[at + 5] & 4 else 4) if new else 8
    blocks, found = [opening(image, at)], []
    while blocks:
        here, size = blocks.pop(0)
        end = here + size
        while here + head <= end:
            kind, size = number(image, here, 1 if new else 2), number(image, here + (1 if new else 2), 2)
            found.append((kind, here + head, size))
            if kind == CONTINUATION:
                block, length = number(image, here + head), number(image, here + head + 8)
                blocks.append((block + 4, length - 8) if new else (block, length))
            here += head + size
    return found


def body(image, at, kind):
    """Where the body of the first message of a type begins."""
    return next(here for found, here, _ in messages(image, at) if found == kind)


def seal(image, at):
    """Puts the check sum of the first block of a version 2 object header right, or of a version 2 superblock."""
    end = at + 44 if image[at:at + 4] == b"\x89HDF" else sum(opening(image, at))
    put(image, end, lookup3(image[at:end]), form="I")


def settle(path):
    """Sets all times in version 2 object headers to one, so that every run writes the same bytes."""
    with edit(path) as image:
        for at in (found.start() for found in re.finditer(b"OHDR\x02", image)):
            if image[at + 5] & 0x20:
                put(image, at + 6, *[MOMENT] * 4, form="I")
                seal(image, at)
        if cached := re.search(b"MDCI", image):
            end = number(image, body(image, number(image, 20), CACHE_IMAGE) + 9) + cached.start() - 4
            put(image, end, lookup3(image[cached.start():end]), form="I")


def inject(image, at, *extra):
    """Puts messages (type, flags, body) into the NIL message at the end of a version 1 object header."""
    here, size = next((here, size) for kind, here, size in messages(image, at) if kind == NIL)
    here, end = here - 8, here + size
    for kind, flags, data in extra:
        data += bytes(-len(data) % 8)
        image[here:here + 8 + len(data)] = struct.pack("<HHB3x", kind, len(data), flags) + data
        here += 8 + len(data)
    assert here + 8 <= end
    image[here:end] = struct.pack("<HHB3x", NIL, end - here - 8, 0) + bytes(end - here - 8)
    put(image, at + 2, number(image, at + 2, 2) + len(extra), form="H")


def patched(place, name, change, **options):
    """Writes the scene and changes it by change(image, address of the header of an object)."""
    scene(place.path, **options).close()
    at = address(place.path, name)
    before = place.path.read_bytes()
    with edit(place.path) as image:
        change(image, at)
        assert image != before


# External links.

def external(place, name, target, libver="earliest", inside="/" + POINTS):
    """Writes the scene with an external link in place of a part of it."""
    with scene(place.path, without=[name.rpartition("/")[2]], libver=libver) as file:
        file[name] = h5py.ExternalLink(target, inside)
    assert link_class(place.path, name) == h5l.TYPE_EXTERNAL
    return place.path


@opener
def extlink_points_absolute(place):
    """/VTKHDF/Points is an external link with an absolute path, in an old-style group that the link turned into a
    new-style one."""
    external(place, POINTS, place.absolute("points.h5"))


@opener
def extlink_points_relative(place):
    """/VTKHDF/Points is an external link with a relative path that climbs out of the folder."""
    external(place, POINTS, place.relative("points.h5"))


@opener
def extlink_points_sibling(place):
    """/VTKHDF/Points is an external link to a file in the same folder, such as somebody else's upload."""
    place.targets.append(str(place.path.parent / "sibling_of_links.h5"))
    external(place, POINTS, "sibling_of_links.h5")


@opener
def extlink_points_latest_compact(place):
    """/VTKHDF/Points is an external link in a link message of a version 2 object header."""
    path = external(place, POINTS, place.absolute("points.h5"), libver="latest")
    image = path.read_bytes()
    assert number(image, body(image, address(path, "VTKHDF"), LINK_INFO) + 2) == UNDEFINED


@opener
def extlink_points_latest_dense(place):
    """/VTKHDF/Points is an external link in the fractal heap of a group with dense link storage."""
    path = external(place, POINTS, place.absolute("points.h5"), libver="latest")
    with h5py.File(path, "r+", libver="latest") as file:
        for i in range(12):
            file["VTKHDF"].create_group(f"more{i}")
    image = path.read_bytes()
    assert number(image, body(image, address(path, "VTKHDF"), LINK_INFO) + 2) != UNDEFINED
    assert link_class(path, POINTS) == h5l.TYPE_EXTERNAL


@opener
def extlink_ordered_group(place):
    """/VTKHDF/PointData/phi is an external link in a group that indexes the order of creation."""
    with scene(place.path, without=["PointData"], libver="latest") as file:
        data = file.create_group(POINT_DATA, track_order=True)
        data["phi"] = h5py.ExternalLink(place.absolute("points.h5"), "/" + PHI)
    assert link_class(place.path, PHI) == h5l.TYPE_EXTERNAL


@opener
def extlink_vtkhdf(place):
    """/VTKHDF itself is an external link in the root group."""
    external(place, "VTKHDF", place.absolute("points.h5"), inside="/VTKHDF")


@opener
def extlink_root_elsewhere(place):
    """The expected data sets are in order, and the root group has an external link besides them."""
    external(place, "other", place.absolute("points.h5"), inside="/")


@opener
def extlink_point_data(place):
    """/VTKHDF/PointData is an external link, so that phi comes from another file."""
    external(place, POINT_DATA, place.absolute("points.h5"), inside="/" + POINT_DATA)


@opener
def extlink_phi(place):
    """/VTKHDF/PointData/phi is an external link."""
    external(place, PHI, place.relative("points.h5"), inside="/" + PHI)


@opener
def extlink_extra_column(place):
    """A column that nobody asked for, /VTKHDF/PointData/velocity, is an external link."""
    external(place, POINT_DATA + "/velocity", place.absolute("points.h5"))


@opener
def extlink_nested_elsewhere(place):
    """An external link four groups below the root, away from the expected data sets."""
    external(place, "a/b/c/d/link", place.absolute("points.h5"))


@opener
def extlink_behind_soft_link(place):
    """/VTKHDF/Points is a soft link to an external link."""
    with scene(place.path, without=["Points"]) as file:
        file["hidden/points"] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
        file[POINTS] = h5py.SoftLink("/hidden/points")
    assert link_class(place.path, POINTS) == h5l.TYPE_SOFT
    assert link_class(place.path, "hidden/points") == h5l.TYPE_EXTERNAL


@opener
def extlink_inside_soft_path(place):
    """/VTKHDF/Points is a soft link whose path goes through an external link half way."""
    with scene(place.path, without=["Points"]) as file:
        file["hidden"] = h5py.ExternalLink(place.absolute("points.h5"), "/")
        file[POINTS] = h5py.SoftLink("/hidden/" + POINTS)
    assert link_class(place.path, "hidden") == h5l.TYPE_EXTERNAL


@opener
def extlink_chain(place):
    """/VTKHDF/Points is an external link to an external link of a second file to a third."""
    place.absolute("points.h5")
    external(place, POINTS, place.absolute("chain.h5"))


@opener
def extlink_ping_pong(place):
    """/VTKHDF/Points is an external link to a file that links back."""
    external(place, POINTS, place.absolute("ping_pong.h5"))


@opener
def extlink_self(place):
    """/VTKHDF/Points is an external link to itself by the file's own name."""
    place.targets.append(str(place.path))
    external(place, POINTS, place.path.name)


@opener
def extlink_proc(place):
    """/VTKHDF/Points is an external link to /proc/self/environ, which is opened although it is no HDF5 file."""
    external(place, POINTS, place.absolute("/proc/self/environ"))


@opener
def extlink_duplicate_name(place):
    """/VTKHDF has two links named Points, an external one and a hard one."""
    with scene(place.path, without=["Points"]) as file:
        file["VTKHDF/PointX"] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
        file[POINTS] = cloud(8)
    replace(place.path, b"PointX", b"Points")
    image = place.path.read_bytes()
    links = [at for kind, at, size in messages(image, address(place.path, "VTKHDF")) if kind == LINK]
    assert sum(b"Points" in image[at:at + 16] for at in links) == 2


@opener
def extlink_behind_reference(place):
    """An external link in a group without a name, which only an object reference in an attribute leads to."""
    with scene(place.path) as file:
        group = file.create_group(None)
        group["link"] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
        call("H5Oincr_refcount", group.id.id)
        file["VTKHDF"].attrs["see"] = group.ref
    with h5py.File(place.path) as file:
        group = file[file["VTKHDF"].attrs["see"]]
        assert group.id.links.get_info(b"link").type == h5l.TYPE_EXTERNAL


@opener
def extlink_beside_cached_table(place):
    """The entry of /VTKHDF in the root's symbol table caches the tables of a benign group, while its object header,
    which libhdf5 goes by, has an external link."""
    with scene(place.path, without=["Points"]) as file:
        file[POINTS] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
        file["decoy/Points"], file["decoy/PointData/phi"] = cloud(8), numpy.zeros(8)
    target, decoy = address(place.path, "VTKHDF"), address(place.path, "decoy")
    with edit(place.path) as image:
        cached = image[body(image, decoy, TABLE):][:16]
        entry = image.index(struct.pack("<QI", target, 1)) + 16
        image[entry:entry + 16] = cached
    assert link_class(place.path, POINTS) == h5l.TYPE_EXTERNAL


@opener
def extlink_beside_root_table(place):
    """The superblock caches the tables of a benign group for the root group, while the root's object header, which
    libhdf5 goes by, has an external link at /VTKHDF."""
    with scene(place.path, without=["VTKHDF"]) as file:
        file["decoy/VTKHDF/Points"], file["decoy/VTKHDF/PointData/phi"] = cloud(8), numpy.zeros(8)
        file["VTKHDF"] = h5py.ExternalLink(place.absolute("points.h5"), "/VTKHDF")
    decoy = address(place.path, "decoy")
    with edit(place.path) as image:
        put(image, 72, 1)
        image[80:96] = image[body(image, decoy, TABLE):][:16]
    assert link_class(place.path, "VTKHDF") == h5l.TYPE_EXTERNAL


@opener
def extlink_beside_base_address(place):
    """The superblock's base address names a whole benign file further on, which libhdf5 does not look at: it goes by
    where it found the superblock, where /VTKHDF/Points is an external link."""
    external(place, POINTS, place.absolute("points.h5"))
    other = place.path.with_suffix(".decoy")
    scene(other).close()
    with edit(place.path) as image:
        image += bytes(-len(image) % 512)
        base = len(image)
        image += other.read_bytes()
        put(image, 24, base)
        put(image, 40, len(image))
    other.unlink()
    assert link_class(place.path, POINTS) == h5l.TYPE_EXTERNAL


@opener
def extlink_in_cache_image(place):
    """The metadata on disk are benign; a metadata cache image, which libhdf5 loads in their place, has an external link
    at /VTKHDF/Points."""
    class Image(ctypes.Structure):
        _fields_ = [("version", ctypes.c_int), ("generate", ctypes.c_bool), ("resize", ctypes.c_bool),
                    ("age", ctypes.c_int)]

    scene(place.path, libver="latest").close()
    before = place.path.read_bytes()
    fapl = access("latest")
    call("H5Pset_mdc_image_config", fapl.id, ctypes.byref(Image(1, True, False, -1)))
    with h5py.File(h5f.open(str(place.path).encode(), h5f.ACC_RDWR, fapl)) as file:
        file.move(POINTS, "VTKHDF/kept")
        file[POINTS] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
    with edit(place.path) as image:
        assert number(image, 20) >= len(before)
        image[48:len(before)] = before[48:]
    settle(place.path)
    assert b"MDCI" in place.path.read_bytes()
    assert link_class(place.path, POINTS) == h5l.TYPE_EXTERNAL


# Links of other classes.

@opener
def userlink_65(place):
    """/VTKHDF/Points is a link of the user-defined class 65, for which the reading program may have code."""
    with scene(place.path, without=["Points"]) as file:
        user_link(file["VTKHDF"], "Points", 65, place.absolute("points.h5").encode())
    assert link_class(place.path, POINTS) == 65


@opener
def userlink_255_latest(place):
    """/VTKHDF/PointData/phi is a link of the user-defined class 255 in a version 2 object header."""
    with scene(place.path, without=["phi"], libver="latest") as file:
        user_link(file[POINT_DATA], "phi", 255, place.absolute("points.h5").encode())
    assert link_class(place.path, PHI) == 255


@hostile
def link_reserved_class(place):
    """/VTKHDF/Points is a link of class 2, which is reserved."""
    with scene(place.path, without=["Points"]) as file:
        user_link(file["VTKHDF"], "Points", 65, bytes(8))
    replace(place.path, b"\x01\x08\x41\x06Points", b"\x01\x08\x02\x06Points")


def soft(place, name, target, libver="earliest"):
    """Writes the scene with a soft link in place of a part of it."""
    with scene(place.path, without=[name.rpartition("/")[2]], libver=libver) as file:
        file["other"] = cloud(8)
        file[name] = h5py.SoftLink(target)
    assert link_class(place.path, name) == h5l.TYPE_SOFT


@hostile
def link_name_with_slash(place):
    """The root group has a link by the name VTKHDF/Points, slash and all, to a data set of other points."""
    with scene(place.path) as file:
        file["VTKHDF-Points"] = 2 * cloud(8)
    replace(place.path, b"VTKHDF-Points", b"VTKHDF/Points")


@hostile
def softlink_points(place):
    """/VTKHDF/Points is a soft link to a data set of the same file, cached in an old-style symbol table."""
    soft(place, POINTS, "/other")


@hostile
def softlink_points_latest(place):
    """/VTKHDF/Points is a soft link to a data set of the same file, in a link message."""
    soft(place, POINTS, "/other", "latest")


@hostile
def softlink_dangling(place):
    """/VTKHDF/Points is a soft link to nothing."""
    soft(place, POINTS, "/nowhere/at/all")


@hostile
def softlink_cycle(place):
    """/VTKHDF/Points is a soft link to itself."""
    soft(place, POINTS, "/" + POINTS)


@hostile
def softlink_group_cycle(place):
    """/VTKHDF/PointData/up is a soft link to /VTKHDF, so that following links never ends."""
    soft(place, POINT_DATA + "/up", "/VTKHDF", "latest")


@hostile
def hardlink_group_cycle(place):
    """/VTKHDF/PointData/up is a hard link to /VTKHDF, so that following links never ends."""
    with scene(place.path) as file:
        file[POINT_DATA + "/up"] = file["VTKHDF"]
    assert address(place.path, POINT_DATA + "/up") == address(place.path, "VTKHDF")


@hostile
def hardlink_root_cycle(place):
    """/VTKHDF/root is a hard link to the root group, in new-style groups."""
    with scene(place.path, libver="latest") as file:
        file["VTKHDF/root"] = file["/"]
    assert address(place.path, "VTKHDF/root") == address(place.path)


@hostile
def hardlink_beyond_end(place):
    """/VTKHDF/Points is a hard link to an object header beyond the end of the file."""
    scene(place.path).close()
    at = address(place.path, POINTS)
    replace(place.path, struct.pack("<QQ", at, 0), struct.pack("<QQ", 2**40, 0))


# External raw storage.

def raw(place, name, *segments, shape=(8, 3), libver="earliest"):
    """Writes the scene with a data set in external raw storage; nothing is ever written there."""
    with scene(place.path, without=[name.rpartition("/")[2]], libver=libver) as file:
        plist = recipe()
        plist.set_fill_time(h5d.FILL_TIME_NEVER)
        for path, offset, size in segments:
            plist.set_external(path.encode(), offset, size)
        make(file, name, shape, plist)
    assert creation(place.path, name).get_external_count() == len(segments)
    image = place.path.read_bytes()
    assert body(image, address(place.path, name), EXTERNAL_FILES)


@opener
def efl_points_absolute(place):
    """/VTKHDF/Points lies in external raw storage with an absolute path."""
    raw(place, POINTS, (place.absolute("raw.bin"), 0, 192))


@opener
def efl_points_relative(place):
    """/VTKHDF/Points lies in external raw storage with a relative path."""
    raw(place, POINTS, (place.relative("raw.bin"), 0, 192))


@opener
def efl_points_passwd(place):
    """/VTKHDF/Points lies in /etc/passwd, whose bytes would come back as coordinates."""
    raw(place, POINTS, (place.absolute("/etc/passwd"), 0, 192))


@opener
def efl_points_proc(place):
    """/VTKHDF/Points lies in /proc/self/environ, which has the secrets of the reading process."""
    raw(place, POINTS, (place.absolute("/proc/self/environ"), 0, 192))


@opener
def efl_points_device(place):
    """/VTKHDF/Points lies in /dev/zero, which never ends, and claims 2^40 rows of it."""
    raw(place, POINTS, (place.absolute("/dev/zero"), 0, h5f.UNLIMITED), shape=(2**40, 3))


@opener
def efl_points_segments(place):
    """/VTKHDF/Points lies in three segments of two external files."""
    raw(place, POINTS, (place.absolute("raw.bin"), 0, 64), (place.relative("raw2.bin"), 8, 64),
        (place.absolute("raw.bin"), 64, 64))


@opener
def efl_points_unlimited(place):
    """/VTKHDF/Points lies in an external segment of unlimited size, from an offset on."""
    raw(place, POINTS, (place.absolute("raw.bin"), 16, h5f.UNLIMITED))


@opener
def efl_points_self(place):
    """/VTKHDF/Points lies in the bytes of its own file, by name."""
    place.targets.append(str(place.path))
    raw(place, POINTS, (str(place.path), 0, 192))


@opener
def efl_points_latest(place):
    """/VTKHDF/Points lies in external raw storage, in a version 2 object header."""
    raw(place, POINTS, (place.absolute("raw.bin"), 0, 192), libver="latest")


@opener
def efl_phi(place):
    """/VTKHDF/PointData/phi lies in external raw storage."""
    raw(place, PHI, (place.absolute("raw.bin"), 0, 64), shape=(8,))


@opener
def efl_elsewhere(place):
    """A data set that nobody asked for lies in external raw storage."""
    raw(place, "notes/log", (place.absolute("raw.bin"), 0, 64), shape=(8,))


@opener
def efl_in_hidden_continuation(place):
    """The external file list of /VTKHDF/Points is in a continuation block inside the raw data of another data set."""
    raw(place, POINTS, (place.absolute("raw.bin"), 0, 192))
    with h5py.File(place.path, "r+") as file:
        file["VTKHDF/PointData/cover"] = numpy.full(64, 0x7E57, "i8")
    at, cover = address(place.path, POINTS), address(place.path, "VTKHDF/PointData/cover")
    with edit(place.path) as image:
        here, size = next((here, size) for kind, here, size in messages(image, at) if kind == EXTERNAL_FILES)
        block = number(image, body(image, cover, LAYOUT) + 2)
        image[block:block + 8 + size] = image[here - 8:here + size]
        image[here - 8:here + 16] = struct.pack("<HHB3xQQ", CONTINUATION, 16, 0, block, 8 + size)
        image[here + 16:here + size] = struct.pack("<HHB3x", NIL, size - 24, 0) + bytes(size - 24)
        put(image, at + 2, number(image, at + 2, 2) + 2, form="H")
    assert creation(place.path, POINTS).get_external_count() == 1


# Virtual data sets.

def virtual(place, *sources, name=POINTS, shape=(8, 3), libver="earliest", fill=lambda file: None):
    """Writes the scene with a virtual data set that the (file, data set) pairs fill one after another."""
    with scene(place.path, without=[name.rpartition("/")[2]], libver=libver) as file:
        fill(file)
        plist, rows = recipe(), shape[0] // len(sources)
        for i, (path, inside) in enumerate(sources):
            space = h5s.create_simple(shape)
            space.select_hyperslab((i * rows,) + (0,) * (len(shape) - 1), (rows,) + shape[1:])
            plist.set_virtual(space, path.encode(), inside.encode(), h5s.create_simple((rows,) + shape[1:]))
        make(file, name, shape, plist)
    assert creation(place.path, name).get_layout() == h5d.VIRTUAL


def unlimited(place, path, libver, step):
    """Writes the scene with Points a virtual data set without an upper limit, "step" rows from each source if given."""
    with scene(place.path, without=["Points"], libver=libver) as file:
        plist, limits = recipe(), (h5s.UNLIMITED, 3)
        target, source = h5s.create_simple((8, 3), limits), h5s.create_simple((4, 3), (4, 3) if step else limits)
        for space in [target] if step else [target, source]:
            space.select_hyperslab((0, 0), (h5s.UNLIMITED, 1), (step or 1, 1), (step or 1, 3))
        plist.set_virtual(target, path.encode(), POINTS.encode(), source)
        make(file, POINTS, (8, 3), plist, maxshape=limits)
    assert creation(place.path, POINTS).get_layout() == h5d.VIRTUAL


@opener
def vds_points_absolute(place):
    """/VTKHDF/Points is a virtual data set over a file with an absolute path."""
    virtual(place, (place.absolute("points.h5"), POINTS))


@opener
def vds_points_relative(place):
    """/VTKHDF/Points is a virtual data set over a file with a relative path."""
    virtual(place, (place.relative("points.h5"), POINTS))


@opener
def vds_points_latest(place):
    """/VTKHDF/Points is a virtual data set, in the newest file format."""
    virtual(place, (place.absolute("points.h5"), POINTS), libver="latest")


@opener
def vds_phi(place):
    """/VTKHDF/PointData/phi is a virtual data set over another file."""
    virtual(place, (place.absolute("points.h5"), PHI), name=PHI, shape=(8,))


@opener
def vds_elsewhere(place):
    """A data set that nobody asked for is a virtual one over another file."""
    virtual(place, (place.absolute("points.h5"), PHI), name="notes/log", shape=(8,))


@opener
def vds_missing_source(place):
    """/VTKHDF/Points is a virtual data set over a missing file, which reads as fill values without an error."""
    virtual(place, (place.absolute("missing.h5"), POINTS))


@opener
def vds_printf(place):
    """/VTKHDF/Points is a virtual data set of unlimited size over numbered files, by a printf-style name."""
    place.absolute("part-0.h5"), place.absolute("part-1.h5")
    unlimited(place, str(place.out / "targets" / "part-%b.h5"), "earliest", 4)


@opener
def vds_printf_latest(place):
    """/VTKHDF/Points is a virtual data set of unlimited size over numbered files, in the newest file format."""
    place.relative("part-0.h5"), place.relative("part-1.h5")
    unlimited(place, "../targets/part-%b.h5", "latest", 4)


@opener
def vds_unlimited(place):
    """/VTKHDF/Points is a virtual data set of unlimited size over one data set of unlimited size."""
    unlimited(place, place.absolute("unlimited.h5"), "earliest", 0)


@opener
def vds_many_sources(place):
    """/VTKHDF/Points is a virtual data set over 2000 file names."""
    virtual(place, *((place.absolute(f"part-{i}.h5"), POINTS) for i in range(2000)), shape=(8000, 3))
    del place.targets[2:]


@hostile
def vds_dot(place):
    """/VTKHDF/Points is a virtual data set over a data set of the same file, by the source name "."."""
    virtual(place, (".", "/hidden"), fill=lambda file: file.create_dataset("hidden", data=cloud(8)))


@hostile
def vds_cycle(place):
    """/VTKHDF/Points is a virtual data set over itself."""
    virtual(place, (".", "/" + POINTS))


@opener
def vds_dot_to_efl(place):
    """/VTKHDF/Points is a virtual data set over a data set of the same file that lies in external raw storage."""
    def fill(file):
        plist = recipe()
        plist.set_fill_time(h5d.FILL_TIME_NEVER)
        plist.set_external(place.absolute("raw.bin").encode(), 0, 192)
        make(file, "hidden", (8, 3), plist)
    virtual(place, (".", "/hidden"), fill=fill)
    assert creation(place.path, "hidden").get_external_count() == 1


@opener
def vds_dot_to_extlink(place):
    """/VTKHDF/Points is a virtual data set over a data set of the same file whose path is an external link."""
    def fill(file):
        file["hidden"] = h5py.ExternalLink(place.absolute("points.h5"), "/" + POINTS)
    virtual(place, (".", "/hidden"), fill=fill)
    assert link_class(place.path, "hidden") == h5l.TYPE_EXTERNAL


# File drivers: members of files in many parts, and what the superblock says of drivers.

def member(place, parts, first, **options):
    """Writes the scene by a driver of many parts into the folder of targets and takes one part of it alone."""
    folder = place.out / "targets"
    scene(folder / parts, n=200, **options).close()
    settle(folder / first)
    shutil.copy(folder / first, place.path)


@opener
def driver_family(place):
    """The first member of a family of files; the driver information block names the driver NCSAfami."""
    member(place, "family-%d.h5", "family-0.h5", driver="family", memb_size=4096)
    place.absolute("family-0.h5"), place.absolute("family-1.h5")
    image = place.path.read_bytes()
    assert image[number(image, 48) + 8:][:8] == b"NCSAfami"


@opener
def driver_family_latest(place):
    """The first member of a family of files with a version 3 superblock, whose extension has a driver message."""
    member(place, "family3-%d.h5", "family3-0.h5", driver="family", memb_size=4096, libver="latest")
    place.absolute("family3-1.h5")
    image = place.path.read_bytes()
    assert image[body(image, number(image, 20), DRIVER):][1:9] == b"NCSAfami"


@opener
def driver_split(place):
    """The metadata part of a split file; the driver information block names NCSAmult and its parts."""
    member(place, "split", "split-m.h5", driver="split", meta_ext=b"-m.h5", raw_ext=b"-r.h5")
    place.absolute("split-r.h5")
    image = place.path.read_bytes()
    assert image[number(image, 48) + 8:][:8] == b"NCSAmult" and b"%s-r.h5" in image


def multi(place, libver, *names):
    """Writes the scene by the multi driver with names of one's own for the superblock's and the other part."""
    fapl, kinds = access(libver), 7
    parts = (ctypes.c_char_p * kinds)(*(names[kind == 2].encode() for kind in range(kinds)))
    starts = (ctypes.c_uint64 * kinds)(*(2**62 * (kind == 2) for kind in range(kinds)))
    call("H5Pset_fapl_multi", fapl.id, (ctypes.c_int * kinds)(1, 1, 2, 1, 1, 1, 1), (ctypes.c_int64 * kinds)(), parts,
         starts, ctypes.c_int(1))
    scene(file_with(place.path.with_suffix(""), fapl=fapl)).close()
    settle(place.path)


@opener
def driver_multi(place):
    """The superblock's part of a multi file; the driver information block names another part by an absolute path."""
    multi(place, "earliest", "%s.h5", place.absolute("multi-raw.h5"))
    image = place.path.read_bytes()
    assert image[number(image, 48) + 8:][:8] == b"NCSAmult" and place.targets[0].encode() in image


@opener
def driver_multi_latest(place):
    """The superblock's part of a multi file with a version 3 superblock and a driver message in its extension."""
    multi(place, "latest", "%s.h5", place.absolute("multi-raw-latest.h5"))
    image = place.path.read_bytes()
    assert image[body(image, number(image, 20), DRIVER):][1:9] == b"NCSAmult"


@opener
def driver_multi_format_string(place):
    """A driver information block of the multi driver whose file name is a format string with %n."""
    multi(place, "earliest", "%s.h5", place.absolute("multi-format-xxxxxxxx.h5"))
    replace(place.path, b"-xxxxxxxx", b"%s%s%s%n.")


def driver_block(image, name):
    """Appends a driver information block and names it in a version 0 superblock."""
    put(image, 48, len(image))
    image += struct.pack("<B3xI8s", 0, 64, name) + b"/etc/passwd".ljust(64, b"\0")
    put(image, 40, len(image))
    assert image[number(image, 48) + 8:][:8] == name


for driver, opens in ("NCSAfami", True), ("NCSAmult", True), ("EVILdrvr", False):
    add("hostile", f"driver_block_{driver.lower()}", f"A benign file whose driver information block names the driver "
        f"{driver}.", lambda place, name=driver.encode(): patched(
            place, "/", lambda image, at: driver_block(image, name)), opens=opens)


# Filters.

def filtered(place, numbers, flags=h5z.FLAG_MANDATORY, name=POINTS, libver="earliest", shape=(8, 3), data=True):
    """Writes the scene with a data set behind filters that are registered only meanwhile."""
    with scene(place.path, without=[name.rpartition("/")[2]], libver=libver) as file:
        plist = recipe((4,) + shape[1:])
        for n in numbers:
            plist.set_filter(n, flags, (1,) if n != 1 else (4,))
        make(file, name, shape, plist, data=numpy.ones(shape) if data else None)
    has_filters(place.path, name, numbers)


def has_filters(path, name, numbers):
    """Asserts which filters a data set has."""
    plist = creation(path, name)
    assert [plist.get_filter(i)[0] for i in range(plist.get_nfilters())] == list(numbers)


for plugin, title in [(257, "the first id for tests"), (307, "bzip2"), (32001, "Blosc"), (32004, "LZ4"),
                      (32008, "bitshuffle"), (32013, "ZFP"), (32015, "Zstandard"), (32026, "Blosc2"),
                      (65535, "the last id")]:
    def with_plugin(place, plugin=plugin):
        with filter_class(plugin):
            filtered(place, [plugin])
    add("hostile", f"filter_plugin_{plugin}",
        f"/VTKHDF/Points needs the filter {plugin} ({title}), for which libhdf5 loads plug-ins.", with_plugin,
        opens=True)


@opener
def filter_plugin_latest(place):
    """/VTKHDF/Points needs the filter 32015, in a version 2 filter message of the newest file format."""
    with filter_class(32015):
        filtered(place, [32015], libver="latest")


@opener
def filter_plugin_v110(place):
    """/VTKHDF/Points needs the filter 32015, in a version 2 filter message of the file format of release 1.10."""
    with filter_class(32015):
        filtered(place, [32015], libver=("v110", "v110"))


@opener
def filter_plugin_last(place):
    """/VTKHDF/Points has shuffle and deflate before the filter 32015."""
    with filter_class(32015):
        filtered(place, [2, 1, 32015])


@opener
def filter_plugin_phi(place):
    """/VTKHDF/PointData/phi needs the filter 32015."""
    with filter_class(32015):
        filtered(place, [32015], name=PHI, shape=(8,))


@opener
def filter_plugin_elsewhere(place):
    """A data set that nobody asked for needs the filter 32015."""
    with filter_class(32015):
        filtered(place, [32015], name="notes/log", shape=(8,))


@opener
def filter_optional_applied(place):
    """/VTKHDF/Points has the filter 32008, marked optional, but its chunks went through it."""
    with filter_class(32008):
        filtered(place, [32008], h5z.FLAG_OPTIONAL)


@opener
def filter_optional_skipped(place):
    """/VTKHDF/Points has the filter 32008, marked optional and left out of every chunk."""
    filtered(place, [32008], h5z.FLAG_OPTIONAL)


@opener
def filter_mandatory_skipped(place):
    """/VTKHDF/Points has the filter 32015 as mandatory, while its chunks say that they were left out of it."""
    with filter_class(32015):
        filtered(place, [32015], data=False)
        with h5py.File(place.path, "r+") as file:
            for row in 0, 4:
                file[POINTS].id.write_direct_chunk((row, 0), numpy.ones((4, 3)).tobytes(), filter_mask=1)
    has_filters(place.path, POINTS, [32015])


@opener
def filter_no_chunk(place):
    """/VTKHDF/Points needs the filter 32015 and has no chunk written."""
    with filter_class(32015):
        filtered(place, [32015], data=False)


@opener
def filter_in_group(place):
    """The links of /VTKHDF/PointData lie in a fractal heap behind the filter 32015, so that looking up a name loads
    plug-ins."""
    with filter_class(32015), scene(place.path, without=["PointData"], libver="latest") as file:
        plist = h5p.create(h5p.GROUP_CREATE)
        plist.set_obj_track_times(False)
        call("H5Pset_link_phase_change", plist.id, ctypes.c_uint(0), ctypes.c_uint(0))
        call("H5Pset_filter", plist.id, ctypes.c_int(32015), ctypes.c_uint(0), ctypes.c_size_t(0), None)
        group = h5py.Group(h5g.create(file["VTKHDF"].id, b"PointData", gcpl=plist))
        for name in "phi", "a", "b", "c":
            group[name] = numpy.zeros(8)
        del group
    image = place.path.read_bytes()
    assert number(image, body(image, address(place.path, POINT_DATA), FILTERS) + 8, 2) == 32015


@opener
def filter_in_shared_message(place):
    """The filter message of /VTKHDF/Points, naming the filter 32015, is in the file's table of shared messages."""
    with filter_class(32015), scene(file_with(place.path, shared_messages()), without=["Points"]) as file:
        for name in "VTKHDF/twin", "VTKHDF/triplet", POINTS:
            plist = recipe((4, 3))
            plist.set_filter(32015, h5z.FLAG_MANDATORY, (1, 2, 3, 4))
            make(file, name, (8, 3), plist, data=cloud(8))
    has_filters(place.path, POINTS, [32015])
    image = place.path.read_bytes()
    assert image[body(image, address(place.path, POINTS), FILTERS) - 3] & 2


@opener
def filter_reserved_id(place):
    """/VTKHDF/Points needs the filter 200, whose id is reserved."""
    scene(place.path, storage={"rows": 4, "fletcher32": True}).close()
    at = address(place.path, POINTS)
    with edit(place.path) as image:
        put(image, body(image, at, FILTERS) + 8, 200, form="H")
    has_filters(place.path, POINTS, [200])


def built_in(place, prepare, numbers):
    """Writes the scene with Points behind filters of libhdf5's own."""
    with scene(place.path, without=["Points"]) as file:
        plist = recipe((8, 3))
        prepare(plist)
        make(file, POINTS, (8, 3), plist, data=cloud(8))
    has_filters(place.path, POINTS, numbers)


@opener
def filter_lzf(place):
    """/VTKHDF/Points needs h5py's filter LZF (32000), which is a plug-in to everybody else."""
    built_in(place, lambda plist: plist.set_filter(h5z.FILTER_LZF, h5z.FLAG_OPTIONAL, ()), [h5z.FILTER_LZF])


@opener
def filter_szip(place):
    """/VTKHDF/Points needs SZIP, which is a plug-in to a libhdf5 built without it."""
    built_in(place, lambda plist: plist.set_szip(h5z.SZIP_NN_OPTION_MASK, 8), [h5z.FILTER_SZIP])


@hostile
def filter_scaleoffset(place):
    """/VTKHDF/Points is behind the filter scale-offset."""
    built_in(place, lambda plist: plist.set_scaleoffset(h5z.SO_FLOAT_DSCALE, 3), [h5z.FILTER_SCALEOFFSET])


@hostile
def filter_nbit(place):
    """/VTKHDF/Points is behind the filter n-bit."""
    built_in(place, lambda plist: plist.set_filter(h5z.FILTER_NBIT, h5z.FLAG_OPTIONAL, ()), [h5z.FILTER_NBIT])


def bad_values(place, write, prepare):
    """Spoils the client values of the only filter of Points."""
    write(place)
    at = address(place.path, POINTS)
    with edit(place.path) as image:
        at = body(image, at, FILTERS)
        name, values = number(image, at + 10, 2), number(image, at + 14, 2)
        assert values > 2
        at += 16 + name
        prepare(image, at)


@hostile
def filter_scaleoffset_bad_values(place):
    """The client values of the filter scale-offset are out of range."""
    bad_values(place, filter_scaleoffset, lambda image, at: put(image, at, *[2**32 - 1] * 6, form="I"))


@hostile
def filter_nbit_bad_values(place):
    """The client values of the filter n-bit are out of range."""
    bad_values(place, filter_nbit, lambda image, at: put(image, at + 8, *[2**32 - 1] * 3, form="I"))


@opener
def filter_szip_bad_values(place):
    """The client values of the filter SZIP are out of range, which makes libhdf5 write beyond its buffers."""
    bad_values(place, filter_szip, lambda image, at: put(image, at + 4, 2**32 - 1, form="I"))


# References, named types, variable length, and other types.

@hostile
def reference_points_object(place):
    """/VTKHDF/Points is a data set of object references."""
    with scene(place.path, without=["Points"]) as file:
        file.create_dataset(POINTS, (8, 3), h5py.ref_dtype)[...] = file[PHI].ref
    with h5py.File(place.path) as file:
        assert h5py.check_ref_dtype(file[POINTS].dtype) is h5py.Reference


@hostile
def reference_points_region(place):
    """/VTKHDF/Points is a data set of region references."""
    with scene(place.path, without=["Points"]) as file:
        file.create_dataset(POINTS, (8, 3), h5py.regionref_dtype)[...] = file[PHI].regionref[2:4]
    with h5py.File(place.path) as file:
        assert h5py.check_ref_dtype(file[POINTS].dtype) is h5py.RegionReference


@hostile
def reference_attribute(place):
    """/VTKHDF has an attribute that is a region reference."""
    with scene(place.path) as file:
        file["VTKHDF"].attrs.create("region", file[PHI].regionref[2:4], dtype=h5py.regionref_dtype)
    with h5py.File(place.path) as file:
        assert file["VTKHDF"].attrs.get_id("region").get_type().get_class() == h5t.REFERENCE


@opener
def reference_to_other_file(place):
    """/VTKHDF/Points is a data set of references of the newest kind, H5T_STD_REF, to an object in another file."""
    reference = ctypes.create_string_buffer(64)
    with h5py.File(place.absolute("points.h5")) as other:
        call("H5Rcreate_object", other.id.id, POINTS.encode(), 0, reference)
        with scene(place.path, without=["Points"], libver="latest") as file:
            kind = ctypes.c_int64.in_dll(library(), "H5T_STD_REF_g").value
            space, plist, create = h5s.create_simple((1,)), recipe(), library().H5Dcreate2
            create.restype, create.argtypes = ctypes.c_int64, [ctypes.c_int64, ctypes.c_char_p] + [ctypes.c_int64] * 5
            made = create(file.id.id, POINTS.encode(), kind, space.id, 0, plist.id, 0)
            call("H5Dwrite", made, kind, 0, 0, 0, reference)
            call("H5Dclose", made)
    assert str(place.out / "targets" / "points.h5").encode() in place.path.read_bytes()


@hostile
def named_type_of_points(place):
    """The data type of /VTKHDF/Points is a committed one, shared with another object."""
    with scene(place.path, without=["Points"]) as file:
        file["real"] = numpy.dtype("f8")
        make(file, POINTS, (8, 3), recipe(), data=cloud(8), dtype=file["real"].id)
    with h5py.File(place.path) as file:
        assert file[POINTS].id.get_type().committed()


@hostile
def named_type_as_points(place):
    """/VTKHDF/Points is a committed data type and no data set."""
    with scene(place.path, without=["Points"]) as file:
        file[POINTS] = numpy.dtype("f8")
    with h5py.File(place.path) as file:
        assert file.get(POINTS, getclass=True) is h5py.Datatype


@hostile
def named_type_of_attribute(place):
    """The data type of the attribute Version is a committed one."""
    with scene(place.path) as file:
        file["whole"] = numpy.dtype("i8")
        file["VTKHDF"].attrs.create("Version", [2, 0], dtype=file["whole"])
    with h5py.File(place.path) as file:
        assert file["VTKHDF"].attrs.get_id("Version").get_type().committed()


def typed(place, dtype, data=None, shape=(8, 3)):
    """Writes the scene with Points of a type."""
    with scene(place.path, without=["Points"]) as file:
        if isinstance(dtype, h5t.TypeID):
            make(file, POINTS, shape, recipe(), dtype=dtype)
        else:
            dataset = file.create_dataset(POINTS, shape, dtype)
            if data is not None:
                dataset[...] = data
    with h5py.File(place.path) as file:
        assert not file[POINTS].id.get_type().equal(h5t.IEEE_F64LE)


def odd_float():
    """A type of 8 bytes like a double, but with other fields."""
    kind = h5t.IEEE_F64LE.copy()
    kind.set_fields(63, 51, 12, 0, 51)
    return kind


def nested(depth):
    """A type of variable length of a type of variable length, and so on."""
    kind = h5t.IEEE_F64LE
    for _ in range(depth):
        kind = h5t.vlen_create(kind)
    return kind


STRINGS = h5py.string_dtype()
PARTS = [("x", "f8"), ("y", "f8"), ("z", "f8")]
for case, what, form, values, extent in [
    ("f32_big_endian", "big-endian single precision", ">f4", 1, (8, 3)),
    ("f64_big_endian", "big-endian double precision", ">f8", 1, (8, 3)),
    ("f16", "half precision", "<f2", 1, (8, 3)),
    ("long_double", "long doubles", numpy.longdouble, None, (8, 3)),
    ("odd_float", "a floating-point type of 8 bytes with other fields than a double", odd_float(), None, (8, 3)),
    ("i64", "64-bit integers", "<i8", 1, (8, 3)),
    ("i8", "bytes", "i1", 1, (8, 3)),
    ("bool", "h5py's booleans, an enumeration", bool, True, (8, 3)),
    ("complex", "complex numbers", "<c16", 1j, (8, 3)),
    ("compound", "a compound of three doubles", PARTS, (1, 2, 3), (8,)),
    ("compound_one", "a compound of one double", PARTS[:1], (1,), (8, 3)),
    ("array", "an array type of three doubles", ("f8", (3,)), None, (8,)),
    ("opaque", "opaque values of 8 bytes", "V8", numpy.void(b"12345678"), (8, 3)),
    ("bitfield", "bit fields", h5t.STD_B64LE, None, (8, 3)),
    ("time", "times", h5t.UNIX_D64LE, None, (8, 3)),
    ("fixed_strings", "strings of fixed length", "S8", b"1.0", (8, 3)),
    ("vlen_strings", "strings of variable length", STRINGS, "1.0", (8, 3)),
    ("vlen_doubles", "sequences of variable length", h5t.vlen_create(h5t.IEEE_F64LE), None, (8, 3)),
    ("vlen_nested", "sequences of sequences, nested 200 deep", nested(200), None, (8, 3)),
]:
    add("hostile", f"points_{case}", f"/VTKHDF/Points is of a wrong type: {what}.",
        lambda place, form=form, values=values, extent=extent: typed(place, form, values, extent))

CLOUD = cloud(8)
NAN, INFINITE = CLOUD.copy(), CLOUD.copy()
NAN[5, 1], INFINITE[2, 2] = numpy.nan, -numpy.inf
for case, what, parts in [
    ("points_two_columns", "/VTKHDF/Points has two columns.", {"points": CLOUD[:, :2]}),
    ("points_four_columns", "/VTKHDF/Points has four columns.", {"points": numpy.ones((8, 4))}),
    ("points_flat", "/VTKHDF/Points is one row of numbers.", {"points": CLOUD.ravel()}),
    ("points_transposed", "/VTKHDF/Points is transposed, three rows.", {"points": CLOUD.T.copy()}),
    ("points_rank_3", "/VTKHDF/Points has three dimensions.", {"points": CLOUD[None]}),
    ("points_scalar", "/VTKHDF/Points is one number without dimensions.", {"points": numpy.float64(1)}),
    ("points_null", "/VTKHDF/Points has a null dataspace.", {"points": h5py.Empty("f8")}),
    ("points_none", "/VTKHDF/Points has no rows.", {"points": CLOUD[:0], "phi": numpy.zeros(0)}),
    ("points_nan", "/VTKHDF/Points has a NaN.", {"points": NAN}),
    ("points_infinite", "/VTKHDF/Points has an infinite number.", {"points": INFINITE}),
    ("points_missing", "/VTKHDF/Points is missing.", {"without": ["Points"]}),
    ("phi_too_short", "/VTKHDF/PointData/phi is shorter than the points.", {"phi": numpy.zeros(7)}),
    ("phi_too_long", "/VTKHDF/PointData/phi is longer than the points.", {"phi": numpy.zeros(9)}),
    ("phi_two_columns", "/VTKHDF/PointData/phi has two columns.", {"phi": numpy.zeros((8, 2))}),
    ("phi_scalar", "/VTKHDF/PointData/phi is one number without dimensions.", {"phi": numpy.float64(0)}),
    ("phi_nan", "/VTKHDF/PointData/phi has a NaN.", {"phi": numpy.full(8, numpy.nan)}),
    ("phi_strings", "/VTKHDF/PointData/phi holds strings.", {"phi": numpy.full(8, b"0.5")}),
    ("vtkhdf_missing", "There is no group /VTKHDF: the root group is empty.", {"without": ["VTKHDF"]}),
]:
    add("hostile", case, what, lambda place, parts=parts: scene(place.path, n=8, **parts).close())


@hostile
def points_is_group(place):
    """/VTKHDF/Points is a group."""
    with scene(place.path, without=["Points"]) as file:
        file.create_group(POINTS)


@hostile
def vtkhdf_is_dataset(place):
    """/VTKHDF is a data set."""
    with scene(place.path, without=["VTKHDF"]) as file:
        file["VTKHDF"] = cloud(8)


# Claims and bombs.

def claim(place, shape, chunk=None, libver="earliest"):
    """Writes the scene with a Points of which nothing is stored."""
    with scene(place.path, without=["Points"], libver=libver) as file:
        plist = recipe(chunk)
        plist.set_alloc_time(h5d.ALLOC_TIME_LATE)
        make(file, POINTS, shape, plist)
    with h5py.File(place.path) as file:
        assert file[POINTS].shape == shape and file[POINTS].id.get_storage_size() == 0


for case, what, extent, rows in [
    ("chunked", "2^40 rows in small chunks, none of them stored", (2**40, 3), (16, 3)),
    ("contiguous", "2^40 contiguous rows, none of them stored", (2**40, 3), None),
    ("contiguous_most", "2^58 contiguous rows, almost all that a file can have, none of them stored", (2**58, 3), None),
    ("huge_chunks", "chunks of 4 GB, none of them stored", (178_000_000, 3), (178_000_000, 3)),
]:
    add("hostile", f"claim_{case}", f"/VTKHDF/Points claims {what}.",
        lambda place, extent=extent, rows=rows: claim(place, extent, rows))


@hostile
def claim_chunked_latest(place):
    """/VTKHDF/Points claims 2^40 rows in small chunks, in the newest file format."""
    claim(place, (2**40, 3), (16, 3), libver="latest")


@hostile
def claim_single_chunk_latest(place):
    """/VTKHDF/Points claims one chunk of 4 GB, in the newest file format."""
    claim(place, (178_000_000, 3), (178_000_000, 3), libver="latest")


for case, what, rows in [
    ("more_than_stored", "2^40 rows, the layout holds 8", 2**40),
    ("overflow_of_count", "so many rows that the number of values is 2 modulo 2^64", (2**64 + 2) // 3),
    ("overflow_of_bytes", "so many rows that the number of bytes is 8 modulo 2^64", (2**64 + 8) // 24),
]:
    add("hostile", f"claim_{case}", f"The dataspace of /VTKHDF/Points claims {what}.", lambda place, rows=rows: patched(
        place, POINTS, lambda image, at: put(image, body(image, at, DATASPACE) + 8, rows, 3, rows, 3)))


@functools.cache
def zeros(size, passes=1, level=6):
    """That many zeros, deflated."""
    packer = zlib.compressobj(level)
    block = bytes(1 << 20)
    packed = b"".join(packer.compress(block) for _ in range(size >> 20)) + packer.compress(bytes(size % (1 << 20)))
    packed += packer.flush()
    for _ in range(passes - 1):
        packed = zlib.compress(packed, 9)
    return packed


def bomb(place, rows, chunks, packed, passes=1, libver="earliest", shuffle=False):
    """Writes the scene with Points made of copies of one deflated chunk."""
    with scene(place.path, without=["Points", "phi"], libver=libver) as file:
        plist = recipe((rows, 3))
        if shuffle:
            plist.set_shuffle()
        for _ in range(passes):
            plist.set_filter(h5z.FILTER_DEFLATE, h5z.FLAG_OPTIONAL, (6,))
        dataset = make(file, POINTS, (rows * chunks, 3), plist)
        for i in range(chunks):
            dataset.write_direct_chunk((i * rows, 0), packed)
        make(file, PHI, (rows * chunks,), recipe((rows,)))
    assert creation(place.path, POINTS).get_nfilters() == passes + shuffle
    with h5py.File(place.path) as file:
        assert file[POINTS].id.get_storage_size() * 200 < file[POINTS].nbytes > 2**29


@hostile
def bomb_deflate(place):
    """/VTKHDF/Points is 1 GB of zeros, deflated to 1 MB."""
    bomb(place, 699_050, 64, zeros(699_050 * 24))


@hostile
def bomb_deflate_latest(place):
    """/VTKHDF/Points is 1 GB of zeros behind shuffle and deflate, in the newest file format."""
    bomb(place, 699_050, 64, zeros(699_050 * 24), libver="latest", shuffle=True)


@hostile
def bomb_deflate_twice(place):
    """/VTKHDF/Points is 16 GB of zeros behind two deflate filters, in a few kilobytes."""
    bomb(place, 11_184_810, 64, zeros(11_184_810 * 24, passes=2), passes=2)


@hostile
def bomb_deflate_overflow(place):
    """The chunks of /VTKHDF/Points are of 24 kB and inflate to 256 MB each."""
    with scene(place.path, without=["Points"]) as file:
        plist = recipe((1000, 3))
        plist.set_filter(h5z.FILTER_DEFLATE, h5z.FLAG_OPTIONAL, (6,))
        make(file, POINTS, (1000, 3), plist).write_direct_chunk((0, 0), zeros(11_184_810 * 24))
    has_filters(place.path, POINTS, [1])


@hostile
def bomb_scaleoffset(place):
    """/VTKHDF/Points is 1 GB of equal numbers behind the filter scale-offset, about 30 bytes a chunk."""
    with scene(place.path, without=["Points"]) as file:
        plist = recipe((699_050, 3))
        plist.set_scaleoffset(h5z.SO_INT, 0)
        call("H5Pset_fill_value", plist.id, h5t.STD_I64LE.id, None)
        make(file, POINTS, (699_050, 3), plist, data=numpy.zeros((699_050, 3), "i8"), dtype=h5t.STD_I64LE)
    with h5py.File(place.path, "r+") as file:
        packed = file[POINTS].id.read_direct_chunk((0, 0))[1]
        del file[POINTS]
        dataset = make(file, POINTS, (699_050 * 64, 3), plist, dtype=h5t.STD_I64LE)
        for i in range(64):
            dataset.write_direct_chunk((i * 699_050, 0), packed)
    has_filters(place.path, POINTS, [h5z.FILTER_SCALEOFFSET])


@hostile
def bomb_filters(place):
    """/VTKHDF/Points has 32 filters, the most that there may be, each of them shuffle."""
    filtered(place, [h5z.FILTER_SHUFFLE] * 32)


@hostile
def bomb_attributes_many(place):
    """/VTKHDF has 5000 attributes, in dense attribute storage."""
    with scene(place.path, libver="latest") as file:
        for i in range(5000):
            h5a.create(file["VTKHDF"].id, b"a%d" % i, h5t.STD_I8LE, h5s.create(h5s.SCALAR))
    with h5py.File(place.path) as file:
        assert len(file["VTKHDF"].attrs) == 5002


@hostile
def bomb_attributes_many_old(place):
    """/VTKHDF/Points has 2000 attributes in continuation blocks of a version 1 object header."""
    with scene(place.path) as file:
        for i in range(2000):
            h5a.create(file[POINTS].id, b"a%d" % i, h5t.STD_I8LE, h5s.create(h5s.SCALAR))
    image = place.path.read_bytes()
    assert len(messages(image, address(place.path, POINTS))) > 2000


@hostile
def attribute_dense(place):
    """/VTKHDF/Points has 12 attributes in dense attribute storage."""
    with scene(place.path, libver="latest") as file:
        for i in range(12):
            file[POINTS].attrs[f"a{i}"] = i
    image = place.path.read_bytes()
    assert number(image, body(image, address(place.path, POINTS), 21) + 2) != UNDEFINED


@hostile
def bomb_attribute_huge(place):
    """/VTKHDF has an attribute of 4 MB, in dense attribute storage."""
    with scene(place.path, libver="latest") as file:
        file["VTKHDF"].attrs["large"] = numpy.zeros(2**19)
    assert place.path.stat().st_size > 2**22


@hostile
def bomb_attribute_claim(place):
    """/VTKHDF/Points has an attribute whose dataspace claims 2^40 values."""
    with scene(place.path) as file:
        file[POINTS].attrs["large"] = numpy.full(3, 7, "i4")
    values = struct.pack("<3I", 7, 7, 7)
    replace(place.path, struct.pack("<QQ", 3, 3) + values, struct.pack("<QQ", 2**40, 2**40) + values)


@hostile
def bomb_groups_deep(place):
    """5000 groups, each inside the one before."""
    with scene(place.path, libver="latest") as file:
        group, plist = file["VTKHDF"].id, h5p.create(h5p.GROUP_CREATE)
        plist.set_obj_track_times(False)
        for _ in range(5000):
            group = h5g.create(group, b"g", gcpl=plist)
    assert place.path.read_bytes().count(b"OHDR") > 5000


@hostile
def bomb_groups_doubling(place):
    """40 groups of which each has two hard links to the next: 2^40 paths in a small file."""
    with scene(place.path) as file:
        group = file["VTKHDF"]
        for _ in range(40):
            group["a"] = group.create_group("b")
            group = group["a"]
    with h5py.File(place.path) as file:
        assert file["VTKHDF" + "/a" * 40] == file["VTKHDF" + "/b" * 40]


@hostile
def bomb_links_many(place):
    """/VTKHDF has 20000 hard links to its Points in an old-style group."""
    with scene(place.path) as file:
        for i in range(20000):
            h5o.link(file[POINTS].id, file["VTKHDF"].id, b"p%d" % i)
    with h5py.File(place.path) as file:
        assert len(file["VTKHDF"]) == 20002


@hostile
def bomb_link_name(place):
    """The root group has a link with a name of 60000 letters."""
    with scene(place.path) as file:
        file["n" * 60000] = 1
    assert b"n" * 60000 in place.path.read_bytes()


@hostile
def bomb_type_members(place):
    """/VTKHDF/PointData/velocity is a compound of 1000 members."""
    with scene(place.path) as file:
        file.create_dataset("VTKHDF/PointData/velocity", (8,), [(f"m{i}", "f8") for i in range(1000)])
    with h5py.File(place.path) as file:
        assert file["VTKHDF/PointData/velocity"].id.get_type().get_nmembers() == 1000


@hostile
def bomb_rank(place):
    """/VTKHDF/Points has 32 dimensions, the most that there may be."""
    with scene(place.path, without=["Points"]) as file:
        make(file, POINTS, (1,) * 31 + (3,), recipe(), data=numpy.ones((1,) * 31 + (3,)))
    with h5py.File(place.path) as file:
        assert file[POINTS].ndim == 32


# The file as a whole.

def user_block(place, front, size):
    """Writes the scene after a user block."""
    scene(place.path, userblock_size=size).close()
    with edit(place.path) as image:
        assert image[size:size + 8] == b"\x89HDF\r\n\x1a\n" and len(front) <= size
        image[:len(front)] = front


@hostile
def userblock_512(place):
    """A user block of 512 bytes, a shell script, stands before the superblock."""
    user_block(place, b"#!/bin/sh\nexit 1\n", 512)


@hostile
def userblock_65536(place):
    """A user block of 64 KB stands before the superblock."""
    user_block(place, b"", 65536)


@hostile
def userblock_picture(place):
    """A PNG header and a user block of 2048 bytes stand before the superblock."""
    user_block(place, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x08\2\0\0\0", 2048)


@opener
def userblock_broken_superblock(place):
    """A superblock of an unknown version at the beginning, and a whole file with a user block behind it."""
    user_block(place, b"\x89HDF\r\n\x1a\n\x09", 512)


def shared_messages():
    """A file creation property list that asks for a table of shared messages of every kind."""
    fcpl = h5p.create(h5p.FILE_CREATE)
    call("H5Pset_shared_mesg_nindexes", fcpl.id, ctypes.c_uint(1))
    call("H5Pset_shared_mesg_index", fcpl.id, ctypes.c_uint(0), ctypes.c_uint(0x182A), ctypes.c_uint(8))
    return fcpl


def extension(path, kind):
    """Asserts that the superblock's extension has a message of a type."""
    settle(path)
    image = path.read_bytes()
    assert image[8] >= 2 and body(image, number(image, 20), kind)


@hostile
def extension_shared_messages(place):
    """The superblock's extension names a table of shared messages, which data types and dataspaces lie in."""
    with scene(file_with(place.path, shared_messages())) as file:
        file["VTKHDF/PointData/a"] = file["VTKHDF/PointData/b"] = cloud(8)
    extension(place.path, 15)
    assert b"SMTB" in place.path.read_bytes()


@hostile
def extension_tree_sizes(place):
    """The superblock's extension has tree sizes of its own."""
    fcpl = h5p.create(h5p.FILE_CREATE)
    call("H5Pset_istore_k", fcpl.id, ctypes.c_uint(4096))
    scene(file_with(place.path, fcpl, libver="latest")).close()
    extension(place.path, 19)


@hostile
def extension_file_space(place):
    """The superblock's extension has a file space message with free-space managers that persist."""
    fcpl = h5p.create(h5p.FILE_CREATE)
    fcpl.set_file_space_strategy(h5f.FSPACE_STRATEGY_FSM_AGGR, True, 1)
    with scene(file_with(place.path, fcpl, libver="latest")) as file:
        file["gone"] = cloud(500)
        del file["gone"]
    extension(place.path, 23)


@hostile
def extension_pages(place):
    """The superblock's extension asks for paged allocation of file space."""
    fcpl = h5p.create(h5p.FILE_CREATE)
    fcpl.set_file_space_strategy(h5f.FSPACE_STRATEGY_PAGE, False, 1)
    scene(file_with(place.path, fcpl)).close()
    extension(place.path, 23)


@opener
def cache_image_claim(place):
    """A metadata cache image in the superblock's extension claims 2^40 bytes."""
    extlink_in_cache_image(place)
    place.targets.clear()
    with edit(place.path) as image:
        at = number(image, 20)
        put(image, body(image, at, CACHE_IMAGE) + 9, 2**40)
        seal(image, at)


@hostile
def superblock_narrow_offsets(place):
    """Offsets and lengths are of 4 bytes, as the superblock says."""
    fcpl = h5p.create(h5p.FILE_CREATE)
    fcpl.set_sizes(4, 4)
    scene(file_with(place.path, fcpl)).close()
    assert place.path.read_bytes()[13:15] == b"\4\4"


@opener
def superblock_check_sum(place):
    """The check sum of the superblock is wrong."""
    patched(place, "/", lambda image, at: put(image, 44, 0, form="I"), libver="latest")
    assert refused(place.path)


for case, what, opens, offset, form, values in [
    ("version_9", "is of version 9", True, 8, "B", [9]),
    ("wide_offsets", "claims offsets and lengths of 255 bytes", True, 13, "B", [255, 255]),
    ("zero_ranks", "says that the trees of groups have nodes of no entries", True, 16, "H", [0, 0]),
    ("large_ranks", "says that the trees of groups have nodes of 65535 entries", False, 16, "H", [65535, 65535]),
    ("short_end", "puts the end of the file before its objects", False, 40, "Q", [200]),
    ("long_end", "puts the end of the file beyond it", True, 40, "Q", [2**40]),
    ("root_beyond_end", "puts the root group beyond the end of the file", True, 64, "Q", [2**40]),
    ("driver_beyond_end", "puts the driver information block beyond the end of the file", False, 48, "Q", [2**40]),
    ("left_open", "of version 3 says that somebody has the file open for writing", True, 11, "B", [5]),
    ("extension_beyond_end", "of version 3 puts its extension beyond the end of the file", True, 20, "Q", [2**40]),
]:
    def superblock(place, opens=opens, offset=offset, form=form, values=values, new="version 3" in what):
        def change(image, at):
            put(image, offset, *values, form=form)
            if new:
                seal(image, 0)
        patched(place, "/", change, libver="latest" if new else "earliest")
        assert refused(place.path) == opens
    add("hostile", f"superblock_{case}", f"The superblock {what}.", superblock, opens)


def plain(content):
    """Writes bytes that are no HDF5 file."""
    def write(place):
        place.path.write_bytes(content)
        assert refused(place.path)
    return write


for case, what, content in [
    ("empty", "an empty file", b""),
    ("text", "a text", b"x y z phi\n0 0 0 1\n" * 50),
    ("png", "the beginning of a PNG picture", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(1000)),
    ("zeros", "4096 zeros", bytes(4096)),
    ("noise", "noise", numpy.random.default_rng(3).bytes(4096)),
    ("signature", "the signature of HDF5 alone", b"\x89HDF\r\n\x1a\n"),
    ("signature_zeros", "the signature of HDF5 and zeros", b"\x89HDF\r\n\x1a\n" + bytes(4096)),
    ("signature_ones", "the signature of HDF5 and bytes of ones", b"\x89HDF\r\n\x1a\n" + b"\xff" * 4096),
    ("signature_text_mode", "a signature whose line ends were changed", b"\x89HDF\n\x1a\n" + bytes(4096)),
    ("hdf4", "the beginning of an HDF4 file", b"\x0e\x03\x13\x01" + bytes(1000)),
    ("netcdf3", "the beginning of a netCDF 3 file", b"CDF\x01" + bytes(1000)),
    ("npy", "the beginning of a NumPy file", b"\x93NUMPY\x01\x00" + bytes(1000)),
]:
    add("hostile", f"no_hdf5_{case}", f"The file is no HDF5 file but {what}.", plain(content), opens=True)


@opener
def no_hdf5_gzip(place):
    """The file is an HDF5 file inside gzip."""
    scene(place.path).close()
    plain(gzip.compress(place.path.read_bytes(), mtime=0))(place)


for libver in "earliest", "latest":
    for size in 9, 48, 100, 400, -512, -1:
        def truncated(place, libver=libver, size=size):
            scene(place.path, libver=libver).close()
            plain(place.path.read_bytes()[:size])(place)
        add("hostile", f"truncated_{libver}_{size}".replace("-", "minus"), "The file ends " +
            (f"after {size} bytes" if size > 0 else f"{-size} bytes too early") + f", format {libver}.", truncated,
            opens=True)


# Object headers, trees and heaps.

def message(kind, form, *values, flags=0):
    """A change that adds a message to a version 1 object header."""
    return lambda image, at: inject(image, at, (kind, flags, struct.pack(form, *values)))


def field(kind, offset, form, *values):
    """A change of values at an offset in the first message of a type, or before it."""
    return lambda image, at: put(image, body(image, at, kind) + offset, *values, form=form)


def continue_at_itself(image, at):
    """Adds a continuation message that names the block that it is in."""
    inject(image, at, (CONTINUATION, 0, struct.pack("<QQ", *opening(image, at))))


def be_group_too(image, at):
    """Adds the root group's symbol table message."""
    inject(image, at, (TABLE, 0, bytes(image[body(image, number(image, 64), TABLE):][:16])))


for case, what, change, options in [
    ("header_continuation_cycle", "A continuation message leads back to its own block", continue_at_itself, {}),
    ("header_continuation_beyond_end", "A continuation message leads beyond the end of the file",
     message(CONTINUATION, "<QQ", 2**40, 64), {}),
    ("header_unknown_message", "The object header has a message of the unknown type 254, marked to be ignored",
     message(0xFE, "<Q", 0), {}),
    ("header_unknown_message_must_fail", "The object header has a message of the unknown type 254, marked to fail on",
     message(0xFE, "<Q", 0, flags=0x80), {}),
    ("header_two_layouts", "The object header has a second layout message, which puts the data on the superblock",
     message(LAYOUT, "<BBQQ", 3, 1, 0, 192), {}),
    ("header_two_dataspaces", "The object header has a second dataspace message, with 2^40 rows",
     message(DATASPACE, "<BBB5xQQ", 1, 2, 0, 2**40, 3), {}),
    ("header_external_link", "The object header of the data set has a link message with an external link",
     message(LINK, "<BBBB1sHB13s", 1, 8, 64, 1, b"x", 14, 0, b"/etc/passwd\0/"), {}),
    ("header_of_group_and_dataset", "The object header has a symbol table message too, so that it is a group as well",
     be_group_too, {}),
    ("header_many_messages", "The object header claims 65535 messages",
     lambda image, at: put(image, at + 2, 65535, form="H"), {}),
    ("header_long_message", "A message claims more bytes than its block has", field(LAYOUT, -6, "H", 0xFFF8), {}),
    ("header_check_sum", "The check sum of the version 2 object header is wrong",
     lambda image, at: put(image, sum(opening(image, at)), 0, form="I"), {"libver": "latest"}),
    ("header_shared_layout", "The layout message is marked as shared, as none can be", field(LAYOUT, -4, "B", 2), {}),
    ("dataspace_rank_200", "The dataspace claims 200 dimensions", field(DATASPACE, 1, "B", 200), {}),
    ("datatype_size_zero", "The data type is of no bytes", field(DATATYPE, 4, "I", 0), {}),
    ("datatype_size_huge", "The data type is of 4 GB", field(DATATYPE, 4, "I", 2**32 - 1), {}),
    ("datatype_bits_outside", "The exponent of the data type lies outside its 8 bytes",
     field(DATATYPE, 12, "B", 200, 200), {}),
    ("fill_value_huge", "The fill value claims 2 GB", field(FILL, 4, "I", 2**31 - 1), {}),
    ("layout_unknown_class", "The layout is of the unknown class 9", field(LAYOUT, 1, "B", 9), {}),
    ("layout_unknown_version", "The layout is of the unknown version 9", field(LAYOUT, 0, "B", 9), {}),
    ("layout_beyond_end", "The data lie beyond the end of the file", field(LAYOUT, 2, "Q", 2**40), {}),
    ("layout_on_superblock", "The data lie on the superblock", field(LAYOUT, 2, "Q", 0), {}),
    ("layout_too_short", "The layout has fewer bytes than the dataspace takes", field(LAYOUT, 10, "Q", 8), {}),
]:
    add("hostile", case, f"/VTKHDF/Points: {what}.",
        lambda place, change=change, options=options: patched(place, POINTS, change, **options))


def be_own_child(image, node, child):
    """Makes a leaf of a tree the parent of itself."""
    put(image, node + 5, 1, form="B")
    put(image, node + child, node)


for case, what, change in [
    ("chunk_size_zero", "The chunks have no rows",
     lambda image, layout, tree: put(image, layout + 11, 0, form="I")),
    ("chunk_rank_one", "The chunks have fewer dimensions than the data set",
     lambda image, layout, tree: put(image, layout + 2, 2, form="B")),
    ("chunk_element_size", "The chunks claim elements of another size than the data type",
     lambda image, layout, tree: put(image, layout + 19, 64, form="I")),
    ("chunk_bytes_huge", "A chunk claims 4 GB in the file",
     lambda image, layout, tree: put(image, tree + 24, 2**32 - 1, form="I")),
    ("chunk_mask_all", "A chunk was left out of every filter by its mask, but is of the size of a deflated one",
     lambda image, layout, tree: put(image, tree + 28, 2**32 - 1, form="I")),
    ("chunk_short", "A chunk is left out of every filter and has 8 bytes, so that the rest is the reader's memory",
     lambda image, layout, tree: put(image, tree + 24, 8, 2**32 - 1, form="I")),
    ("chunk_offset_between", "A chunk is said to begin in the middle of another",
     lambda image, layout, tree: put(image, tree + 64 + 8, 2)),
    ("chunk_beyond_end", "A chunk lies beyond the end of the file",
     lambda image, layout, tree: put(image, tree + 56, 2**40)),
    ("chunk_tree_own_child", "The tree of the chunks is its own child",
     lambda image, layout, tree: be_own_child(image, tree, 56)),
]:
    def chunked(image, at, change=change):
        layout = body(image, at, LAYOUT)
        tree = number(image, layout + 3)
        assert image[tree:tree + 4] == b"TREE"
        change(image, layout, tree)
    add("hostile", case, f"/VTKHDF/Points: {what}.", lambda place, change=chunked: patched(
        place, POINTS, change, storage={"rows": 4, "compression": 1}))


@hostile
def chunk_inflates_short(place):
    """/VTKHDF/Points: A chunk inflates to 8 bytes of the 192 that it takes, so that the rest is the reader's memory."""
    with scene(place.path, without=["Points"]) as file:
        plist = recipe((8, 3))
        plist.set_filter(h5z.FILTER_DEFLATE, h5z.FLAG_OPTIONAL, (6,))
        make(file, POINTS, (8, 3), plist).write_direct_chunk((0, 0), zlib.compress(bytes(8)))
    has_filters(place.path, POINTS, [1])


@hostile
def chunk_short_unfiltered(place):
    """/VTKHDF/Points: A chunk without filters has 8 bytes of the 96 that it takes, so that the rest is the reader's
    memory."""
    patched(place, POINTS, lambda image, at: put(image, number(image, body(image, at, LAYOUT) + 3) + 24, 8, form="I"),
            storage={"rows": 4})


def end_no_name(image, heap):
    """Fills a heap with letters."""
    start, size = number(image, heap + 24), number(image, heap + 8)
    image[start + 8:start + size] = b"P" * (size - 8)
    put(image, heap + 16, 1)


for case, what, change in [
    ("tree_own_child", "The tree is its own child", lambda image, tree, heap, node: be_own_child(image, tree, 32)),
    ("tree_own_sibling", "The tree is its own right sibling",
     lambda image, tree, heap, node: put(image, tree + 16, tree)),
    ("node_count", "The node of symbols claims 65535 of them",
     lambda image, tree, heap, node: put(image, node + 6, 65535, form="H")),
    ("name_outside", "A name lies outside the heap", lambda image, tree, heap, node: put(image, node + 8, 2**40)),
    ("name_unended", "The heap of names ends without a zero", lambda image, tree, heap, node: end_no_name(image, heap)),
    ("heap_beyond_end", "The heap of names lies beyond the end of the file",
     lambda image, tree, heap, node: put(image, heap + 24, 2**40)),
]:
    def tabled(image, at, change=change):
        tree, heap = (number(image, body(image, at, TABLE) + i) for i in (0, 8))
        node = number(image, tree + 32)
        assert (image[tree:tree + 4], image[heap:heap + 4], image[node:node + 4]) == (b"TREE", b"HEAP", b"SNOD")
        change(image, tree, heap, node)
    add("hostile", f"group_{case}", f"/VTKHDF, an old-style group: {what}.",
        lambda place, change=tabled: patched(place, "VTKHDF", change))


# What an honest user uploads.

def fine(name, what, n=8, whole=False, kind="benign", **options):
    """Registers a benign file, with topology and further columns if it is to be whole."""
    def write(place):
        with scene(place.path, n=n, **options) as file:
            if whole:
                topology(file["VTKHDF"], n)
                columns(file["VTKHDF"], n)
        with h5py.File(place.path) as file:
            assert file[POINTS].shape == (n, 3) and file[PHI].shape == (n,)
            assert numpy.array_equal(file[POINTS][...], cloud(n).astype(file[POINTS].dtype))
    add(kind, name, what, write)


CHECKED, SMALL = {"rows": 4, "fletcher32": True}, {"rows": 4, "shuffle": True, "compression": 1}
fine("minimal", "Points and phi only, as h5py writes them by default.")
fine("minimal_latest", "Points and phi only, in the newest file format.", libver="latest")
fine("minimal_v108", "Points and phi only, in the file format of release 1.8.", libver=("v108", "v108"))
fine("minimal_v110", "Points and phi only, in the file format of release 1.10.", libver=("v110", "v110"))
fine("chunked", "Points and phi in chunks without filters.", storage={"rows": 4})
fine("chunked_partial", "Points and phi in chunks of which the last is not full.", storage={"rows": 3})
fine("fletcher32", "Points and phi in chunks with check sums.", storage=CHECKED)
fine("shuffle_gzip", "Points and phi behind shuffle and deflate 1.", storage=SMALL)
fine("shuffle_gzip_fletcher32", "Points and phi behind shuffle, deflate 1 and check sums.", storage=SMALL | CHECKED)
for version, bounds in ("v108", ("v108", "v108")), ("v110", ("v110", "v110")), ("latest", "latest"):
    fine(f"chunked_{version}", f"Points and phi in chunks without filters, format {version}.", storage={"rows": 4},
         libver=bounds)
    fine(f"frame_{version}", f"All of the layout with topology and further columns, format {version}.", whole=True,
         libver=bounds)
    later = "newest" if version == "latest" and h5py.version.hdf5_version_tuple >= (2, 0, 0) else "benign"
    fine(f"fletcher32_{version}", f"Points and phi in chunks with check sums, format {version}.", kind=later,
         storage=CHECKED, libver=bounds)
    fine(f"shuffle_gzip_{version}", f"Points and phi behind shuffle and deflate 1, format {version}.", kind=later,
         storage=SMALL, libver=bounds)
fine("frame", "All of the layout with topology and further columns.", whole=True)
fine("frame_fletcher32", "All of the layout, Points and phi with check sums.", whole=True, storage=CHECKED)
fine("one_point", "One point.", n=1)
fine("one_point_latest", "One point, in the newest file format.", n=1, libver="latest")
fine("one_chunk_latest", "All points in one chunk, in the newest file format.", storage={"rows": 8}, libver="latest")
fine("points_f32", "Points in single precision.", points=cloud(8).astype("f4"))
fine("points_f32_latest", "Points in single precision, in the newest file format.", points=cloud(8).astype("f4"),
     libver="latest")
fine("many", "100000 points, contiguous, all of the layout.", n=100_000, whole=True)
fine("many_chunked", "100000 points in 98 chunks with check sums.", n=100_000, storage=CHECKED | {"rows": 1024})
fine("many_chunked_v110", "100000 points in 1563 chunks with check sums, format v110.", n=100_000,
     storage=CHECKED | {"rows": 64}, libver=("v110", "v110"))
fine("many_gzip_v108", "100000 points in 98 chunks behind shuffle and deflate 1, format v108.", n=100_000,
     storage=SMALL | {"rows": 1024}, libver=("v108", "v108"))


@benign
def many_columns(place):
    """Twenty further columns, so that the symbol table of the group has more than one node."""
    with scene(place.path) as file:
        for i in range(20):
            file[POINT_DATA][f"column{i:02}"] = numpy.arange(8.0)


def timed(place, libver):
    """Writes the scene with times on data sets and, in the newest format, on a group; always the same times."""
    with scene(place.path, libver=libver, storage={"track_times": True}) as file:
        file["VTKHDF/FieldData/Time"] = numpy.array([0.25])
    settle(place.path)
    for name in [POINTS, PHI] + ["VTKHDF/FieldData"] * (libver == "latest"):
        if libver == "earliest":
            at = address(place.path, name)
            with edit(place.path) as image:
                put(image, body(image, at, MODIFIED) + 4, MOMENT, form="I")
        with h5py.File(place.path) as file:
            assert h5o.get_info(file[name].id).ctime == MOMENT


@benign
def times(place):
    """Points and phi with their times of change."""
    timed(place, "earliest")


@benign
def times_latest(place):
    """Points and phi with their times, in the newest file format."""
    timed(place, "latest")


@benign
def compact(place):
    """Points and phi inside their object headers."""
    with scene(place.path, without=["Points", "phi"]) as file:
        plist = recipe()
        plist.set_layout(h5d.COMPACT)
        make(file, POINTS, (8, 3), plist, data=cloud(8))
        make(file, PHI, (8,), plist, data=numpy.zeros(8))


@benign
def compact_latest(place):
    """Points and phi inside their object headers, in the newest file format."""
    with scene(place.path, without=["Points", "phi"], libver="latest") as file:
        plist = recipe()
        plist.set_layout(h5d.COMPACT)
        make(file, POINTS, (8, 3), plist, data=cloud(8))
        make(file, PHI, (8,), plist, data=numpy.zeros(8))


# Everything.

def write_targets(out):
    """Writes the files that hostile files name."""
    folder = out / "targets"
    (folder / "plugins").mkdir(parents=True)
    for name in "raw.bin", "raw2.bin":
        (folder / name).write_bytes(numpy.arange(64.0).tobytes())
    for path in folder / "points.h5", out / "hostile" / "sibling_of_links.h5":
        scene(path).close()
    for path in folder / "part-0.h5", folder / "part-1.h5":
        scene(path, n=4).close()
    with h5py.File(folder / "unlimited.h5", "w") as file:
        file.create_dataset(POINTS, data=cloud(8), maxshape=(None, 3))
    for name, path in ("chain.h5", "points.h5"), ("ping_pong.h5", "../hostile/extlink_ping_pong.h5"):
        with h5py.File(folder / name, "w") as file:
            file[POINTS] = h5py.ExternalLink(path, "/" + POINTS)
    (folder / "plugins" / "libh5hostile.so").write_bytes(b"no library: opening it is what a test looks for\n")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    out = Path(sys.argv[1]).resolve()
    for folder in *CASES, "targets":
        shutil.rmtree(out / folder, ignore_errors=True)
        (out / folder).mkdir(parents=True, exist_ok=True)
    write_targets(out)
    manifest = {kind: [] for kind in CASES}
    for kind, cases in CASES.items():
        for name, what, write, opens in cases:
            place = Place(out, kind, name)
            write(place)
            entry = {"name": name, "what": what, "as": "points"}
            if kind == "hostile":
                plugin = {str(out / "targets" / "plugins" / "libh5hostile.so")} if opens else set()
                entry |= {"opens_other_files": opens, "targets": sorted(plugin | set(place.targets))}
            manifest[kind].append(entry)
    (out / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
