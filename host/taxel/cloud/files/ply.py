"""PLY: points or triangles, text or binary of either byte order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.extras import (
    SILENT,
    cloud_of_columns,
    comments_of,
    extra_columns,
    names_of,
    places,
    silent_columns,
    with_silent,
)
from taxel.cloud.files.source import LONGEST_HEADER, Source, natural, shown, whole
from taxel.cloud.files.xyz import lines_of
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray

Rows = dict[str, FloatArray]

ORDERS: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

TYPES: Final = {
    name: kind
    for kind, names in (
        ("i1", ("char", "int8")),
        ("u1", ("uchar", "uint8")),
        ("i2", ("short", "int16")),
        ("u2", ("ushort", "uint16")),
        ("i4", ("int", "int32")),
        ("u4", ("uint", "uint32")),
        ("f4", ("float", "float32")),
        ("f8", ("double", "float64")),
    )
    for name in names
}

CORNERS: Final = ("vertex_indices", "vertex_index")
MOST_PROPERTIES: Final = 100
LONGEST_LIST: Final = 100


@dataclass(frozen=True)
class Property:
    """name; NumPy type of its numbers; that of a list's length, "" for a plain number."""

    name: str
    type: str
    length_type: str = ""


@dataclass
class Element:
    """Rows of one kind."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass
class Header:
    """order: "" for text. start: byte at which the rows begin."""

    order: str
    elements: list[Element]
    comments: list[str]
    start: int


def read_cloud(source: Source) -> ContactCloud:
    """The vertices, with counts, grasp and taxel, and what felt nothing, where they are there; faces are not read."""
    header = read_header(source)
    silent = any(element.name == SILENT and element.count for element in header.elements)
    found = _elements(source, header, ("vertex", SILENT) if silent else ("vertex",))
    names = names_of(source, header.comments)
    cloud = cloud_of_columns(source, found["vertex"], names)
    return with_silent(source, cloud, found[SILENT]) if silent and names is not None else cloud


def read_mesh(source: Source) -> tuple[FloatArray, IntArray]:
    """Vertices f64[v, 3] and triangles i64[f, 3]."""
    header = read_header(source)
    found = _elements(source, header, ("vertex", "face"))
    corners = next((found["face"][name] for name in CORNERS if name in found["face"]), None)
    if corners is None or corners.ndim != 2 or corners.shape[1] != 3:
        source.fail("face", f"triangles as a list {CORNERS[0]}", "others", "export triangles")
    return places(source, found["vertex"]), whole(corners, source, "face")


def has_faces(source: Source) -> bool:
    """Whether there are faces."""
    return any(element.name == "face" and element.count for element in read_header(source).elements)


def cloud_bytes(cloud: ContactCloud) -> bytes:
    """As text: x, y, z, and counts, grasp, taxel where they are known; then what felt nothing."""
    names, table = extra_columns(cloud)
    silent = silent_columns(cloud)
    kinds = {"grasp": "int", "taxel": "int"}
    header = [
        "ply",
        "format ascii 1.0",
        *(f"comment {line}" for line in comments_of(cloud)),
        f"element vertex {len(cloud)}",
        *(f"property {kinds.get(name, 'double')} {name}" for name in names),
    ]
    if len(silent):
        header += [f"element {SILENT} {len(silent)}", *(f"property double {axis}" for axis in "xyz")]
        header.append("property int grasp")
    return ("\n".join([*header, "end_header"]) + "\n" + lines_of(table) + lines_of(silent)).encode()


def mesh_bytes(mesh: TriangleMesh) -> bytes:
    """As text."""
    header = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(mesh.faces)}",
        f"property list uchar int {CORNERS[0]}",
        "end_header",
    ]
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in mesh.faces.tolist())
    return ("\n".join(header) + "\n" + lines_of(mesh.vertices) + faces).encode()


def read_header(source: Source) -> Header:
    """What stands before the numbers. Fails for anything that is not a PLY header, or promises more than the file."""
    header = Header("", [], [], 0)
    words = ["ply"]
    while words != ["end_header"]:
        end = source.data.find(b"\n", header.start, LONGEST_HEADER)
        if end < 0:
            source.fail("header", "lines from ply to end_header", "no end", "use a PLY file")
        line = source.data[header.start : end].decode("latin-1").strip()
        words = line.split()
        if header.start == 0 and words != ["ply"]:
            source.fail("header", "ply in the first line", shown(line), "use a PLY file")
        header.start = end + 1
        _take(source, header, words, line)
    if not header.elements:
        source.fail("header", "an element vertex", "none", "use a file of points")
    return header


def _take(source: Source, header: Header, words: list[str], line: str) -> None:
    """One line of the header."""
    match words:
        case ["ply" | "end_header"] | ["obj_info", *_] | []:
            pass
        case ["comment", *_]:
            header.comments.append(line.partition(" ")[2].strip())
        case ["format", order, "1.0"] if order in ORDERS:
            header.order = ORDERS[order]
        case ["element", name, count] if (rows := natural(count)) is not None and rows <= len(source.data):
            header.elements.append(Element(name, rows))
        case ["property", "list", length, kind, name] if header.elements and {length, kind} <= set(TYPES):
            _add(source, header, Property(name, TYPES[kind], TYPES[length]), line)
        case ["property", kind, name] if header.elements and kind in TYPES:
            _add(source, header, Property(name, TYPES[kind]), line)
        case _:
            source.fail("header", "a line of a PLY header", shown(line), "correct it")


def _add(source: Source, header: Header, found: Property, line: str) -> None:
    properties = header.elements[-1].properties
    if len(properties) >= MOST_PROPERTIES or found.name in (one.name for one in properties):
        source.fail("header", f"at most {MOST_PROPERTIES} properties of different names", shown(line), "correct it")
    properties.append(found)


def _elements(source: Source, header: Header, wanted: tuple[str, ...]) -> dict[str, Rows]:
    """The numbers of the wanted elements, by element and property; a list's are f64[rows, length]."""
    read = _binary(source, header) if header.order else _text(source, header)
    found: dict[str, Rows] = {}
    for element in header.elements:
        if set(wanted) <= set(found):
            break
        if not element.properties:
            source.fail(element.name, "properties", "none", "correct the header")
        found[element.name] = read(element) if element.count else {one.name: np.empty(0) for one in element.properties}
    missing = [name for name in wanted if name not in found]
    if missing:
        source.fail(missing[0], "an element of that name", "none", "use another file")
    return found


