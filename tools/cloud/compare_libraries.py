"""Comparison of libraries for alignment and for distances to a mesh on contact clouds: docs/cloud-libraries.md.

taxel grasp --source both --out out/campaign
pip install open3d trimesh rtree point-cloud-utils        into an environment of its own, with taxel
python tools/cloud/compare_libraries.py out/campaign/real.h5 out/campaign/sim.h5

Each library runs in a process of its own, on one thread. A library that is not installed is named and left out.
Alignment: the real clouds of all objects to 20,000 points on their meshes and to the simulated clouds, starting in the
frame of the object. Distances: of the real clouds to their meshes and to a sphere of 3,968 triangles.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from candidates import CANDIDATES, REFERENCE, Candidate, compute_exact_distances
from scipy.spatial import cKDTree

from taxel.types import FloatArray

REPEATS = 5
TIME_LIMIT_S = 600.0
MEGABYTE = 2**20

REQUIRED = ("h5py", "matplotlib", "mujoco", "numpy", "python-can", "rich", "scipy", "typer")
"""Distributions with dependencies of their own that taxel requires in addition to the candidates."""


def write_inputs(real: str, sim: str, out: Path) -> None:
    """Write clouds and meshes to a file of arrays, so that the candidates need no dataset."""
    from taxel.cloud.accumulate import accumulate
    from taxel.cloud.mesh import TriangleMesh
    from taxel.cloud.models import get_builtin_models
    from taxel.recording.grasp_dataset import GraspDataset

    arrays: dict[str, Any] = {}
    with GraspDataset(real) as real_data, GraspDataset(sim) as sim_data:
        for row, (name, item) in enumerate(real_data.objects.items()):
            mesh = TriangleMesh(name, item.vertices, item.faces)
            arrays[f"points{row}"] = accumulate(real_data, name).points
            arrays[f"sim{row}"] = accumulate(sim_data, name).points
            arrays[f"samples{row}"] = mesh.sample(20_000)
            arrays[f"vertices{row}"], arrays[f"faces{row}"] = mesh.vertices, mesh.faces
    sphere = get_builtin_models()["sphere"]
    arrays["sphere_vertices"], arrays["sphere_faces"] = sphere.vertices, sphere.faces
    np.savez(out, **arrays)


def measure_candidate(candidate: Candidate, data: Path) -> dict[str, Any]:
    """Measure one candidate in this process: transforms, distances, times in ms and memory in MB.

    data: file of `write_inputs`. An operation that the candidate lacks has no entry in the result.
    """
    before = _read_peak_mb()
    started = time.perf_counter()
    operations = candidate.load()
    align, measure, align_to_surface = operations.align, operations.measure, operations.align_to_surface
    result: dict[str, Any] = {"import_s": time.perf_counter() - started}
    with np.load(data, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    rows = range(sum(name.startswith("points") for name in arrays))
    if align is not None:
        for what in ("samples", "sim"):
            runs = [_measure_time(partial(align, arrays[f"points{r}"], arrays[f"{what}{r}"])) for r in rows]
            result[what] = {"ms": _compute_mean_ms(runs), "transforms": [transform.tolist() for _, transform in runs]}
    clouds = [arrays[f"points{r}"] for r in rows]
    if align_to_surface is not None:
        runs = [
            _measure_time(partial(align_to_surface, clouds[r], arrays[f"vertices{r}"], arrays[f"faces{r}"]))
            for r in rows
        ]
        result["surface"] = {"ms": _compute_mean_ms(runs), "transforms": [transform.tolist() for _, transform in runs]}
    if measure is not None:
        to_mesh = [
            _measure_time(partial(measure, clouds[r], arrays[f"vertices{r}"], arrays[f"faces{r}"])) for r in rows
        ]
        to_sphere = [
            _measure_time(partial(measure, cloud, arrays["sphere_vertices"], arrays["sphere_faces"]), 2)
            for cloud in clouds
        ]
        distances = [distance.tolist() for _, distance in to_mesh]
        result["mesh"] = {
            "ms": _compute_mean_ms(to_mesh),
            "sphere_ms": _compute_mean_ms(to_sphere),
            "distances": distances,
        }
    result["memory_mb"] = _read_peak_mb() - before
    return result


def _measure_time(run: Callable[[], FloatArray], repeats: int = REPEATS) -> tuple[float, FloatArray]:
    """Run a function once to warm up, then `repeats` times.

    Returns the median processor time of all threads in s, and the result of the function.
    """
    result = run()
    seconds = []
    for _ in range(repeats):
        started = time.process_time()
        result = run()
        seconds.append(time.process_time() - started)
    return float(np.median(seconds)), result


def _compute_mean_ms(runs: list[tuple[float, FloatArray]]) -> float:
    """Return the mean time in ms of several (seconds, result) pairs."""
    return 1e3 * float(np.mean([seconds for seconds, _ in runs]))


def compute_errors(results: dict[str, dict[str, Any]], data: Path) -> None:
    """Replace the transforms and distances in `results` by their errors in comparison with the exact distances.

    results: results of `measure_candidate` by name of the library; changed in place. data: file of `write_inputs`. A
    transform becomes the RMS distance in mm after the alignment. Distances become their largest error in m.
    """
    with np.load(data, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    exact = [np.array(distances) for distances in results[REFERENCE]["mesh"]["distances"]]
    for result in results.values():
        for what in set(result) & {"samples", "sim", "surface"}:
            result[what]["rms_mm"] = []
            for row, transform in enumerate(np.array(result[what].pop("transforms"))):
                moved = arrays[f"points{row}"] @ transform[:3, :3].T + transform[:3, 3]
                if what == "sim":
                    distance = np.asarray(cKDTree(arrays[f"sim{row}"]).query(moved)[0])
                else:
                    distance = compute_exact_distances(moved, arrays[f"vertices{row}"], arrays[f"faces{row}"])
                result[what]["rms_mm"].append(1e3 * float(np.sqrt(np.mean(distance**2))))
        if "mesh" in result:
            measured = [np.array(distances) for distances in result["mesh"].pop("distances")]
            result["mesh"]["error_m"] = max(float(np.abs(a - b).max()) for a, b in zip(measured, exact, strict=True))


def _read_peak_mb() -> float:
    """Return the largest resident memory of this process so far, MB.

    `getrusage` would include the memory of the parent process.
    """
    status = Path("/proc/self/status").read_text()
    return int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) / 1024.0


def measure_size_mb(package: str) -> tuple[float, float]:
    """Measure the installed size of a distribution in MB: alone, and with its dependencies.

    Dependencies that taxel requires anyway are excluded.
    """
    added = _list_dependencies(package).difference(*map(_list_dependencies, REQUIRED))
    return _measure_own_size(package), sum(_measure_own_size(name) for name in added)


def _list_dependencies(package: str) -> set[str]:
    """List the names of a distribution and of all its installed dependencies, in lower case with hyphens."""
    names: set[str] = set()
    pending = [package]
    while pending:
        name = re.sub(r"[-_.]+", "-", pending.pop()).lower()
        if name in names:
            continue
        try:
            requires = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # a dependency of another platform or an optional one
        names.add(name)
        pending += [re.split(r"[ ;<>=!~\[(]", item)[0] for item in requires if "extra ==" not in item]
    return names


def _measure_own_size(package: str) -> float:
    """Measure the size in MB of the installed files of a Python package, without the packages that it requires."""
    files = metadata.files(package) or []
    paths = [Path(str(file.locate())) for file in files]
    return sum(path.stat().st_size for path in paths if path.is_file()) / MEGABYTE


def describe_wheel(package: str) -> str:
    """Return the version and the platform tag of an installed distribution."""
    text = metadata.distribution(package).read_text("WHEEL") or ""
    tags = re.findall(r"^Tag: (\S+)", text, re.MULTILINE)
    return f"{metadata.version(package)}, {tags[0] if tags else 'no wheel'}"


def main() -> int:
    """Measure every candidate and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.add_argument("--only", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        candidate = next(item for item in CANDIDATES if item.name == options.only)
        # In a process of `_measure_in_process`, the argument `real` is the file of `write_inputs`.
        print(json.dumps(measure_candidate(candidate, Path(options.real))))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.npz"
        write_inputs(options.real, options.sim, data)
        results = {item.name: result for item in CANDIDATES if (result := _measure_in_process(item, data)) is not None}
        compute_errors(results, data)
    if options.json:
        print(json.dumps(results))
    else:
        print_tables(results)
    return 0


def _measure_in_process(candidate: Candidate, data: Path) -> dict[str, Any] | None:
    """Measure one candidate in a process with one thread; None if the process fails.

    For a candidate that taxel does not need, the size and the wheel are added.
    """
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, __file__, str(data), str(data), "--only", candidate.name]
    run = subprocess.run(command, env={**os.environ, **threads}, capture_output=True, text=True, timeout=TIME_LIMIT_S)
    if run.returncode != 0:
        last_line = (run.stderr.strip().splitlines() or ["failed"])[-1]
        print(f"{candidate.name}: left out: {last_line}", file=sys.stderr)
        return None
    result: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    if candidate.package:
        result["size_mb"], result["size_with_dependencies_mb"] = measure_size_mb(candidate.package)
        result["wheel"] = describe_wheel(candidate.package)
    return result


