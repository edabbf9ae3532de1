"""The tables of the thesis as printed (chapter 5 and appendix I), and the places where they are inconsistent."""

import csv
import importlib.resources
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, Final

from taxel.cloud.treatment import FORCE_FILTER_COUNTS

Rows = tuple[Mapping[str, Any], ...]

OBJECTS: Final = ("rectangular", "cylindrical", "triangular")
"""Names of the objects in the appendix, in its order."""

TITLES: Final = MappingProxyType(dict(zip(OBJECTS, ("Rectangular prism", "Cylinder", "Triangular prism"), strict=True)))
"""Names of the objects in Tables 5.1 and 5.2, by their names in the appendix."""

STAGES: Final = ("Pre-treatment", "Force filter", "Force+ SOR filters", "Force+ SOR filters+ contact propagation")
"""Stages of the treatment, as printed in Tables I-10 to I-12."""

ORIGINAL, PROPAGATED = "Original sim", "Sim+ contact propagation"
"""Names of the simulated clouds, as printed in Tables I-7 to I-9."""

PRINTED_SOR: Final = MappingProxyType({"rectangular": (20, 1.0), "cylindrical": (20, 2.0), "triangular": (716, 2.0)})
"""N and nSigma that Table 5.4 selects for each object."""

FORCE_FILTER: Final = int(FORCE_FILTER_COUNTS)
"""Threshold of the force filter that the thesis selected, counts. A threshold of 150 counts removes no point (Table
5.3, Tables I-1 to I-3)."""

INCONSISTENCIES: Final = (
    "Tables I-1 to I-18: mean^2 + std^2 differs from RMS^2. The RMS is that of ICP; mean and std come from another "
    "calculation. The difference is up to 16 % in Tables I-1 to I-6, and 24 % for the triangular prism on the "
    "rectangular one (I-17).",
    "Tables I-1 to I-3: the largest distance increases although points are removed (rectangular prism, 160 to 170 "
    "counts). Every row has an alignment of its own.",
    "Table I-6 prints the same row for N = 2865 and N = 143 at nSigma 2; 143 is a tenth of 1433, half of the cloud.",
    "Table I-4: N = 2806, 701 and 1403 are all, a quarter and half of 2806 points; the filtered cloud has 3069.",
    "Tables I-9 and I-12: 2959 and 2971 points of the triangular prism after contact propagation.",
    "Table 5.2: the 40 grasps of the triangular prism have more simulated points than the 54 grasps of the rectangular "
    "prism; section 5.6.2 explains the small contribution of the triangular prism by few contact points.",
    "Section 5.6.2 states that the smallest distances lie far above 190 counts. The mean of the cylinder is smallest "
    "at 190 (I-2).",
    "Section 5.6.2 states that SOR contributes more than the force filter for all shapes. For the cylinder it "
    "contributes less (I-11).",
    "Table 5.4 selects N = 20, nSigma = 2 for the cylinder; two other rows of Table I-5 have the same mean, 2.71 mm.",
)


def get_printed_name(name: str) -> str:
    """Convert the dataset's name of an object to the printed name; a name that is not in the thesis is returned
    unchanged.

    The first three letters are compared, for example of "cylinder" and "cylindrical".
    """
    return next((word for word in OBJECTS if name.lower().startswith(word[:3])), name)


@cache
def load_table(table: str) -> Rows:
    """Load a table of the thesis from a file in `data`, such as ``I_1_to_3_force_filter``; numbers as floats."""
    path = importlib.resources.files("taxel.thesis") / "data" / f"table_{table}.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    return tuple(
        MappingProxyType({key: _parse_value(text) for key, text in row.items()}) for row in csv.DictReader(lines)
    )


def select_rows(table: str, name: str, column: str = "object") -> Rows:
    """Return the rows of a table of the thesis whose entry in `column` is `name`."""
    return tuple(row for row in load_table(table) if row[column] == name)


def get_distances(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the distances in a row of a printed table, metres, by the field names of `DistanceStats`."""
    return {key: float(row[key]) for key in ("rms_m", "max_m", "mean_m", "std_m")}


def _parse_value(text: str) -> Any:
    """Convert a cell of a printed table to a float if possible, otherwise to a string with the spelling of `STAGES`."""
    try:
        return float(text)
    except ValueError:
        return text.replace("Sim+contact", "Sim+ contact")
