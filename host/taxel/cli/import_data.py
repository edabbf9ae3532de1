"""`taxel import`: the importers of the project; other packages add importers by entry points."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as ProgressBar

from taxel.cli.convert import RecordedApproach, RecordedBaseline, RecordedObject, print_conversion
from taxel.cli.import_general import add_general_commands
from taxel.cli.options import AsJson, HandOption, Overwrite, Seed
from taxel.cli.plugin_commands import ImporterGroup
from taxel.errors import TaxelError
from taxel.grasp.calibration import load_calibration
from taxel.hand import load_hand
from taxel.hand.errors import format_value
from taxel.hand.transforms import make_pose
from taxel.recording.formats import convert
from taxel.recording.formats.grasp_options import UNKNOWN_OBJECT, GraspOptions
from taxel.recording.from_arrays import write_from_arrays
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.ros.mcap_signature import is_mcap, is_ros1_bag
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.csv_table import Progress, ignore_progress
from taxel.sim.importers.gazebo_csv import import_contacts
from taxel.sim.importers.mujoco_rollout import import_rollout
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.original_contacts import OriginalGrasp, import_original_contacts
from taxel.sim.importers.original_hardware import import_original_hardware
from taxel.sim.importers.rollout_names import load_map
from taxel.sim.original_sensing import THRESHOLD_M, OriginalRules
from taxel.sim.sensing import LEVELS, Sensing
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

__all__ = ["import_app"]

_WRIST_NUMBERS = 7

import_app = typer.Typer(
    cls=ImporterGroup,
    help="Import contacts, rollouts, arrays or recordings of other programs as a dataset.",
    no_args_is_help=True,
)
add_general_commands(import_app)

Out = Annotated[Path, typer.Option(help="Dataset to write.")]
JointFile = Annotated[
    Path | None, typer.Option("--joint-file", help="CSV with the columns grasp, time and joint angles in radians.")
]
PoseFile = Annotated[
    Path | None,
    typer.Option("--pose-file", help="CSV with the columns grasp, time, link, x ... qz, instead of --joint-file."),
]
Calibration = Annotated[Path | None, typer.Option(help="TOML file with the poses of the objects in the world.")]
WristPose = Annotated[
    str | None,
    typer.Option("--wrist-pose", help="Pose of the palm in the world, x,y,z,qw,qx,qy,qz, if the file has 16 joints."),
]
BaselineFrames = Annotated[
    int | None,
    typer.Option(min=1, help="Number of frames without contact that each grasp needs; missing frames are added."),
]
HandName = Annotated[str, typer.Option("--hand", help="Packaged hand or description file.")]
NoiseCounts = Annotated[
    float | None,
    typer.Option("--noise-counts", help="Standard deviation of the noise, counts. Default: the simulator's."),
]


@import_app.command()
def arrays(
    data: Annotated[Path, typer.Argument(help=".npz file with the names of taxel.recording.from_arrays.")],
    out: Out,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import NumPy arrays.

    Example: taxel import arrays data.npz --out data.h5
    """
    write_from_arrays(out, data, overwrite=overwrite)
    with GraspDataset(out) as written:
        report = ImportReport(grasps=len(written.ids), frames=sum(grasp.n_frames for grasp in written))
    _print_report(report, out, as_json)


