"""`taxel import`: datasets from what other programs recorded."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from taxel.errors import TaxelError
from taxel.grasp.calibration import load_calibration
from taxel.hand import load_hand
from taxel.hand.errors import format_value
from taxel.hand.transforms import make_pose
from taxel.recording.from_arrays import write_from_arrays
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.csv_table import Progress as Tell
from taxel.sim.importers.csv_table import silent
from taxel.sim.importers.gazebo_csv import import_contacts
from taxel.sim.importers.mujoco_rollout import import_rollout
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.rollout_names import load_map
from taxel.sim.sensing import LEVELS, Sensing
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

__all__ = ["import_app"]

_WRIST_NUMBERS = 7

import_app = typer.Typer(
    help="Make grasp datasets from Gazebo's contacts, MuJoCo rollouts or plain arrays.", no_args_is_help=True
)

Out = Annotated[Path, typer.Option(help="The dataset to write.")]
Joints = Annotated[Path | None, typer.Option(help="CSV: grasp, time and the joint angles, radians.")]
Poses = Annotated[Path | None, typer.Option(help="CSV instead of --joints: grasp, time, link, x ... qz.")]
Calibration = Annotated[Path | None, typer.Option(help="Poses of the objects in the world (TOML).")]
Wrist = Annotated[str, typer.Option(help="The palm's pose in the world, x,y,z,qw,qx,qy,qz, for 16 joints.")]
Baseline = Annotated[
    int | None, typer.Option(min=1, help="Add frames without contact before grasps that have fewer of phase 0.")
]
Hand = Annotated[str, typer.Option(help="Packaged hand or description file.")]
Seed = Annotated[int, typer.Option(min=0, help="Decides the noise.")]
Noise = Annotated[float | None, typer.Option(help="Standard deviation of the counts' noise; none: the simulator's.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print what was imported as JSON.")]


@import_app.command()
def arrays(
    data: Annotated[Path, typer.Argument(help="An .npz file; names as in taxel.recording.from_arrays.")],
    out: Out,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Write plain NumPy arrays as a dataset.

    Example: taxel import arrays data.npz --out data.h5
    """
    write_from_arrays(out, data, overwrite=overwrite)
    with GraspDataset(out) as written:
        report = ImportReport(grasps=len(written.ids), frames=sum(grasp.n_frames for grasp in written))
    _say(report, out, as_json)


