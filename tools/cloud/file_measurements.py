"""Measurements of one library for files: valid, malformed and randomly changed files, and the time for large files.

Every file is read in a forked process with limits of memory and time, so that a crash or an endless loop of a reader is
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


def check_valid_files(library: FileLibrary, samples: list[Sample], folder: Path) -> list[dict[str, str]]:
    """Read each valid sample file with a library: "correct", the parts that differ, or the error, by sample."""
    results = []
    for sample in samples:
        if (reader := library.readers.get(sample["kind"])) is not None:
            path = write_file(sample["content"].encode("latin-1"), sample["kind"], folder)
            outcome = run_with_limits(partial(_compare_with_expected, reader, path, sample))
            results.append({"name": sample["name"], "kind": sample["kind"], **outcome})
    return results


def check_malformed_files(library: FileLibrary, samples: list[Sample], folder: Path) -> list[dict[str, str]]:
    """Read each malformed sample file with a library: refused, accepted, or a limit of time or memory exceeded."""
    results = []
    for sample in samples:
        if (reader := library.readers.get(sample["kind"])) is not None:
            path = write_file(sample["content"].encode("latin-1"), sample["kind"], folder)
            outcome = run_with_limits(partial(_read_and_check, reader, path))
            results.append({"name": sample["name"], "kind": sample["kind"], **outcome})
    return results


def count_failures_on_changed_files(library: FileLibrary, samples: list[Sample], folder: Path) -> dict[str, int]:
    """Number of randomly changed files on which a reader crashes or exceeds a limit, by the kind of failure."""
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
    """The content with one to four random changes: a byte replaced, digits inserted, bytes deleted, the end removed."""
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
    """Run a file reader in a forked process with limits of memory and time. Returns its outcome and a message."""
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(receiver)
        _silence_standard_streams()
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_LIMIT, used + MEMORY_LIMIT))
        try:
            outcome = {"outcome": read(), "message": ""}
        except MemoryError as error:
            outcome = {"outcome": OUT_OF_MEMORY, "message": f"MemoryError: {error}"}
        except BaseException as error:  # a reader may raise anything, also SystemExit
            outcome = {"outcome": REFUSED, "message": f"{type(error).__name__}: {error}"[:10_000]}
        os.write(sender, json.dumps(outcome).encode())
        os._exit(0)
    os.close(sender)
    is_ready = bool(select.select([receiver], [], [], TIME_LIMIT_S)[0])
    answer = os.read(receiver, 65_536) if is_ready else b""
    if not answer:
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(receiver)
    if not answer:
        return {"outcome": CRASH if is_ready else TIME_LIMIT, "message": ""}
    result: dict[str, str] = json.loads(answer)
    return result


def write_file(content: bytes, kind: str, folder: Path) -> Path:
    """Write a sample file with the suffix of its format. kind: format. Returns the path."""
    path = folder / f"sample.{kind.split()[0]}"
    path.write_bytes(content)
    return path


def measure_speed(library: FileLibrary, folder: Path) -> dict[str, float]:
    """Median processor time in milliseconds of reading the same large files and of writing each format."""
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
    """Columns x, y, z and counts of `POINTS` random points."""
    rng = np.random.default_rng(1)
    table: Table = {name: rng.uniform(-0.1, 0.1, POINTS) for name in "xyz"}
    table["counts"] = rng.uniform(150.0, 400.0, POINTS)
    return table


def build_large_mesh() -> tuple[FloatArray, IntArray]:
    """A sphere of 99,904 triangles: vertices f64[v, 3], faces i64[f, 3]."""
    rings, around = 224, 224
    polar = np.pi * np.arange(1, rings) / rings
    angle = 2.0 * np.pi * np.arange(around) / around
    x, y = (np.sin(polar)[:, None] * function(angle) for function in (np.cos, np.sin))
    z = np.repeat(np.cos(polar)[:, None], around, axis=1)
    grid = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([grid, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    here, ahead = np.arange(around), (np.arange(around) + 1) % around
    last = around * (rings - 2)
    north, south = np.full(around, len(grid)), np.full(around, len(grid) + 1)
    faces = [(north, here, ahead), (here + last, south, ahead + last)]
    for low in range(0, last, around):
        high = low + around
        faces += [(here + low, here + high, ahead + high), (here + low, ahead + high, ahead + low)]
    return 0.05 * vertices, np.concatenate([np.stack(part, axis=1) for part in faces])


def write_large_files(table: Table, vertices: FloatArray, faces: IntArray, folder: Path) -> dict[str, tuple[str, Path]]:
    """Write the large point cloud and mesh in every format, to measure the speed of readers. Returns paths by
    format and name.
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
    """Read a sample file and compare the result. Returns the names of missing or different parts, or `CORRECT`."""
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
    """Read a file: `ACCEPTED`, or `REFUSED` if taxel could not use the result as a cloud or a mesh."""
    return ACCEPTED if _is_usable(reader(path)) else REFUSED


def _is_usable(contents: Contents) -> bool:
    """Whether file contents can be processed further: points are finite and not empty, and all indices are in range."""
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
    """Median processor time of `REPEATS` calls of a function, in ms."""
    seconds = []
    for _ in range(REPEATS):
        started = time.process_time()
        run()
        seconds.append(time.process_time() - started)
    return 1e3 * float(np.median(seconds))
