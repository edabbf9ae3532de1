"""Measurements of how one library reads valid, malformed and randomly changed files, and how fast it reads large files.

Every file is read in a forked process with memory and time limits, so that a crash or an endless loop of a reader is
a result and not the end of the comparison.
"""

import json
import os
import resource
import select
import signal
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from file_libraries import Contents, FileLibrary, Reader, Table

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import CLOUD_WRITERS, MESH_WRITERS
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray

Sample = dict[str, Any]
"""An entry of host/tests/cloud/file_samples.toml."""

MEMORY_LIMIT: Final = 2**30
"""Bytes that a reader may use in addition to the memory of the process that starts it."""

TIME_LIMIT_S: Final = 2.0
POINTS: Final = 100_000
REPEATS: Final = 5
CHANGED_FILES: Final = 200
"""Randomly changed files for each format."""

PARTS: Final = {"points", "counts", "grasps", "grasp", "taxel", "silent", "corners"}
CORRECT, REFUSED, ACCEPTED = "correct", "refused", "accepted"
CRASH, TIME_LIMIT, OUT_OF_MEMORY = "crash", "time limit", "memory limit"
"""Outcomes of reading a file: the content equals the expected content; the reader raises an exception or its result is
not usable; the result is usable; the process ends without an answer; a limit is exceeded.
"""


def check_valid_files(library: FileLibrary, samples: list[Sample], folder: Path) -> list[dict[str, str]]:
    """Read each valid sample file with a library and compare the content with the expected content.

    Returns one dictionary per sample whose format the library reads: name and kind (format) of the sample, `outcome`
    (`CORRECT`, the deviating parts as in "no counts, other points", or a failure) and `message` (error text or "").
    """
    results = []
    for sample in samples:
        if (reader := library.readers.get(sample["kind"])) is not None:
            path = write_file(sample["content"].encode("latin-1"), sample["kind"], folder)
            outcome = run_with_limits(partial(_compare_with_expected, reader, path, sample))
            results.append({"name": sample["name"], "kind": sample["kind"], **outcome})
    return results


def check_malformed_files(library: FileLibrary, samples: list[Sample], folder: Path) -> list[dict[str, str]]:
    """Read each malformed sample file with a library.

    Returns one dictionary per sample whose format the library reads: name and kind (format) of the sample, `outcome`
    (`REFUSED`, `ACCEPTED`, `CRASH`, `TIME_LIMIT` or `OUT_OF_MEMORY`) and `message` (error text or "").
    """
    results = []
    for sample in samples:
        if (reader := library.readers.get(sample["kind"])) is not None:
            path = write_file(sample["content"].encode("latin-1"), sample["kind"], folder)
            outcome = run_with_limits(partial(_read_and_check, reader, path))
            results.append({"name": sample["name"], "kind": sample["kind"], **outcome})
    return results


def count_failures_on_changed_files(library: FileLibrary, samples: list[Sample], folder: Path) -> dict[str, int]:
    """Count the randomly changed files on which a reader crashes or exceeds a limit.

    Returns the number of all files under the key "files", and the number of files for each failure that occurred
    (`CRASH`, `TIME_LIMIT`, `OUT_OF_MEMORY`).
    """
    counts: Counter[str] = Counter()
    for kind, reader in library.readers.items():
        contents = [sample["content"].encode("latin-1") for sample in samples if sample["kind"] == kind]
        for seed in range(CHANGED_FILES):
            path = write_file(change_randomly(contents[seed % len(contents)], seed), kind, folder)
            outcome = run_with_limits(partial(_read_and_check, reader, path))["outcome"]
            counts["files"] += 1
            counts[outcome] += outcome in (CRASH, TIME_LIMIT, OUT_OF_MEMORY)
    return {name: count for name, count in counts.items() if count}


def change_randomly(content: bytes, seed: int) -> bytes:
    """Return a file's content with one to four random changes.

    Each change replaces a byte, inserts digits, deletes up to 19 bytes, or removes everything behind a position. An
    empty result becomes b"x".
    """
    rng = np.random.default_rng(seed)
    data = bytearray(content)
    for _ in range(rng.integers(1, 5)):
        position, kind = int(rng.integers(len(data) or 1)), rng.random()
        if kind < 0.5 and data:
            data[position] = int(rng.integers(256))
        elif kind < 0.65:
            del data[position:]
        elif kind < 0.85:
            data[position:position] = bytes(rng.choice(list(b"0123456789 \n.-e"), size=rng.integers(1, 12)).tolist())
        else:
            del data[position : position + int(rng.integers(1, 20))]
    return bytes(data) or b"x"