@import_app.command()
def gazebo(
    contacts: Annotated[Path, typer.Argument(help="CSV of contact points in the world.")],
    out: Out,
    joints: Joints = None,
    poses: Poses = None,
    threshold_mm: Annotated[
        float | None, typer.Option(help="From a contact to the taxels that feel it; none: 2.35 for 3 mm taxels.")
    ] = None,
    calibration: Calibration = None,
    wrist: Wrist = "",
    baseline_frames: Baseline = None,
    hand: Hand = "allegro",
    seed: Seed = 1,
    noise: Noise = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Contact points that Gazebo reported, by the thesis's distance threshold.

    Example: taxel import gazebo contacts.csv --joints joints.csv --out sim.h5 --baseline-frames 100
    """
    _one_of(joints, poses)
    if threshold_mm is not None and not (np.isfinite(threshold_mm) and threshold_mm > 0):
        raise TaxelError(f"--threshold-mm: expected a number above 0, found {threshold_mm:g}; the thesis's is 2.35")
    threshold = None if threshold_mm is None else threshold_mm * 1e-3
    with _bar(as_json) as tell:
        options = _options(calibration, wrist, baseline_frames, hand, seed, noise, overwrite, tell)
        report = import_contacts(contacts, out, joints=joints, poses=poses, threshold_m=threshold, options=options)
    _say(report, out, as_json)


@import_app.command()
def active(
    points: Annotated[Path, typer.Argument(help="CSV: grasp, object, approach, x, y, z, active.")],
    out: Out,
    joints: Joints = None,
    poses: Poses = None,
    calibration: Calibration = None,
    wrist: Wrist = "",
    baseline_frames: Baseline = None,
    hand: Hand = "allegro",
    seed: Seed = 1,
    noise: Noise = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Active taxels as 3D coordinates in the world, as the thesis's simulator wrote them.

    Example: taxel import active points.csv --joints joints.csv --out sim.h5 --baseline-frames 100
    """
    _one_of(joints, poses)
    with _bar(as_json) as tell:
        options = _options(calibration, wrist, baseline_frames, hand, seed, noise, overwrite, tell)
        report = import_active(points, out, joints=joints, poses=poses, options=options)
    _say(report, out, as_json)


@import_app.command()
def rollout(
    model: Annotated[Path, typer.Argument(help="A MuJoCo model, XML or MJB.")],
    states: Annotated[Path, typer.Argument(help="An .npz of qpos [T, nq], and qvel, ctrl, time, phase, grasp.")],
    out: Out,
    parts: Annotated[
        Path | None, typer.Option("--map", help="Which parts are the boards and the object (TOML).")
    ] = None,
    sensing: Annotated[str, typer.Option(help=f"{', '.join(LEVELS)}.")] = "layer",
    forward: Annotated[
        bool, typer.Option("--forward", help="Do not replay ctrl; take the states as they stand.")
    ] = False,
    calibration: Calibration = None,
    baseline_frames: Baseline = None,
    hand: Hand = "allegro",
    seed: Seed = 1,
    noise: Noise = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """States of your own MuJoCo model, felt by the project's layer and sensor.

    Example: taxel import rollout model.xml states.npz --map map.toml --out sim.h5
    """
    level = next((level for level in LEVELS if level == sensing), None)
    if level is None:
        raise TaxelError(f"--sensing: expected {', '.join(LEVELS)}, found {format_value(sensing)}")
    given, source = load_map(parts) if parts is not None else ({}, None)
    with _bar(as_json) as tell:
        options = _options(calibration, "", baseline_frames, hand, seed, noise, overwrite, tell)
        report = import_rollout(
            model,
            states,
            out,
            parts=given,
            parts_source=source,
            sensing=Sensing(level),
            forward=forward,
            options=options,
        )
    _say(report, out, as_json)


def _one_of(joints: Path | None, poses: Path | None) -> None:
    if (joints is None) == (poses is None):
        found = "neither" if joints is None else "both"
        raise TaxelError(f"--joints: expected this or --poses, found {found}; say where the hand was by one file")


def _options(
    calibration: Path | None,
    wrist: str,
    baseline_frames: int | None,
    hand: str,
    seed: int,
    noise: float | None,
    overwrite: bool,
    tell: Tell,
) -> ImportOptions:
    objects = load_calibration(calibration).objects if calibration is not None else {}
    return ImportOptions(
        hand=load_hand(hand),
        object_poses={name: estimate.transform for name, estimate in objects.items()},
        wrist=_wrist(wrist),
        baseline_frames=baseline_frames,
        sensor=SimSensor() if noise is None else SimSensor(noise_counts=noise),
        seed=seed,
        overwrite=overwrite,
        progress=tell,
    )


def _wrist(text: str) -> FloatArray | None:
    if not text:
        return None
    try:
        values = [float(part) for part in text.split(",")]
        if len(values) != _WRIST_NUMBERS or not np.isfinite(values).all():
            raise ValueError
        return make_pose(values[:3], values[3:])
    except ValueError:
        expected = "x,y,z,qw,qx,qy,qz (metres and a quaternion)"
        raise TaxelError(f"--wrist: expected {expected}, found {format_value(text)}; give seven numbers") from None


@contextmanager
def _bar(quiet: bool) -> Iterator[Tell]:
    """A progress bar that shows what is being done."""
    console = Console(stderr=True, markup=False)
    if quiet or not console.is_terminal:
        yield silent
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("importing", total=None)
        yield lambda what, done, of: progress.update(task, description=what, completed=done, total=of)


def _say(report: ImportReport, out: Path, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"file": str(out), **vars(report)}))
        return
    print(f"{out}: {report.grasps} grasps, {report.frames} frames ({report.added_frames} added as baseline)")
    if report.far_contacts:
        print(
            f"{report.far_contacts} of {report.contacts} contacts ({report.far_force_n:.3g} N in all) "
            "are felt by no taxel"
        )