def print_tables(results: dict[str, dict[str, Any]]) -> None:
    """Print the comparison of the libraries as three Markdown tables."""
    print("| library | to 20,000 points, ms | RMS mm | to a cloud, ms | RMS mm | to the surface, ms | RMS mm |")
    print("|---|---|---|---|---|---|---|")
    for name, result in results.items():
        if "sim" in result:
            cells = [
                f"{result[what]['ms']:.1f} | {', '.join(f'{v:.4f}' for v in result[what]['rms_mm'])}"
                if what in result
                else " | "
                for what in ("samples", "sim", "surface")
            ]
            print(f"| {name} | {' | '.join(cells)} |")
    print("\n| library | own meshes, ms | sphere, ms | largest error |\n|---|---|---|---|")
    for name, result in results.items():
        if "mesh" in result:
            error = "reference" if name == REFERENCE else f"{1e9 * result['mesh']['error_m']:.2g} nm"
            print(f"| {name} | {result['mesh']['ms']:.1f} | {result['mesh']['sphere_ms']:.1f} | {error} |")
    print("\n| library | installed, MB | with dependencies, MB | import, s | memory, MB | wheel |")
    print("|---|---|---|---|---|---|")
    for name, result in results.items():
        if "size_mb" in result:
            sizes = f"{result['size_mb']:.1f} | {result['size_with_dependencies_mb']:.1f}"
            numbers = f"{sizes} | {result['import_s']:.2f} | {result['memory_mb']:.0f}"
            print(f"| {name} | {numbers} | {result['wheel']} |")


if __name__ == "__main__":
    sys.exit(main())
