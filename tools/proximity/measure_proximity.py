"""Accuracy of distances before contact, and of predicted contacts, on emulated skins with fresh seeds.

    python tools/proximity/measure_proximity.py --skins 8 --worlds 2              # print the tables
    python tools/proximity/measure_proximity.py --skins 8 --worlds 2 --update     # also write them to docs/proximity.md

Each skin has its own parts, size and range of the response. It is calibrated once on one board of each kind, with a
flat plate at known distances. The approaches take place in other worlds of this skin, with other seeds, on all 17
boards: plates, boxes, cylinders and spheres of random size, position, tilt and speed, with gains, stiffness, noise, 1/f
noise, warm-up or drifting temperature. The estimator reads only the calibration and the bytes of the hub.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one process per core: threads of the library would compete

import numpy as np
from proximity_check import PREDICTED_SPEED_M_S, Approach, SkinResult, Task, run_skin

from taxel.output import write_whole

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "proximity.md"
BEGIN, END = "<!-- tables of tools/proximity/measure_proximity.py -->\n", "<!-- end of the tables -->\n"
LEAD_S: Final = 0.08


def main() -> int:
    """Run the check and print its tables; the exit status is 1 if a required figure is not met."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--skins", type=int, default=8)
    parser.add_argument("--worlds", type=int, default=2, help="worlds of each group per skin")
    parser.add_argument("--approaches", type=int, default=14, help="approaches per world, at most 16")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument("--update", action="store_true", help="write the tables to docs/proximity.md")
    options = parser.parse_args()
    tasks = [Task(options.seed, number, options.worlds, options.approaches) for number in range(options.skins)]
    if options.jobs == 1:
        results = [_report(run_skin(task)) for task in tasks]
    else:
        with ProcessPoolExecutor(options.jobs) as pool:
            results = [_report(result) for result in pool.map(run_skin, tasks)]
    figures = compute_figures(results)
    text = format_tables(figures, results, options)
    print(json.dumps(figures, indent=1) if options.json else text)
    if options.update:
        before, rest = PAGE.read_text().split(BEGIN)
        write_whole(PAGE, before + BEGIN + text + END + rest.split(END)[1])
    return 0 if is_met(figures) else 1


def _report(result: SkinResult) -> SkinResult:
    """Print on standard error that a skin is finished, and return its result unchanged."""
    print(f"skin finished: {len(result.approaches)} approaches", file=sys.stderr, flush=True)
    return result


def is_met(figures: dict[str, Any]) -> bool:
    """Return whether the figures of `compute_figures` meet the limits that are required of the estimator."""
    return bool(
        figures["median_error_mm"] <= 0.5
        and 0.90 <= figures["coverage"] <= 0.99
        and figures["predicted_in_time"] >= 0.9
        and figures["false_share"] <= 0.02
    )


def compute_figures(results: Sequence[SkinResult]) -> dict[str, Any]:
    """Compute the figures of all skins, by name: errors, coverage, predictions and recognition of the target.

    Numbers are in the unit at the end of their name (mm, ms, hours). Coverage, `predicted_in_time` and names with
    `share` are shares from 0 to 1; all other numbers are counts. `recognition` contains `_compute_name_shares` by
    target.
    """
    everything = _select(results)
    distance = summarise(everything)
    fast = [each for each in everything if each.speed_m_s == PREDICTED_SPEED_M_S]
    passing = _select(results, passing=True)
    leads = [each.lead_s for each in fast if each.has_contact and each.lead_s is not None]
    contacts = sum(each.has_contact for each in fast)
    false = sum(each.warnings for each in fast)
    return distance | {
        "contacts": contacts,
        "predicted_in_time": sum(lead >= LEAD_S for lead in leads) / max(contacts, 1),
        "median_lead_ms": 1e3 * float(np.median(leads)) if leads else float("nan"),
        "warnings": false + len(leads),
        "false_warnings": false,
        "false_of_contacts": sum(each.warnings for each in fast if each.has_contact),
        "false_share": false / max(false + len(leads), 1),
        "without_contact": sum(not each.has_contact for each in fast),
        "passing": len(passing),
        "passing_with_warning": sum(each.warnings > 0 for each in passing),
        "idle_warnings": sum(result.idle_warnings for result in results),
        "idle_hours": sum(result.idle_s for result in results) / 3600.0,
        "recognition": {target: _compute_name_shares(results, target) for target in ("grounded", "acrylic")},
    }


def _select(results: Sequence[SkinResult], passing: bool = False) -> list[Approach]:
    """Return the approaches of the worlds in which the recognition of the target is not scored (`target` is empty).

    passing: return the approaches that pass sideways instead of those along the normal.
    """
    everything = [approach for result in results for approach in result.approaches if not approach.target]
    return [approach for approach in everything if (approach.kind == "pass") == passing]