def run_with_limits(read: Callable[[], str]) -> dict[str, str]:
    """Run a file reader in a forked process with memory and time limits.

    read: reads a file and returns an outcome (`CORRECT`, `ACCEPTED` or `REFUSED`). Returns {"outcome": ..., "message":
    ...}: the outcome of `read` without a message; `REFUSED` or `OUT_OF_MEMORY` with the text of the exception that
    `read` raised; or `CRASH` or `TIME_LIMIT` without a message.
    """
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(receiver)
            _send_outcome(read, sender)
        finally:
            os._exit(0)  # also after an error, because this copy of the comparison must never continue
    os.close(sender)
    is_ready = bool(select.select([receiver], [], [], TIME_LIMIT_S)[0])
    with os.fdopen(receiver, "rb") as answers:
        answer = answers.read() if is_ready else b""  # until the process ends, because a pipe may split the answer
    if not answer:
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    if not answer:
        return {"outcome": CRASH if is_ready else TIME_LIMIT, "message": ""}
    result: dict[str, str] = json.loads(answer)
    return result


def _send_outcome(read: Callable[[], str], sender: int) -> None:
    """Run a file reader in this process under the memory limit, and write its outcome as JSON to the pipe `sender`."""
    _silence_standard_streams()
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_LIMIT, used + MEMORY_LIMIT))
    try:
        outcome = {"outcome": read(), "message": ""}
    except MemoryError as error:
        outcome = {"outcome": OUT_OF_MEMORY, "message": f"MemoryError: {error}"}
    except BaseException as error:  # a reader may raise anything, also SystemExit
        outcome = {"outcome": REFUSED, "message": f"{type(error).__name__}: {error}"[:10_000]}
    with os.fdopen(sender, "wb") as answers:
        answers.write(json.dumps(outcome).encode())


def write_file(content: bytes, kind: str, folder: Path) -> Path:
    """Write a sample file into a folder and return its path.

    kind: format, such as "ply" or "ply mesh"; its first word becomes the suffix.
    """
    path = folder / f"sample.{kind.split()[0]}"
    path.write_bytes(content)
    return path


def measure_speed(library: FileLibrary, folder: Path) -> dict[str, float]:
    """Measure the median processor time for reading the large files and for writing each format.

    Returns milliseconds by task, such as "read ply, binary" or "write ply", for the formats that the library supports.
    """
    table, vertices, faces = build_large_cloud(), *build_large_mesh()
    times: dict[str, float] = {}
    for name, (kind, path) in write_large_files(table, vertices, faces, folder).items():
        if kind in library.readers:
            times[f"read {name}"] = _measure_median_ms(partial(library.readers[kind], path))
    for kind, write_cloud in library.cloud_writers.items():
        times[f"write {kind}"] = _measure_median_ms(partial(write_cloud, folder / f"written.{kind}", table))
    for kind, write_mesh in library.mesh_writers.items():
        path = folder / f"written.{kind.split()[0]}"
        times[f"write {kind}"] = _measure_median_ms(partial(write_mesh, path, vertices, faces))
    return times


def build_large_cloud() -> Table:
    """Return `POINTS` random points: columns "x", "y", "z" in m, and "counts"."""
    rng = np.random.default_rng(1)
    table: Table = {name: rng.uniform(-0.1, 0.1, POINTS) for name in "xyz"}
    table["counts"] = rng.uniform(150.0, 400.0, POINTS)
    return table


