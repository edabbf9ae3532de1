"""Run the benchmarks and print one table.

    python tools/bench/run.py [--json] [--page docs/benchmarks.md] [NAME ...]

NAME: module name without bench_; default: all benchmarks.
"""

import argparse
import importlib
import json
import sys
import time
from pathlib import Path

from taxel.output import write_whole

sys.path.insert(0, str(Path(__file__).parent))

from figures import Figure
from page import format_page
from rich.console import Console
from rich.table import Table

MODULES = (
    "skin_rate", "compact", "latency", "decoder", "clients", "recording", "memory", "emulator", "diagnosis", "campaign",
    "indentation", "sim", "monitor", "control_loop", "startup",
)  # fmt: skip


def build_table(figures: list[Figure]) -> Table:
    """Build the table of the measured ratios, one row per benchmark result."""
    table = Table(title="benchmarks: medians of ratios, measured in one run")
    for heading in ("figure", "ratio", "at least", "reference", "detail"):
        table.add_column(heading, justify="right" if heading in {"ratio", "at least"} else "left")
    for figure in figures:
        colour = "green" if figure.is_met else "red"
        table.add_row(
            figure.name,
            f"[{colour}]{figure.ratio_text}[/]",
            figure.target_text,
            figure.reference,
            figure.detail,
        )
    return table


def main() -> int:
    """Run the benchmarks and print the table. Returns the exit status: 1 if a requirement is missed, otherwise 0."""
    parser = argparse.ArgumentParser(description="Benchmarks as ratios to references measured in the same run.")
    parser.add_argument("names", nargs="*", help=f"benchmarks to run: {', '.join(MODULES)} (default: all)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    parser.add_argument("--page", type=Path, help="also write the table to this page")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(MODULES))
    if unknown:
        parser.error(f"unknown benchmark '{unknown[0]}'; available: {', '.join(MODULES)}")
    figures: list[Figure] = []
    start = time.perf_counter()
    for name in arguments.names or MODULES:
        print(f"{time.perf_counter() - start:4.0f} s: {name}", file=sys.stderr, flush=True)
        figures += importlib.import_module(f"bench_{name}").measure()
    if arguments.json:
        print(json.dumps({"figures": [figure.__dict__ for figure in figures]}, indent=2))
    else:
        Console(width=170).print(build_table(figures))
    if arguments.page:
        write_whole(arguments.page, format_page(figures))
    return 0 if all(figure.is_met for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
