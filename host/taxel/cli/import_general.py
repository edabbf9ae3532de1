"""Commands of `taxel import` that write datasets of version 2: inspection, mappings, and presets of known layouts."""

import json
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.options import AsJson, Overwrite
from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.recording.general.format import GeneralHeader
from taxel.recording.grasp_format import REAL, SIM
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import Field
from taxel.recording.importers.genesis import read_genesis
from taxel.recording.importers.isaac import read_isaac
from taxel.recording.importers.lerobot import make_lerobot_mapping
from taxel.recording.importers.mapping import TIME_UNITS, Grouping, Labels, load_mapping
from taxel.recording.importers.mujoco_sensors import read_mujoco_sensors
from taxel.recording.importers.preset import PresetOptions
from taxel.recording.importers.propose import propose_mapping
from taxel.recording.importers.run import ImportReport, import_files, write_recordings
from taxel.recording.importers.sources import open_source
from taxel.recording.importers.tsf85 import read_tsf85
from taxel.recording.importers.uskin import read_uskin

__all__ = ["add_general_commands", "general_app"]

general_app = typer.Typer(help="Import data of any tactile sensor.", no_args_is_help=True)

Out = Annotated[Path, typer.Option(help="Dataset to write.")]
MapFile = Annotated[Path, typer.Option("--map", help="Mapping, a TOML file; taxel import inspect proposes one.")]
Files = Annotated[list[Path], typer.Argument(help="Files to import, in the order of the contacts.")]
SourceOption = Annotated[str, typer.Option("--source", help="real or sim: measured or simulated data.")]
Session = Annotated[int, typer.Option(min=0, help="Number of the day or of the mounting of the sensor.")]
ObjectName = Annotated[str | None, typer.Option("--object", help="Label of the object of all contacts.")]
Approach = Annotated[str | None, typer.Option(help="Label of the approach of all contacts.")]
Gap = Annotated[float | None, typer.Option("--gap-s", min=1e-9, help="Pause that starts a new contact, seconds.")]
TimeUnit = Annotated[
    str | None, typer.Option("--time-unit", help="Unit of the times: s, ms, us, ns. Default: inferred.")
]
Rate = Annotated[float | None, typer.Option("--rate-hz", min=1e-9, help="Frame rate of a file without times, hertz.")]
Environments = Annotated[bool, typer.Option("--environments", help="The second axis of the array is the environment.")]


def add_general_commands(app: typer.Typer) -> None:
    """Add the commands of `general_app` to another group of commands."""
    app.registered_commands += general_app.registered_commands


