"""Run the benchmarks and print one table.

python tools/bench/run.py [--json] [--page docs/benchmarks.md] [NAME ...]   names of modules without bench_; default all
"""

import argparse
import importlib
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from figures import Figure
from page import page_text
from rich.console import Console
from rich.table import Table

MODULES = (
    "skin_rate", "compact", "latency", "decoder", "recording", "memory", "emulator", "diagnosis", "campaign", "press",
    "sim", "monitor", "control_loop",
)  # fmt: skip


def shown(ratio: float | None) -> str:
    """Two figures after the point where the ratio is a share."""
    if ratio is None:
        return "-"
    return f"{ratio:.2f}" if ratio < 10 else f"{ratio:,.0f}"


def table_of(figures: list[Figure]) -> Table:
    """One row a figure."""
    table = Table(title="benchmarks: medians of ratios, measured in one run")
    for heading in ("figure", "ratio", "at least", "reference", "detail"):
        table.add_column(heading, justify="right" if heading in {"ratio", "at least"} else "left")
    for figure in figures:
        colour = "green" if figure.is_met else "red"
        table.add_row(
            figure.name,
            f"[{colour}]{shown(figure.ratio)}[/]",
            "" if figure.target is None else f"{figure.target:g}",
            figure.reference,
            figure.detail,
        )
    return table


def main() -> int:
    """Exit status 1 if a figure misses what is asked of it."""
    parser = argparse.ArgumentParser(description="Speed, as ratios measured in one run.")
    parser.add_argument("names", nargs="*", help=f"which benchmarks, of {', '.join(MODULES)}; default all")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    parser.add_argument("--page", type=Path, help="write the table to this page as well")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(MODULES))
    if unknown:
        parser.error(f"no benchmark '{unknown[0]}'; known are {', '.join(MODULES)}")
    figures: list[Figure] = []
    begun = time.perf_counter()
    for name in arguments.names or MODULES:
        print(f"{time.perf_counter() - begun:4.0f} s: {name}", file=sys.stderr, flush=True)
        figures += importlib.import_module(f"bench_{name}").measure()
    if arguments.json:
        print(json.dumps({"figures": [figure.__dict__ for figure in figures]}, indent=2))
    else:
        Console(width=170).print(table_of(figures))
    if arguments.page:
        arguments.page.write_text(page_text(figures))
    return 0 if all(figure.is_met for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