def build_large_mesh() -> tuple[FloatArray, IntArray]:
    """Build a sphere of 99,904 triangles: vertices f64[v, 3] in m, vertex indices of the faces i64[f, 3].

    The sphere consists of two poles and of rings of vertices at equal polar angles.
    """
    rings, around = 224, 224
    polar = np.pi * np.arange(1, rings) / rings
    angle = 2.0 * np.pi * np.arange(around) / around
    x, y = (np.sin(polar)[:, None] * function(angle) for function in (np.cos, np.sin))
    z = np.repeat(np.cos(polar)[:, None], around, axis=1)
    grid = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([grid, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    here, ahead = np.arange(around), (np.arange(around) + 1) % around
    last = around * (rings - 2)  # index of the first vertex of the ring at the south pole
    north, south = np.full(around, len(grid)), np.full(around, len(grid) + 1)
    faces = [(north, here, ahead), (here + last, south, ahead + last)]
    for low in range(0, last, around):
        high = low + around
        faces += [(here + low, here + high, ahead + high), (here + low, ahead + high, ahead + low)]
    return 0.05 * vertices, np.concatenate([np.stack(part, axis=1) for part in faces])


def write_large_files(table: Table, vertices: FloatArray, faces: IntArray, folder: Path) -> dict[str, tuple[str, Path]]:
    """Write a large point cloud and a large mesh in every format, to measure the speed of readers.

    table: columns of the cloud by name. vertices f64[v, 3], faces i64[f, 3]: the mesh. Returns (key of the reader,
    path of the file) by the name of the file format, such as "ply, binary".
    """
    cloud = ContactCloud.from_points(np.column_stack([table[axis] for axis in "xyz"]), table["counts"])
    mesh = TriangleMesh("mesh", vertices, faces)
    rows = np.column_stack(list(table.values())).astype("<f8").tobytes()
    properties = "".join(f"property double {name}\n" for name in table)
    ply = f"ply\nformat binary_little_endian 1.0\nelement vertex {POINTS}\n{properties}end_header\n"
    pcd = (
        f"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {' '.join(table)}\nSIZE 8 8 8 8\n"
        f"TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {POINTS}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {POINTS}\nDATA binary\n"
    )
    contents = {
        "ply, text": ("ply", CLOUD_WRITERS[".ply"](cloud)),
        "ply, binary": ("ply", ply.encode() + rows),
        "ply mesh, text": ("ply mesh", MESH_WRITERS[".ply"](mesh)),
        "pcd, text": ("pcd", CLOUD_WRITERS[".pcd"](cloud)),
        "pcd, binary": ("pcd", pcd.encode() + rows),
        "xyz": ("xyz", CLOUD_WRITERS[".xyz"](cloud)),
        "stl, binary": ("stl", MESH_WRITERS[".stl"](mesh)),
        "obj": ("obj", MESH_WRITERS[".obj"](mesh)),
    }
    files = {}
    for number, (name, (kind, content)) in enumerate(contents.items()):
        path = folder / f"large{number}.{kind.split()[0]}"
        path.write_bytes(content)
        files[name] = (kind, path)
    return files


def _compare_with_expected(reader: Reader, path: Path, sample: Sample) -> str:
    """Read a sample file and compare it with the expected parts of the sample.

    Returns `CORRECT`, or the missing ("no counts") and different ("other points") parts, separated by commas.
    """
    contents = reader(path)
    deviations = []
    for part in PARTS & sample.keys():
        value = getattr(contents, part)
        if value is None:
            deviations.append(f"no {part}")
        elif part == "grasps":
            deviations += ["other grasps"] * (value != sample["grasps"])
        elif not np.array_equal(value, np.array(sample[part], value.dtype)):
            deviations.append(f"other {part}")
    return ", ".join(sorted(deviations)) or CORRECT


def _read_and_check(reader: Reader, path: Path) -> str:
    """Read a file; return `ACCEPTED`, or `REFUSED` if taxel could not use the result as a cloud or a mesh."""
    return ACCEPTED if _is_usable(reader(path)) else REFUSED


def _is_usable(contents: Contents) -> bool:
    """Return whether file contents can be processed further.

    The points or vertices must exist and be finite, faces must be triangles, and indices must be in range.
    """
    values = contents.points if contents.vertices is None else contents.vertices
    if values is None or not len(values) or not np.isfinite(values).all():
        return False
    faces = contents.faces
    if faces is not None:
        return faces.shape[1:] == (3,) and len(faces) > 0 and faces.min() >= 0 and faces.max() < len(values)
    grasp, grasps = contents.grasp, contents.grasps
    return grasp is None or grasps is None or grasp.max() < len(grasps)


def _silence_standard_streams() -> None:
    """Redirect standard output and standard error of this process, including C libraries, to the null device."""
    with open(os.devnull, "w") as null:
        os.dup2(null.fileno(), 1)
        os.dup2(null.fileno(), 2)


def _measure_median_ms(run: Callable[[], object]) -> float:
    """Return the median processor time of `REPEATS` calls of a function, in ms."""
    seconds = []
    for _ in range(REPEATS):
        started = time.process_time()
        run()
        seconds.append(time.process_time() - started)
    return 1e3 * float(np.median(seconds))