@general_app.command()
def inspect(
    file: Annotated[Path, typer.Argument(help="File, bag, Zarr store or LeRobot folder.")],
    map_out: Annotated[Path | None, typer.Option("--map-out", help="Mapping to write; correct its guesses.")] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Show the contents of a file and propose a mapping.

    Example: taxel import inspect data.npz --map-out map.toml
    """
    opened = open_source(file)
    text = propose_mapping(opened)
    if map_out is not None:
        _write_text(map_out, text, overwrite)
    if as_json:
        fields = [{"name": one.name, "shape": list(one.shape), "dtype": one.dtype} for one in opened.fields.values()]
        print(json.dumps({"file": str(file), "kind": opened.kind, "fields": fields, "map": text}))
        return
    table = Table("field", "shape", "type")
    for row in _list_fields(list(opened.fields.values())):
        table.add_row(*row)
    console = Console(markup=False, highlight=False)
    console.print(f"{file}: {opened.kind}, {len(opened.fields)} fields", soft_wrap=True)
    console.print(table)
    print(f"mapping written to {map_out}" if map_out is not None else text)


@general_app.command("map")
def import_by_map(
    files: Files, map_file: MapFile, out: Out, overwrite: Overwrite = False, as_json: AsJson = False
) -> None:
    """Import files of any kind by a mapping.

    Example: taxel import map day1.csv day2.csv --map map.toml --out data.h5
    """
    _print_report(import_files(files, load_mapping(map_file), out, overwrite), out, as_json)


@general_app.command()
def bag(
    file: Annotated[Path, typer.Argument(help="ROS 2 bag (folder, .mcap or .db3) or ROS 1 bag (.bag).")],
    map_file: MapFile,
    out: Out,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import a topic of a ROS bag by a mapping.

    Example: taxel import bag grasps.mcap --map map.toml --out data.h5
    """
    _print_report(import_files([file], load_mapping(map_file), out, overwrite), out, as_json)


@general_app.command()
def lerobot(
    folder: Annotated[Path, typer.Argument(help="Folder of a LeRobotDataset v2.1 or v3.")],
    column: Annotated[str, typer.Option(help="Feature with the values, such as observation.tactile.")],
    out: Out,
    elements: Annotated[str | None, typer.Option(help="First and last element of the feature: 6-33.")] = None,
    vectors: Annotated[bool, typer.Option("--vectors", help="The feature has 3 components of each taxel.")] = False,
    source: SourceOption = REAL,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import a feature of a LeRobot dataset; each episode is a contact.

    Example: taxel import lerobot my_dataset --column observation.tactile --out data.h5
    """
    labels = Labels(session, object_name, approach)
    span = _parse_elements(elements)
    components = 3 if vectors else 1
    mapping = make_lerobot_mapping(folder, column, _check_source(source), components, span, labels)
    _print_report(import_files([folder], mapping, out, overwrite), out, as_json)


@general_app.command()
def tsf85(
    files: Files,
    out: Out,
    columns: Annotated[str | None, typer.Option(help="First and last column of the taxels: FIRST,LAST.")] = None,
    source: SourceOption = REAL,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    gap_s: Gap = None,
    time_unit: TimeUnit = None,
    rate_hz: Rate = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import tables of Robotiq TSF-85 fingertips, of the hardware or of the simulation of Lab-CORO.

    Example: taxel import tsf85 TactileData_s1_tactile_maps.csv TactileData_s2_tactile_maps.csv --source sim --out a.h5
    """
    names = tuple(name.strip() for name in columns.split(",")) if columns is not None else None
    if names is not None and len(names) != 2:
        raise TaxelError(f"--columns: expected two names FIRST,LAST, found {format_value(columns)}; correct the option")
    options = _make_options(session, object_name, approach, gap_s, time_unit, rate_hz)
    span = None if names is None else (names[0], names[1])
    _write(read_tsf85(files, _check_source(source), options, span), options, out, overwrite, as_json)


@general_app.command()
def uskin(
    files: Files,
    out: Out,
    prefix: Annotated[str | None, typer.Option(help="Start of the column names of one set, such as raw_.")] = None,
    unit: Annotated[str, typer.Option(help="Unit of the values: counts, or N of a calibrated sensor.")] = "counts",
    source: SourceOption = REAL,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    gap_s: Gap = None,
    time_unit: TimeUnit = None,
    rate_hz: Rate = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import tables of XELA uSkin sensors: columns x, y and z of each taxel.

    Example: taxel import uskin log.csv --prefix raw_ --gap-s 1 --out real.h5
    """
    options = _make_options(session, object_name, approach, gap_s, time_unit, rate_hz)
    _write(read_uskin(files, _check_source(source), options, prefix, unit), options, out, overwrite, as_json)


@general_app.command("mujoco-sensors")
def mujoco_sensors(
    file: Annotated[Path, typer.Argument(help=".npz file with sensordata [T, k] and time [T].")],
    out: Out,
    model: Annotated[Path | None, typer.Option(help="MuJoCo model, XML or MJB.")] = None,
    layout: Annotated[str | None, typer.Option(help="Sensors without a model: tip:touch,pad:touch_grid:7x5x3.")] = None,
    sensors: Annotated[str | None, typer.Option(help="Names of the sensors to import: a,b. Default: all.")] = None,
    normal_only: Annotated[bool, typer.Option("--normal-only", help="Import only the normal values.")] = False,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    gap_s: Gap = None,
    time_unit: TimeUnit = None,
    rate_hz: Rate = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import sensordata of the MuJoCo sensors touch, touch_grid and tactile.

    Example: taxel import mujoco-sensors run.npz --model hand.xml --out sim.h5
    """
    if (model is None) == (layout is None):
        found = "neither" if model is None else "both"
        raise TaxelError(f"--model and --layout: expected one of them, found {found}; give the model of the simulation")
    names = [name.strip() for name in sensors.split(",")] if sensors is not None else []
    options = _make_options(session, object_name, approach, gap_s, time_unit, rate_hz)
    read = read_mujoco_sensors(file, options, model, layout, names, normal_only)
    _write(read, options, out, overwrite, as_json)


@general_app.command()
def isaac(
    file: Annotated[Path, typer.Argument(help="File with arrays of a ContactSensor or a VisuoTactileSensor.")],
    out: Out,
    environments: Environments = False,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    gap_s: Gap = None,
    time_unit: TimeUnit = None,
    rate_hz: Rate = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import saved arrays of Isaac Lab: contact forces, or force fields of TacSL.

    Example: taxel import isaac tacsl.npz --rate-hz 60 --out sim.h5
    """
    options = _make_options(session, object_name, approach, gap_s, time_unit, rate_hz)
    _write(read_isaac(file, options, environments), options, out, overwrite, as_json)


@general_app.command()
def genesis(
    file: Annotated[Path, typer.Argument(help="File with the stacked results of read() of a tactile sensor.")],
    out: Out,
    field: Annotated[str | None, typer.Option(help="Name of the array. Default: force, displacement ...")] = None,
    environments: Environments = False,
    scalar: Annotated[bool, typer.Option("--scalar", help="A last axis of length 3 counts probes.")] = False,
    session: Session = 1,
    object_name: ObjectName = None,
    approach: Approach = None,
    gap_s: Gap = None,
    time_unit: TimeUnit = None,
    rate_hz: Rate = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Import saved arrays of tactile sensors of Genesis.

    Example: taxel import genesis taxels.npz --rate-hz 100 --out sim.h5
    """
    options = _make_options(session, object_name, approach, gap_s, time_unit, rate_hz)
    _write(read_genesis(file, options, field, environments, scalar), options, out, overwrite, as_json)


def _list_fields(fields: list[Field]) -> Iterator[tuple[str, str, str]]:
    """Yield (name, shape, type) of fields; numbered columns of one prefix and shape are one row."""
    for (_, shape, dtype), group in groupby(fields, lambda one: (one.name.rstrip("0123456789"), one.shape, one.dtype)):
        names = [one.name for one in group]
        name = names[0] if len(names) == 1 else f"{names[0]} ... {names[-1]} ({len(names)} fields)"
        yield name, " x ".join(map(str, shape)), dtype


def _make_options(
    session: int,
    object_name: str | None,
    approach: str | None,
    gap_s: float | None,
    time_unit: str | None,
    rate_hz: float | None,
) -> PresetOptions:
    """Collect the options of a preset. Raises `TaxelError` for an unknown unit."""
    if time_unit is not None and time_unit not in TIME_UNITS:
        found = format_value(time_unit)
        raise TaxelError(f"--time-unit: expected {', '.join(TIME_UNITS)}, found {found}; correct the option")
    return PresetOptions(Labels(session, object_name, approach), Grouping(gap_s=gap_s), time_unit, rate_hz)


def _check_source(source: str) -> str:
    """Return the value of the option --source. Raises `TaxelError` for another value than real and sim."""
    if source not in (REAL, SIM):
        raise TaxelError(f"--source: expected real or sim, found {format_value(source)}; correct the option")
    return source


def _parse_elements(text: str | None) -> tuple[int, int] | None:
    """Parse the option --elements, first and last number. Raises `TaxelError`."""
    if text is None:
        return None
    first, _, last = text.partition("-")
    if not (first.isdecimal() and last.isdecimal()) or int(last) < int(first):
        raise TaxelError(f"--elements: expected a range such as 6-33, found {format_value(text)}; correct the option")
    return int(first), int(last)


def _write_text(path: Path, text: str, overwrite: bool) -> None:
    """Write a text file. Raises `TaxelError` for an existing file without `overwrite`, and if writing fails."""
    try:
        with path.open("w" if overwrite else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise TaxelError(f"{path}: exists; choose another name, or add --overwrite") from None
    except OSError as error:
        raise TaxelError(f"{path}: cannot be written ({error.strerror}); check the folder") from None


def _write(
    read: tuple[GeneralHeader, Iterable[Recording]], options: PresetOptions, out: Path, overwrite: bool, as_json: bool
) -> None:
    """Write the recordings of a preset and print the report."""
    header, recordings = read
    _print_report(write_recordings(out, header, recordings, options.grouping, overwrite), out, as_json)


def _print_report(report: ImportReport, out: Path, as_json: bool) -> None:
    """Print the numbers of imported contacts, frames and taxels. out: dataset written."""
    if as_json:
        print(json.dumps({"file": str(out), **vars(report)}))
        return
    kind = "taxels" if report.components == 1 else f"taxels of {report.components} components"
    print(f"{out}: {report.contacts} contacts, {report.frames} frames, {report.taxels} {kind}")
