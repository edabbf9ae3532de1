"""Run every benchmark and print one table.

python tools/bench/run.py [--json]
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bench_campaign
import bench_control_loop
import bench_decoder
import bench_emulator
import bench_press
import bench_sim
from figures import Figure
from rich.console import Console
from rich.table import Table


def table_of(figures: list[Figure]) -> Table:
    """One row a figure."""
    table = Table(title="benchmarks: medians of ratios, measured in one run")
    for heading in ("figure", "ratio", "at least", "reference", "detail"):
        table.add_column(heading, justify="right" if heading in {"ratio", "at least"} else "left")
    for figure in figures:
        colour = "green" if figure.ratio >= figure.target else "red"
        table.add_row(
            figure.name,
            f"[{colour}]{figure.ratio:.1f}[/]",
            f"{figure.target:g}",
            figure.reference,
            figure.detail,
        )
    return table


def main() -> int:
    """Exit status 1 if a figure misses its target."""
    figures = bench_emulator.measure() + bench_decoder.measure() + bench_campaign.measure()
    figures += bench_press.measure() + bench_sim.measure()
    loop = bench_control_loop.measure()
    if "--json" in sys.argv[1:]:
        print(json.dumps({"figures": [figure.__dict__ for figure in figures], "control_loop": loop}, indent=2))
    else:
        console = Console(width=150)
        console.print(table_of(figures))
        console.print(
            f"control loop of the Allegro hand, 333 Hz: {loop['missed']:.0f} of {loop['periods']:.0f} periods missed "
            f"(a loop that does nothing: {loop['empty_loop_missed']:.0f})"
        )
    return 0 if all(figure.ratio >= figure.target for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
