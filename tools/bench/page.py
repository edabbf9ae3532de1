"""Text of docs/benchmarks.md, written by `make bench-page`."""

import os
import platform
import subprocess
from pathlib import Path

from figures import Figure

TEMPLATE = Path(__file__).parent / "benchmarks.template.md"


def _describe_commit() -> str:
    """Return the short id of the measured Git commit, with a note if files differed from the commit."""
    head = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, check=True)
    changed = subprocess.run(
        ["git", "status", "--porcelain", "--untracked-files=no", "--", "firmware", "host", "protocol", "tools"],
        capture_output=True,
        text=True,
        check=True,
    )
    return head.stdout.strip() + (" with uncommitted changes" if changed.stdout.strip() else "")


def format_page(figures: list[Figure]) -> str:
    """Format the Markdown text of docs/benchmarks.md: machine, one row per measured ratio, and the method of each."""
    machine = f"{os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}"
    rows = [
        f"| {f.name} | {f.ratio_text} | {f.target_text} | "
        f"{'' if f.target is None else 'yes' if f.is_met else 'no'} | {f.reference} | {f.detail} |"
        for f in figures
    ]
    return TEMPLATE.read_text().format(commit=_describe_commit(), machine=machine, rows="\n".join(rows))