def summarise(approaches: Sequence[Approach]) -> dict[str, Any]:
    """Return the errors and the coverage of some approaches, by name.

    Errors are in millimetres, and NaN without any frame in range. `coverage` is the share of frames whose interval
    contains the true distance, `missing_share` the share of frames in range without an estimate, both from 0 to 1.
    """
    errors = np.array([error for each in approaches for error in each.errors_m])
    covered = np.array([is_covered for each in approaches for is_covered in each.covered])
    missing = sum(each.missing for each in approaches)
    of_approach = [float(np.median(np.abs(each.errors_m))) for each in approaches if each.errors_m]
    count = max(len(errors), 1)
    return {
        "approaches": len(of_approach),
        "frames": len(errors),
        "median_error_mm": 1e3 * float(np.median(np.abs(errors))) if len(errors) else float("nan"),
        "median_error_of_approaches_mm": 1e3 * float(np.median(of_approach)) if of_approach else float("nan"),
        "error_90_mm": 1e3 * float(np.quantile(np.abs(errors), 0.9)) if len(errors) else float("nan"),
        "bias_mm": 1e3 * float(np.median(errors)) if len(errors) else float("nan"),
        "coverage": float(covered.sum() / count),
        "missing_share": missing / max(missing + len(errors), 1),
    }


def _compute_name_shares(results: Sequence[SkinResult], target: str) -> dict[str, float]:
    """Compute the share of frames in which the estimator gave each name to a target, and the coverage of its distance.

    target: the true target, "grounded" or "acrylic". Returns values from 0 to 1, all relative to the frames in range
    with an estimate: the share of each name, by name, and under "coverage" the share of frames whose interval contains
    the true distance.
    """
    names = [name for result in results for each in result.approaches if each.target == target for name in each.named]
    known = ("grounded", "acrylic", "not identifiable", "unknown")
    approaches = [each for result in results for each in result.approaches if each.target == target]
    shares = {name: names.count(name) / max(len(names), 1) for name in known}
    return shares | {"coverage": summarise(approaches)["coverage"]}


def format_tables(figures: dict[str, Any], results: Sequence[SkinResult], options: argparse.Namespace) -> str:
    """Return the figures and the groups of approaches as Markdown tables."""
    everything = _select(results)
    lines = [
        f"Measured with `python tools/proximity/measure_proximity.py --skins {options.skins} --worlds {options.worlds} "
        f"--approaches {options.approaches} --seed {options.seed}`.",
        "",
        "| figure | required | measured |",
        "|---|---|---|",
        f"| median error, 0.5 to 5 mm, grounded conductor | at most 0.5 mm | {figures['median_error_mm']:.2f} mm |",
        f"| interval of 95 % contains the distance | 90 to 99 % | {100 * figures['coverage']:.1f} % |",
        f"| frames in this range without an estimate | | {100 * figures['missing_share']:.1f} % |",
        f"| contacts at 50 mm/s predicted at least 80 ms ahead | | {100 * figures['predicted_in_time']:.1f} % of "
        f"{figures['contacts']}, median {figures['median_lead_ms']:.0f} ms |",
        f"| predicted contacts at 50 mm/s that did not follow | at most 2 % | {figures['false_warnings']} of "
        f"{figures['warnings']} ({100 * figures['false_share']:.1f} %); {figures['false_of_contacts']} in approaches "
        f"that reached the skin, the others among {figures['without_contact']} that braked before it |",
        f"| predicted contacts of targets that pass sideways at 2 to 8 mm | | {figures['passing_with_warning']} of "
        f"{figures['passing']} |",
        f"| predictions without any target | | {figures['idle_warnings']} in {figures['idle_hours']:.1f} board hours |",
        "",
        "| group | approaches | frames | median error, mm | error, 90 % quantile, mm | bias, mm | coverage, % |",
        "|---|---|---|---|---|---|---|",
    ]
    groups = {"all": everything}
    for kind, name in (("contact", "to contact"), ("stop", "braking before contact"), ("hold", "to a hold")):
        groups[name] = [each for each in everything if each.kind == kind]
    for shape in ("plate", "box", "cylinder", "sphere"):
        groups[shape] = [each for each in everything if each.shape == shape]
    for kind in sorted({each.board_kind for each in everything}):
        groups[kind.replace("_", " ")] = [each for each in everything if each.board_kind == kind]
    groups["passing sideways (not in all)"] = _select(results, passing=True)
    for name, members in groups.items():
        row = summarise(members)
        lines.append(
            f"| {name} | {row['approaches']} | {row['frames']} | {row['median_error_mm']:.2f} | "
            f"{row['error_90_mm']:.2f} | {row['bias_mm']:+.2f} | {100 * row['coverage']:.1f} |"
        )
    lines += [
        "",
        "With two calibrated targets:",
        "",
        "| true target | grounded, % | acrylic, % | not identifiable, % | unknown, % | coverage of the distance, % |",
        "|---|---|---|---|---|---|",
    ]
    for target, shares in figures["recognition"].items():
        lines.append(f"| {target} | " + " | ".join(f"{100 * share:.1f}" for share in shares.values()) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
