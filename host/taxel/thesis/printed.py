"""The thesis's tables as they are printed (chapter 5 and appendix I), and where they contradict themselves."""

from __future__ import annotations

import csv
import importlib.resources
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, Final

from taxel.cloud.treatment import FORCE_FILTER_COUNTS

Rows = tuple[Mapping[str, Any], ...]

OBJECTS: Final = ("rectangular", "cylindrical", "triangular")
"""As the appendix calls them, in its order."""

STAGES: Final = ("Pre-treatment", "Force filter", "Force+ SOR filters", "Force+ SOR filters+ contact propagation")
"""Of the treatment (Tables I-10 to I-12)."""

ORIGINAL, PROPAGATED = "Original sim", "Sim+ contact propagation"
"""Simulated clouds (Tables I-7 to I-9)."""

SOR_OF: Final = MappingProxyType({"rectangular": (20, 1.0), "cylindrical": (20, 2.0), "triangular": (716, 2.0)})
"""N and nSigma of Table 5.4."""

FORCE_FILTER: Final = int(FORCE_FILTER_COUNTS)
"""Counts; 150 of the same scale takes no point (Table 5.3, Tables I-1 to I-3)."""

INCONSISTENT: Final = (
    "Tables I-1 to I-18: mean^2 + std^2 is not RMS^2; the RMS is that of ICP, the others of another calculation. They "
    "differ by up to 16 % in Tables I-1 to I-6, and by 24 % for the triangular prism on the rectangular one (I-17).",
    "Tables I-1 to I-3: taking points away raises the largest distance (rectangular prism, 160 to 170 counts): every "
    "row was aligned anew.",
    "Table I-6 prints the same row for N = 2865 and N = 143 at nSigma 2; 143 is a tenth of 1433, half of the cloud.",
    "Table I-4: N = 2806, 701 and 1403 are all, a quarter and half of 2806 points; the filtered cloud has 3069.",
    "Tables I-9 and I-12: 2959 and 2971 points of the triangular prism after contact propagation.",
    "Table 5.2: the triangular prism's 40 grasps have more simulated points than the rectangular prism's 54; section "
    "5.6.2 explains its small contribution by few contact points.",
    "Section 5.6.2: the smallest distances lie far above 190 counts. The cylinder's mean is smallest at 190 (I-2).",
    "Section 5.6.2: SOR contributes more than the force filter for all shapes. For the cylinder it does not (I-11).",
    "Table 5.4 chooses N = 20, nSigma = 2 for the cylinder; two other rows of Table I-5 have the same mean, 2.71 mm.",
)


def of_dataset(name: str) -> str:
    """The thesis's word for an object of a dataset; the name itself if the thesis has none."""
    return next((word for word in OBJECTS if name.lower().startswith(word[:3])), name)


@cache
def printed(table: str) -> Rows:
    """The rows of one of the files of tables in `data`, such as ``I_1_to_3_force_filter``; numbers as floats."""
    path = importlib.resources.files("taxel.thesis") / "data" / f"table_{table}.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    return tuple(MappingProxyType({key: _value(text) for key, text in row.items()}) for row in csv.DictReader(lines))


def rows_of(table: str, name: str, column: str = "object") -> Rows:
    """Those of one object."""
    return tuple(row for row in printed(table) if row[column] == name)


def match_of(row: Mapping[str, Any]) -> dict[str, float]:
    """What a row says of a match, as `DistanceStats` has it."""
    return {key: float(row[key]) for key in ("rms_m", "max_m", "mean_m", "std_m")}


def _value(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text.replace("Sim+contact", "Sim+ contact")