def _text(source: Source, header: Header) -> Callable[[Element], Rows]:
    numbers = source.numbers(source.data[header.start :].decode("latin-1"), "rows")
    at = 0

    def read(element: Element) -> Rows:
        nonlocal at
        columns: list[tuple[Property, int]] = []
        width = 0
        for one in element.properties:
            length = _length(source, element, numbers[at + width : at + width + 1]) if one.length_type else 1
            width += 1 if one.length_type else 0
            columns.append((one, length))
            width += length
        size = element.count * width
        if at + size > len(numbers):
            source.fail(element.name, f"{size} numbers", str(len(numbers) - at), "use the whole file")
        rows = numbers[at : at + size].reshape(element.count, width)
        at += size
        return _split(source, element, columns, rows)

    return read


def _split(source: Source, element: Element, columns: list[tuple[Property, int]], rows: FloatArray) -> Rows:
    found: Rows = {}
    start = 0
    for one, length in columns:
        if one.length_type:
            _check_lengths(source, element, rows[:, start], length)
            start += 1
        found[one.name] = rows[:, start : start + length] if one.length_type else rows[:, start]
        start += length
    return found


def _binary(source: Source, header: Header) -> Callable[[Element], Rows]:
    at = header.start

    def read(element: Element) -> Rows:
        nonlocal at
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        offset = at
        for one in element.properties:
            if one.length_type:
                kind = np.dtype(header.order + one.length_type)
                there = source.data[offset : offset + kind.itemsize]
                first = np.frombuffer(there, kind) if len(there) == kind.itemsize else np.zeros(0)
                length = _length(source, element, first.astype(np.float64))
                fields.append((f"{one.name} length", kind.str))
                fields.append((one.name, header.order + one.type, (length,)))
            else:
                fields.append((one.name, header.order + one.type))
            offset = at + np.dtype(fields).itemsize
        record = np.dtype(fields)
        size = element.count * record.itemsize
        if at + size > len(source.data):
            source.fail(element.name, f"{size} bytes", str(len(source.data) - at), "use the whole file")
        rows = np.frombuffer(source.data, record, element.count, at)
        at += size
        with np.errstate(invalid="ignore"):  # a signalling NaN; cloud and mesh refuse it
            found: Rows = {one.name: rows[one.name].astype(np.float64) for one in element.properties}
        for one in element.properties:
            if one.length_type:
                _check_lengths(source, element, rows[f"{one.name} length"], found[one.name].shape[1])
        return found

    return read


def _length(source: Source, element: Element, first: FloatArray) -> int:
    """Of all lists, by the first row's."""
    if not (len(first) and 1 <= first[0] <= LONGEST_LIST and first[0] == int(first[0])):
        found = shown(str(first[0])) if len(first) else "nothing"
        source.fail(element.name, f"lists of 1 to {LONGEST_LIST} numbers", found, "correct it")
    return int(first[0])


def _check_lengths(source: Source, element: Element, lengths: npt.NDArray[np.generic], expected: int) -> None:
    if not bool(np.all(lengths == expected)):
        source.fail(element.name, f"lists of {expected} numbers throughout", "others", "export triangles")
