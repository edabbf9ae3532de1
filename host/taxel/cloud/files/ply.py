"""PLY: points or triangles, as text or as binary of either byte order."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.cloud_metadata import (
    SILENT,
    add_inactive_points,
    build_cloud,
    build_columns,
    build_silent_rows,
    format_comments,
    parse_comments,
    stack_points,
)
from taxel.cloud.files.source import MAX_HEADER_BYTES, Source, convert_to_integers, parse_natural, quote
from taxel.cloud.files.xyz import format_rows
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray

Columns = dict[str, FloatArray]
"""Values of an element by name of the property: f64[rows] for numbers, f64[rows, length] for lists."""

BYTE_ORDERS: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

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
"""NumPy types by the type names in a PLY header."""

INDEX_LISTS: Final = ("vertex_indices", "vertex_index")
"""Names of the property with the vertex numbers of a face."""

MAX_PROPERTIES: Final = 100
MAX_LIST_LENGTH: Final = 100


@dataclass(frozen=True)
class Property:
    """A property of an element. type: NumPy type. length_type: NumPy type of the length of a list, "" for a number."""

    name: str
    type: str
    length_type: str = ""


@dataclass
class Element:
    """An element of the header: `count` rows of the same properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass
class Header:
    """A PLY header. byte_order: "<", ">", or "" for text. start: offset of the rows in bytes."""

    byte_order: str
    elements: list[Element]
    comments: list[str]
    start: int


def read_cloud(source: Source) -> ContactCloud:
    """Read a contact cloud from a PLY file: its vertices, with counts, grasp, taxel and inactive taxels if present.

    Faces are ignored. Raises CloudFileError.
    """
    header = read_header(source)
    has_silent = any(element.name == SILENT and element.count for element in header.elements)
    elements = _read_elements(source, header, ("vertex", SILENT) if has_silent else ("vertex",))
    names = parse_comments(source, header.comments)
    cloud = build_cloud(source, elements["vertex"], names)
    return add_inactive_points(source, cloud, elements[SILENT]) if has_silent and names is not None else cloud


def read_mesh(source: Source) -> tuple[FloatArray, IntArray]:
    """Read vertices f64[v, 3] and triangles i64[f, 3] of a PLY file. Raises CloudFileError."""
    header = read_header(source)
    elements = _read_elements(source, header, ("vertex", "face"))
    corners = next((elements["face"][name] for name in INDEX_LISTS if name in elements["face"]), None)
    if corners is None or corners.ndim != 2 or corners.shape[1] != 3:
        source.fail("face", f"triangles as a list {INDEX_LISTS[0]}", "other properties", "export triangles")
    return stack_points(source, elements["vertex"]), convert_to_integers(corners, source, "face")


def has_faces(source: Source) -> bool:
    """Whether a PLY file contains faces."""
    return any(element.name == "face" and element.count for element in read_header(source).elements)


def encode_cloud(cloud: ContactCloud) -> bytes:
    """Encode a contact cloud as a PLY text file: x, y, z, and counts, grasp, taxel if known; then inactive taxels."""
    names, table = build_columns(cloud)
    silent = build_silent_rows(cloud)
    types = {"grasp": "int", "taxel": "int"}
    header = [
        "ply",
        "format ascii 1.0",
        *(f"comment {line}" for line in format_comments(cloud)),
        f"element vertex {len(cloud)}",
        *(f"property {types.get(name, 'double')} {name}" for name in names),
    ]
    if len(silent):
        header += [f"element {SILENT} {len(silent)}", *(f"property double {axis}" for axis in "xyz")]
        header.append("property int grasp")
    return ("\n".join([*header, "end_header"]) + "\n" + format_rows(table) + format_rows(silent)).encode()


def encode_mesh(mesh: TriangleMesh) -> bytes:
    """Encode a mesh as a PLY text file."""
    header = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(mesh.faces)}",
        f"property list uchar int {INDEX_LISTS[0]}",
        "end_header",
    ]
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in mesh.faces.tolist())
    return ("\n".join(header) + "\n" + format_rows(mesh.vertices) + faces).encode()


def read_header(source: Source) -> Header:
    """Read the header of a PLY file. Raises CloudFileError for a malformed header or counts that exceed the file."""
    header = Header("", [], [], 0)
    words = ["ply"]
    while words != ["end_header"]:
        end = source.data.find(b"\n", header.start, MAX_HEADER_BYTES)
        if end < 0:
            source.fail("header", "lines from ply to end_header", "no end_header", "use a PLY file")
        line = source.data[header.start : end].decode("latin-1").strip()
        words = line.split()
        if header.start == 0 and words != ["ply"]:
            source.fail("header", "ply in the first line", quote(line), "use a PLY file")
        header.start = end + 1
        _parse_header_line(source, header, words, line)
    if not header.elements:
        source.fail("header", "an element vertex", "no element", "use a file of points")
    return header


def _parse_header_line(source: Source, header: Header, words: list[str], line: str) -> None:
    """Add one line of a PLY header to `header`. words: of the line. Raises CloudFileError for an unknown line."""
    match words:
        case ["ply" | "end_header"] | ["obj_info", *_] | []:
            pass
        case ["comment", *_]:
            header.comments.append(line.partition(" ")[2].strip())
        case ["format", order, "1.0"] if order in BYTE_ORDERS:
            header.byte_order = BYTE_ORDERS[order]
        case ["element", name, count] if (rows := parse_natural(count)) is not None:
            if rows > len(source.data):
                source.fail(
                    "header", f"at most {len(source.data)} rows, the size of the file", quote(line), "correct it"
                )
            header.elements.append(Element(name, rows))
        case ["property", "list", length, kind, name] if header.elements and {length, kind} <= set(TYPES):
            _add_property(source, header, Property(name, TYPES[kind], TYPES[length]), line)
        case ["property", kind, name] if header.elements and kind in TYPES:
            _add_property(source, header, Property(name, TYPES[kind]), line)
        case _:
            source.fail("header", "a line of a PLY header", quote(line), "correct it")


