"""Commands of `taxel import` for data of known layouts: presets of sensors and simulators."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.import_options import (
    Approach,
    Environments,
    Files,
    Gap,
    ObjectName,
    Out,
    Rate,
    Session,
    SourceOption,
    TimeUnit,
    check_source,
    print_report,
)
from taxel.cli.options import AsJson, Overwrite
from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.recording.general.format import GeneralHeader
from taxel.recording.grasp_format import REAL
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.genesis import read_genesis
from taxel.recording.importers.isaac import read_isaac
from taxel.recording.importers.mapping import TIME_UNITS, Grouping, Labels
from taxel.recording.importers.mujoco_sensors import read_mujoco_sensors
from taxel.recording.importers.preset import PresetOptions
from taxel.recording.importers.run import write_recordings
from taxel.recording.importers.tsf85 import read_tsf85
from taxel.recording.importers.uskin import read_uskin

preset_app = typer.Typer(help="Import data of known layouts.", no_args_is_help=True)


@preset_app.command()
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
    _write_dataset(read_tsf85(files, check_source(source), options, span), options, out, overwrite, as_json)


@preset_app.command()
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
    _write_dataset(read_uskin(files, check_source(source), options, prefix, unit), options, out, overwrite, as_json)


@preset_app.command("mujoco-sensors")
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
    _write_dataset(read, options, out, overwrite, as_json)


@preset_app.command()
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
    _write_dataset(read_isaac(file, options, environments), options, out, overwrite, as_json)


@preset_app.command()
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
    _write_dataset(read_genesis(file, options, field, environments, scalar), options, out, overwrite, as_json)


def _make_options(
    session: int,
    object_name: str | None,
    approach: str | None,
    gap_s: float | None,
    time_unit: str | None,
    rate_hz: float | None,
) -> PresetOptions:
    """Collect the options of a preset in one object. Raises `TaxelError` for an unknown time unit."""
    if time_unit is not None and time_unit not in TIME_UNITS:
        found = format_value(time_unit)
        raise TaxelError(f"--time-unit: expected {', '.join(TIME_UNITS)}, found {found}; correct the option")
    return PresetOptions(Labels(session, object_name, approach), Grouping(gap_s=gap_s), time_unit, rate_hz)


def _write_dataset(
    content: tuple[GeneralHeader, Iterable[Recording]],
    options: PresetOptions,
    out: Path,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write the data that a preset has read as a dataset, and print the numbers of contacts, frames and taxels.

    content: (header of the dataset, recordings). options: their grouping divides the recordings into contacts.
    """
    header, recordings = content
    print_report(write_recordings(out, header, recordings, options.grouping, overwrite), out, as_json)
