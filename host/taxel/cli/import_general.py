"""Commands of `taxel import` for data of any sensor: inspection and mappings."""

import json
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.import_options import (
    Approach,
    Files,
    MapFile,
    ObjectName,
    Out,
    Session,
    SourceOption,
    check_source,
    print_report,
)
from taxel.cli.import_presets import preset_app
from taxel.cli.options import AsJson, Overwrite
from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.output import write_whole
from taxel.recording.grasp_format import REAL
from taxel.recording.importers.fields import Field
from taxel.recording.importers.lerobot import make_lerobot_mapping
from taxel.recording.importers.mapping import Labels, load_mapping
from taxel.recording.importers.propose import propose_mapping
from taxel.recording.importers.run import import_files
from taxel.recording.importers.sources import open_source

__all__ = ["add_general_commands", "general_app"]

general_app = typer.Typer(help="Import data of any tactile sensor.", no_args_is_help=True)


def add_general_commands(app: typer.Typer) -> None:
    """Add the commands of this module and of the presets to another group of commands."""
    app.registered_commands += general_app.registered_commands + preset_app.registered_commands


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
        fields = [
            {"name": field.name, "shape": list(field.shape), "dtype": field.dtype} for field in opened.fields.values()
        ]
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
    print_report(import_files(files, load_mapping(map_file), out, overwrite), out, as_json)


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
    print_report(import_files([file], load_mapping(map_file), out, overwrite), out, as_json)


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
    mapping = make_lerobot_mapping(folder, column, check_source(source), components, span, labels)
    print_report(import_files([folder], mapping, out, overwrite), out, as_json)


def _list_fields(fields: list[Field]) -> Iterator[tuple[str, str, str]]:
    """Yield (name, shape, type) of fields as strings.

    Successive fields of equal shape and type whose names differ only in a final number are described together.
    """
    for (_, shape, dtype), group in groupby(
        fields, lambda field: (field.name.rstrip("0123456789"), field.shape, field.dtype)
    ):
        names = [field.name for field in group]
        name = names[0] if len(names) == 1 else f"{names[0]} ... {names[-1]} ({len(names)} fields)"
        yield name, " x ".join(map(str, shape)), dtype


def _parse_elements(text: str | None) -> tuple[int, int] | None:
    """Parse the option --elements, such as "6-33"; return (first, last number), None without the option.

    Raises `TaxelError` for another text.
    """
    if text is None:
        return None
    first, _, last = text.partition("-")
    if not (first.isdecimal() and last.isdecimal()) or int(last) < int(first):
        raise TaxelError(f"--elements: expected a range such as 6-33, found {format_value(text)}; correct the option")
    return int(first), int(last)


def _write_text(path: Path, text: str, overwrite: bool) -> None:
    """Write a text file. Raises `TaxelError` for an existing file without `overwrite`, and if writing fails."""
    if path.exists() and not overwrite:
        raise TaxelError(f"{path}: exists; choose another name, or add --overwrite")
    try:
        write_whole(path, text, overwrite=overwrite)
    except OSError as error:
        raise TaxelError(f"{path}: cannot be written ({error.strerror}); check the folder") from None
