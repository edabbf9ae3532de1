"""Libraries for registration and for distances to a mesh, measured on contact clouds (docs/cloud-libraries.md).

taxel grasp --source both --out out/campaign
pip install open3d trimesh rtree point-cloud-utils        into an environment of its own, with taxel
python tools/cloud/compare_libraries.py out/campaign/real.h5 out/campaign/sim.h5

Each library runs in a process of its own, on one thread. Those that are not installed are named and left out.
Alignment: the hand's clouds of all objects to 20,000 points on their meshes, and to the simulator's clouds, from the
object's frame. Distances: the hand's clouds to their meshes, and to a sphere of 3,968 triangles.
"""

from __future__ import annotations

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
from candidates import CANDIDATES, REFERENCE, Candidate, exact_distances
from scipy.spatial import cKDTree

from taxel.types import FloatArray

REPEATS = 5
LIMIT_S = 600.0
MEGABYTE = 2**20

NEEDED = ("h5py", "matplotlib", "mujoco", "numpy", "python-can", "rich", "scipy", "typer")
"""What taxel needs without any of the candidates, and has dependencies of its own."""


def prepared(real: str, sim: str, out: Path) -> None:
    """Write clouds and meshes, so that no candidate needs the rest of taxel."""
    from taxel.cloud.accumulate import accumulate
    from taxel.cloud.mesh import TriangleMesh
    from taxel.cloud.models import models
    from taxel.recording.grasp_dataset import GraspDataset

    arrays: dict[str, Any] = {}
    with GraspDataset(real) as hand, GraspDataset(sim) as model:
        for row, (name, item) in enumerate(hand.objects.items()):
            mesh = TriangleMesh(name, item.vertices, item.faces)
            arrays[f"points{row}"] = accumulate(hand, name).points
            arrays[f"sim{row}"] = accumulate(model, name).points
            arrays[f"samples{row}"] = mesh.sample(20_000)
            arrays[f"vertices{row}"], arrays[f"faces{row}"] = mesh.vertices, mesh.faces
    ball = models()["sphere"]
    arrays["ball_vertices"], arrays["ball_faces"] = ball.vertices, ball.faces
    np.savez(out, **arrays)


def measured(candidate: Candidate, data: Path) -> dict[str, Any]:
    """What one candidate does, in this process."""
    before = _peak_mb()
    begun = time.perf_counter()
    answers = candidate.load()
    align, measure, align_to_surface = answers.align, answers.measure, answers.align_to_surface
    told: dict[str, Any] = {"import_s": time.perf_counter() - begun}
    with np.load(data, allow_pickle=False) as arrays:
        given = {name: arrays[name] for name in arrays.files}
    rows = range(sum(name.startswith("points") for name in given))
    if align is not None:
        for what in ("samples", "sim"):
            moved = [_timed(partial(align, given[f"points{r}"], given[f"{what}{r}"])) for r in rows]
            told[what] = {"ms": _mean_ms(moved), "transforms": [one.tolist() for _, one in moved]}
    clouds = [given[f"points{r}"] for r in rows]
    if align_to_surface is not None:
        moved = [_timed(partial(align_to_surface, clouds[r], given[f"vertices{r}"], given[f"faces{r}"])) for r in rows]
        told["surface"] = {"ms": _mean_ms(moved), "transforms": [one.tolist() for _, one in moved]}
    if measure is not None:
        own = [_timed(partial(measure, clouds[r], given[f"vertices{r}"], given[f"faces{r}"])) for r in rows]
        ball = [_timed(partial(measure, one, given["ball_vertices"], given["ball_faces"]), 2) for one in clouds]
        distances = [distance.tolist() for _, distance in own]
        told["mesh"] = {"ms": _mean_ms(own), "ball_ms": _mean_ms(ball), "distances": distances}
    told["memory_mb"] = _peak_mb() - before
    return told


def _timed(run: Callable[[], FloatArray], repeats: int = REPEATS) -> tuple[float, FloatArray]:
    """Median processor seconds after one run to warm up, and the result. All threads count, other programs do not."""
    result = run()
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        result = run()
        seconds.append(time.process_time() - begun)
    return float(np.median(seconds)), result


def _mean_ms(runs: list[tuple[float, FloatArray]]) -> float:
    return 1e3 * float(np.mean([seconds for seconds, _ in runs]))