@import_app.command()
def gazebo(
    contacts: Annotated[Path, typer.Argument(help="CSV of contact points in the world.")],
    out: Out,
    joints: JointFile = None,
    poses: PoseFile = None,
    distance_mm: Annotated[
        float | None,
        typer.Option(help="Largest distance from a contact to an active taxel. Default: 2.35 for 3 mm taxels."),
    ] = None,
    calibration: Calibration = None,
    wrist: WristPose = None,
    baseline_frames: BaselineFrames = None,
    hand: HandName = "original",
    seed: Seed = 1,
    noise: NoiseCounts = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import contact points of Gazebo with the distance threshold of the thesis.

    Example: taxel import gazebo contacts.csv --joint-file joints.csv --out sim.h5 --baseline-frames 100
    """
    _require_one(joints, poses)
    if distance_mm is not None and not (np.isfinite(distance_mm) and distance_mm > 0):
        raise TaxelError(f"--distance-mm: expected a number above 0, found {distance_mm:g}; the thesis uses 2.35")
    threshold = None if distance_mm is None else distance_mm * 1e-3
    with _progress_bar(as_json) as show:
        options = _make_options(calibration, wrist, baseline_frames, hand, seed, noise, overwrite, show)
        report = import_contacts(contacts, out, joints=joints, poses=poses, threshold_m=threshold, options=options)
    _print_report(report, out, as_json)


@import_app.command()
def active(
    points: Annotated[Path, typer.Argument(help="CSV: grasp, object, approach, x, y, z, active.")],
    out: Out,
    joints: JointFile = None,
    poses: PoseFile = None,
    calibration: Calibration = None,
    wrist: WristPose = None,
    baseline_frames: BaselineFrames = None,
    hand: HandName = "original",
    seed: Seed = 1,
    noise: NoiseCounts = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import active taxels as 3-D coordinates in the world, the file format of the thesis's simulator.

    Example: taxel import active points.csv --joint-file joints.csv --out sim.h5 --baseline-frames 100
    """
    _require_one(joints, poses)
    with _progress_bar(as_json) as show:
        options = _make_options(calibration, wrist, baseline_frames, hand, seed, noise, overwrite, show)
        report = import_active(points, out, joints=joints, poses=poses, options=options)
    _print_report(report, out, as_json)


@import_app.command("original-contacts")
def original_contacts(
    files: Annotated[list[Path], typer.Argument(help="One file for each repeat of the grasp, without header.")],
    out: Out,
    object_name: Annotated[str, typer.Option("--object", help="Object of the grasps, such as cylinder.")],
    approach: Annotated[str, typer.Option(help="Approach of the grasps, such as side_1.")],
    joints: JointFile = None,
    poses: PoseFile = None,
    threshold_mm: Annotated[
        float, typer.Option("--distance-mm", help="Raw contacts: distance to a contact below which a taxel is active.")
    ] = THRESHOLD_M * 1e3,
    true_centres: Annotated[
        bool, typer.Option("--true-centres", help="True taxel centres instead of those in the original programs.")
    ] = False,
    calibration: Calibration = None,
    wrist: WristPose = None,
    baseline_frames: BaselineFrames = None,
    hand: HandName = "original",
    seed: Seed = 1,
    noise: NoiseCounts = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import contact files of the original simulator: raw contacts (x,y,z) or active points (x,y,z,force).

    The name of a grasp in --joint-file or --pose-file is the file's name without folder and suffix.

    Example: taxel import original-contacts grasp_0_raw_contacts_coordinates_1.csv --object cylinder --approach side_1
    --joint-file joints.csv --baseline-frames 100 --out sim.h5
    """
    _require_one(joints, poses)
    if not (np.isfinite(threshold_mm) and threshold_mm > 0):
        raise TaxelError(f"--distance-mm: expected a number above 0, found {threshold_mm:g}; the original uses 2.34")
    rules = OriginalRules(coded_centres=not true_centres, threshold_m=threshold_mm * 1e-3)
    with _progress_bar(as_json) as show:
        options = _make_options(calibration, wrist, baseline_frames, hand, seed, noise, overwrite, show)
        labels = OriginalGrasp(object_name, approach)
        report = import_original_contacts(files, out, labels, joints=joints, poses=poses, rules=rules, options=options)
    _print_report(report, out, as_json)


@import_app.command()
def rollout(
    model: Annotated[Path, typer.Argument(help="MuJoCo model, XML or MJB.")],
    states: Annotated[Path, typer.Argument(help=".npz file with qpos [T, nq], qvel, ctrl, time, phase and grasp.")],
    out: Out,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="TOML file: which bodies of the model are the boards and the object.")
    ] = None,
    sensing: Annotated[str, typer.Option(help=f"Sensor model: {', '.join(LEVELS)}.")] = "layer",
    forward: Annotated[
        bool, typer.Option("--forward", help="Evaluate the given states instead of replaying ctrl.")
    ] = False,
    calibration: Calibration = None,
    baseline_frames: BaselineFrames = None,
    hand: HandName = "original",
    seed: Seed = 1,
    noise: NoiseCounts = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import states of a MuJoCo model; the soft layer and the sensor are simulated by this project.

    Example: taxel import rollout model.xml states.npz --map map.toml --out sim.h5
    """
    level = next((level for level in LEVELS if level == sensing), None)
    if level is None:
        raise TaxelError(f"--sensing: expected {', '.join(LEVELS)}, found {format_value(sensing)}")
    model_map, map_location = load_map(map_file) if map_file is not None else ({}, None)
    with _progress_bar(as_json) as show:
        options = _make_options(calibration, None, baseline_frames, hand, seed, noise, overwrite, show)
        report = import_rollout(
            model,
            states,
            out,
            model_map=model_map,
            map_location=map_location,
            sensing=Sensing(level),
            is_replayed=not forward,
            options=options,
        )
    _print_report(report, out, as_json)


@import_app.command("original-hardware")
def original_hardware(
    points: Annotated[
        list[Path],
        typer.Argument(help="Files GRASP_active_points_coordinates_N.csv; the other files of a grasp are beside them."),
    ],
    out: Out,
    object_name: Annotated[str, typer.Option("--object", help="Name of the grasped object.")],
    approach: Annotated[
        str | None, typer.Option(help="Name of the approach. Default: the part GRASP of the file name.")
    ] = None,
    calibration: Calibration = None,
    baseline_frames: BaselineFrames = 100,
    hand: HandName = "original",
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import CSV files that the original ROS stack recorded on the hardware: points and joint angles.

    Example: taxel import original-hardware box_active_points_coordinates_1.csv --object cylinder --out real.h5
    """
    with _progress_bar(as_json) as show:
        options = _make_options(calibration, None, baseline_frames, hand, 1, None, overwrite, show)
        report = import_original_hardware(points, out, object_name=object_name, approach=approach, options=options)
    _print_report(report, out, as_json)
    if not as_json:
        print(
            f"{report.active_points} active points; median distance of the recorded positions from the taxels of the "
            f"hand: {report.position_deviation_m * 1e3:.2f} mm"
        )


@import_app.command("original-bag")
def original_bag(
    bag: Annotated[Path, typer.Argument(help="ROS 1 bag (.bag), or MCAP file, with the topics sensor_8_readings ...")],
    out: Annotated[
        Path, typer.Option(help="Recording to write: x.bin (capture), x.mcap, x.h5 (grasp dataset), x.parquet, x.csv.")
    ],
    hand: HandOption = None,
    object_name: RecordedObject = UNKNOWN_OBJECT,
    approach: RecordedApproach = "recording",
    baseline_frames: RecordedBaseline = BASELINE_FRAMES,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import a bag of the original ROS stack as a recording.

    Example: taxel import original-bag skin.bag --out skin.mcap
    """
    if not (is_ros1_bag(bag) or is_mcap(bag)):
        found = "another file" if bag.is_file() else "no such file"
        raise TaxelError(f"{bag}: expected a ROS 1 bag or an MCAP file, found {found}; check the path")
    options = GraspOptions(object_name, approach, baseline_frames=baseline_frames)
    print_conversion(convert(bag, out, hand=hand, overwrite=overwrite, options=options), str(out), as_json)


def _require_one(joints: Path | None, poses: Path | None) -> None:
    """Raise `TaxelError` unless exactly one of the options `--joint-file` and `--pose-file` is given."""
    if (joints is None) == (poses is None):
        found = "neither" if joints is None else "both"
        raise TaxelError(f"--joint-file and --pose-file: expected one of them, found {found}")


def _make_options(
    calibration: Path | None,
    wrist: str | None,
    baseline_frames: int | None,
    hand: str,
    seed: int,
    noise: float | None,
    overwrite: bool,
    show: Progress,
) -> ImportOptions:
    """Collect the import options of the command line in one object.

    calibration: file with poses of objects. wrist: value of the option `--wrist-pose`. noise: standard deviation of the
    sensor noise, counts; None: that of the simulator. show: progress callback. Raises TaxelError.
    """
    objects = load_calibration(calibration).objects if calibration is not None else {}
    return ImportOptions(
        hand=load_hand(hand),
        object_poses={name: estimate.transform for name, estimate in objects.items()},
        wrist_pose=_parse_wrist_pose(wrist),
        baseline_frames=baseline_frames,
        sensor=SimSensor() if noise is None else SimSensor(noise_counts=noise),
        seed=seed,
        overwrite=overwrite,
        progress=show,
    )


def _parse_wrist_pose(text: str | None) -> FloatArray | None:
    """Parse the pose f64[4, 4] of the option `--wrist-pose`; None without the option. Raises `TaxelError`."""
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split(",")]
        if len(values) != _WRIST_NUMBERS or not np.isfinite(values).all():
            raise ValueError
        return make_pose(values[:3], values[3:])
    except ValueError:
        expected = "x,y,z,qw,qx,qy,qz (metres and a quaternion)"
        raise TaxelError(f"--wrist-pose: expected {expected}, found {format_value(text)}; give seven numbers") from None


@contextmanager
def _progress_bar(hidden: bool) -> Iterator[Progress]:
    """Show a progress bar of an import on standard error, if it is a terminal. Yields the progress callback."""
    console = Console(stderr=True, markup=False)
    if hidden or not console.is_terminal:
        yield ignore_progress
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with ProgressBar(*columns, console=console, transient=True) as progress:
        task = progress.add_task("importing", total=None)
        yield lambda step, done, total: progress.update(task, description=step, completed=done, total=total)


def _print_report(report: ImportReport, out: Path, as_json: bool) -> None:
    """Print the numbers of imported grasps and frames, and the contacts that are too far from every taxel.

    out: dataset that was written. as_json: print one JSON object instead of text.
    """
    if as_json:
        print(json.dumps({"file": str(out), **vars(report)}))
        return
    print(f"{out}: {report.grasps} grasps, {report.frames} frames ({report.added_frames} added as baseline)")
    if report.far_contacts:
        far = f"{report.far_contacts} of {report.contacts} contacts ({report.far_force_n:.3g} N in total)"
        print(f"{far} act on no taxel")