def _add_property(source: Source, header: Header, added: Property, line: str) -> None:
    """Add a property to the last element of a PLY header. Raises CloudFileError for too many or equal names.

    line: for the message.
    """
    properties = header.elements[-1].properties
    if len(properties) >= MAX_PROPERTIES or added.name in (item.name for item in properties):
        source.fail("header", f"at most {MAX_PROPERTIES} properties of different names", quote(line), "correct it")
    properties.append(added)


def _read_elements(source: Source, header: Header, names: tuple[str, ...]) -> dict[str, Columns]:
    """Read the elements of a PLY file up to the last of the named elements; return the values by element and property.

    Raises CloudFileError if a named element is missing.
    """
    read = _binary_reader(source, header) if header.byte_order else _text_reader(source, header)
    values: dict[str, Columns] = {}
    for element in header.elements:
        if set(names) <= set(values):
            break
        if not element.properties:
            source.fail(element.name, "properties", "none", "correct the header")
        empty: Columns = {item.name: np.empty(0) for item in element.properties}
        values[element.name] = read(element) if element.count else empty
    missing = [name for name in names if name not in values]
    if missing:
        source.fail(missing[0], "an element of that name", "none", "use another file")
    return values


def _text_reader(source: Source, header: Header) -> Callable[[Element], Columns]:
    """Make a function that reads the next element of a PLY text file."""
    numbers = source.parse_numbers(source.data[header.start :].decode("latin-1"), "rows")
    position = 0

    def read(element: Element) -> Columns:
        """Read the rows of an element, such as the vertices, from the next numbers of the file. Raises CloudFileError.

        All lists of a property must have the length of the list in the first row.
        """
        nonlocal position
        widths: list[tuple[Property, int]] = []
        width = 0
        for item in element.properties:
            first = numbers[position + width : position + width + 1]
            length = _check_list_length(source, element, first) if item.length_type else 1
            width += 1 if item.length_type else 0
            widths.append((item, length))
            width += length
        size = element.count * width
        if position + size > len(numbers):
            source.fail(element.name, f"{size} numbers", str(len(numbers) - position), "use the whole file")
        rows = numbers[position : position + size].reshape(element.count, width)
        position += size
        return _split_columns(source, element, widths, rows)

    return read


def _split_columns(source: Source, element: Element, widths: list[tuple[Property, int]], rows: FloatArray) -> Columns:
    """Split the rows of a PLY element into the columns of its properties.

    widths: number of columns of each property. rows: f64[r, columns].
    """
    columns: Columns = {}
    start = 0
    for item, length in widths:
        if item.length_type:
            _check_equal_lengths(source, element, rows[:, start], length)
            start += 1
        columns[item.name] = rows[:, start : start + length] if item.length_type else rows[:, start]
        start += length
    return columns


def _binary_reader(source: Source, header: Header) -> Callable[[Element], Columns]:
    """Make a function that reads the next element of a binary PLY file."""
    position = header.start

    def read(element: Element) -> Columns:
        """Read the rows of an element, such as the vertices, from the next bytes of the file. Raises CloudFileError.

        All lists of a property must have the length of the list in the first row.
        """
        nonlocal position
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        offset = position
        for item in element.properties:
            if item.length_type:
                kind = np.dtype(header.byte_order + item.length_type)
                length_bytes = source.data[offset : offset + kind.itemsize]
                first = np.frombuffer(length_bytes, kind) if len(length_bytes) == kind.itemsize else np.zeros(0)
                length = _check_list_length(source, element, first.astype(np.float64))
                fields.append((f"{item.name} length", kind.str))
                fields.append((item.name, header.byte_order + item.type, (length,)))
            else:
                fields.append((item.name, header.byte_order + item.type))
            offset = position + np.dtype(fields).itemsize
        record = np.dtype(fields)
        size = element.count * record.itemsize
        if position + size > len(source.data):
            source.fail(element.name, f"{size} bytes", str(len(source.data) - position), "use the whole file")
        rows = np.frombuffer(source.data, record, element.count, position)
        position += size
        with np.errstate(invalid="ignore"):  # a signalling NaN: the checks of cloud and mesh refuse it
            columns: Columns = {item.name: rows[item.name].astype(np.float64) for item in element.properties}
        for item in element.properties:
            if item.length_type:
                _check_equal_lengths(source, element, rows[f"{item.name} length"], columns[item.name].shape[1])
        return columns

    return read


def _check_list_length(source: Source, element: Element, first: FloatArray) -> int:
    """Return the length of the list in the first row of a PLY element, which all rows must have.

    first: the length as read, f64[1]; f64[0] if the file ends before it. Raises CloudFileError.
    """
    if not (len(first) and 1 <= first[0] <= MAX_LIST_LENGTH and first[0] == int(first[0])):
        found = quote(str(first[0])) if len(first) else "nothing"
        source.fail(element.name, f"lists of 1 to {MAX_LIST_LENGTH} numbers", found, "correct it")
    return int(first[0])


def _check_equal_lengths(source: Source, element: Element, lengths: npt.NDArray[np.generic], expected: int) -> None:
    """Raise CloudFileError unless the lists of all rows of a PLY element have the `expected` length."""
    if not bool(np.all(lengths == expected)):
        source.fail(element.name, f"lists of {expected} numbers in all rows", "other lengths", "export triangles")