def judged(told: dict[str, dict[str, Any]], data: Path) -> None:
    """Put RMS and errors in the place of transforms and distances: all by the same exact distances."""
    with np.load(data, allow_pickle=False) as arrays:
        given = {name: arrays[name] for name in arrays.files}
    exact = [np.array(one) for one in told[REFERENCE]["mesh"]["distances"]]
    for one in told.values():
        for what in set(one) & {"samples", "sim", "surface"}:
            one[what]["rms_mm"] = []
            for row, transform in enumerate(np.array(one[what].pop("transforms"))):
                moved = given[f"points{row}"] @ transform[:3, :3].T + transform[:3, 3]
                if what == "sim":
                    distance = np.asarray(cKDTree(given[f"sim{row}"]).query(moved)[0])
                else:
                    distance = exact_distances(moved, given[f"vertices{row}"], given[f"faces{row}"])
                one[what]["rms_mm"].append(1e3 * float(np.sqrt(np.mean(distance**2))))
        if "mesh" in one:
            own = [np.array(rows) for rows in one["mesh"].pop("distances")]
            one["mesh"]["error_m"] = max(float(np.abs(a - b).max()) for a, b in zip(own, exact, strict=True))


def _peak_mb() -> float:
    """Largest resident memory so far; not that of the parent, which `getrusage` would tell."""
    status = Path("/proc/self/status").read_text()
    return int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) / 1024.0


def size_mb(package: str) -> tuple[float, float]:
    """Installed size of a distribution, and of all that it brings beyond what taxel needs without it."""
    brought = _closure(package).difference(*map(_closure, NEEDED))
    return _own_size(package), sum(_own_size(name) for name in brought)


def _closure(package: str) -> set[str]:
    found: set[str] = set()
    left = [package]
    while left:
        name = re.sub(r"[-_.]+", "-", left.pop()).lower()
        if name in found:
            continue
        try:
            requires = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # for another platform, or optional
        found.add(name)
        left += [re.split(r"[ ;<>=!~\[(]", one)[0] for one in requires if "extra ==" not in one]
    return found


def _own_size(package: str) -> float:
    files = metadata.files(package) or []
    paths = [Path(str(one.locate())) for one in files]
    return sum(path.stat().st_size for path in paths if path.is_file()) / MEGABYTE


def wheel(package: str) -> str:
    """Version and platform tag of an installed distribution."""
    text = metadata.distribution(package).read_text("WHEEL") or ""
    tags = re.findall(r"^Tag: (\S+)", text, re.MULTILINE)
    return f"{metadata.version(package)}, {tags[0] if tags else 'no wheel'}"


def main() -> int:
    """Measure every candidate and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.add_argument("--only", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        candidate = next(one for one in CANDIDATES if one.name == options.only)
        print(json.dumps(measured(candidate, Path(options.real))))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.npz"
        prepared(options.real, options.sim, data)
        told = {one.name: found for one in CANDIDATES if (found := _in_process(one, data)) is not None}
        judged(told, data)
    if options.json:
        print(json.dumps(told))
    else:
        show(told)
    return 0


def _in_process(candidate: Candidate, data: Path) -> dict[str, Any] | None:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, __file__, str(data), str(data), "--only", candidate.name]
    ran = subprocess.run(command, env={**os.environ, **threads}, capture_output=True, text=True, timeout=LIMIT_S)
    if ran.returncode != 0:
        last = (ran.stderr.strip().splitlines() or ["failed"])[-1]
        print(f"{candidate.name}: left out: {last}", file=sys.stderr)
        return None
    told: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
    if candidate.package:
        told["size_mb"], told["brings_mb"] = size_mb(candidate.package)
        told["wheel"] = wheel(candidate.package)
    return told


def show(told: dict[str, dict[str, Any]]) -> None:
    """Both tables as Markdown."""
    print("| library | to 20,000 points, ms | RMS mm | to a cloud, ms | RMS mm | to the surface, ms | RMS mm |")
    print("|---|---|---|---|---|---|---|")
    for name, one in told.items():
        if "sim" in one:
            cells = [
                f"{one[what]['ms']:.1f} | {', '.join(f'{v:.4f}' for v in one[what]['rms_mm'])}"
                if what in one
                else " | "
                for what in ("samples", "sim", "surface")
            ]
            print(f"| {name} | {' | '.join(cells)} |")
    print("\n| library | own meshes, ms | sphere, ms | largest error |\n|---|---|---|---|")
    for name, one in told.items():
        if "mesh" in one:
            shown = "reference" if name == REFERENCE else f"{1e9 * one['mesh']['error_m']:.2g} nm"
            print(f"| {name} | {one['mesh']['ms']:.1f} | {one['mesh']['ball_ms']:.1f} | {shown} |")
    print("\n| library | installed, MB | with what it brings, MB | import, s | memory, MB | wheel |")
    print("|---|---|---|---|---|---|")
    for name, one in told.items():
        if "size_mb" in one:
            numbers = f"{one['size_mb']:.1f} | {one['brings_mb']:.1f} | {one['import_s']:.2f} | {one['memory_mb']:.0f}"
            print(f"| {name} | {numbers} | {one['wheel']} |")


if __name__ == "__main__":
    sys.exit(main())
