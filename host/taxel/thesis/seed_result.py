"""Results of the reproduction with one seed, stored as one JSON file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from taxel.errors import TaxelError
from taxel.input_files import parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.output import write_whole
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.settings import describe_settings
from taxel.thesis.shape_counts import ShapeCount

FILE_NAME: Final = "result.json"

UNCHECKED: Final[Mapping[str, Any]] = {}
"""Settings of a result from existing datasets, whose settings are not known."""


@dataclass(frozen=True)
class SeedResult:
    """Results of one pair of campaigns, real (or emulated) and simulated.

    seed: seed of the campaigns; None for existing datasets. made: sentences on how the campaigns were made. settings:
    settings with which they were made. objects: results of the objects in the order of the thesis. shapes: numbers of
    identified shapes.
    """

    seed: int | None
    made: tuple[str, ...]
    settings: Mapping[str, Any]
    objects: tuple[ObjectResult, ...]
    shapes: tuple[ShapeCount, ...]

    def write(self, folder: Path) -> None:
        """Write the results to `result.json` in a folder; an interrupted call leaves no incomplete file."""
        values = {
            "seed": self.seed,
            "made": self.made,
            "settings": self.settings,
            "objects": [result.to_json() for result in self.objects],
            "shapes": [count.to_json() for count in self.shapes],
        }
        write_whole(folder / FILE_NAME, json.dumps(values, indent=1))


def read_seed_result(folder: Path) -> SeedResult | None:
    """Read the results of a seed from its folder; return None if they are not stored yet.

    Raises TaxelError for a damaged file, and for results that were made with settings other than the present ones.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    try:
        values = parse_json(read_regular_file(path, JSON_BYTES_MAX))
        result = SeedResult(
            values["seed"],
            tuple(values["made"]),
            values["settings"],
            tuple(ObjectResult.from_json(item) for item in values["objects"]),
            tuple(ShapeCount.from_json(item) for item in values["shapes"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise TaxelError(f"{path}: expected results of taxel thesis, found a damaged file; delete it") from error
    expected = json.loads(json.dumps(describe_settings()))  # tuples become lists, as in the stored settings
    if result.settings != expected:
        names = [key for key in expected if result.settings.get(key) != expected[key]] or ["unknown settings"]
        raise TaxelError(
            f"{path}: expected results with the present settings, found others ({', '.join(names)}); "
            f"delete the folder {folder} or use another --out"
        )
    return result
