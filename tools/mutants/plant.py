"""Plant the bugs of bugs.toml, one at a time, in a copy of the repository, and test whether the test suite detects
each.

    python tools/mutants/plant.py                    all bugs (make mutants)
    python tools/mutants/plant.py --only NAME        one bug; may be repeated
    python tools/mutants/plant.py --list             list the bugs and check that every bug can be planted
    python tools/mutants/plant.py --folder DIR       keep copies and builds in DIR; the next run reuses them

A bug is detected by the first stage of the suite that fails. The copy contains the current files, including new files
that git does not ignore; it is tested without any bug first. Exit status 0: all bugs detected; 1: a bug survived; 2:
the tool failed.
"""

import argparse
import difflib
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from bugs import ROOT, Bug, PlantError, load_bugs, select_bugs, select_stages
from sandbox import SandboxPool

from taxel.output import write_whole

OUT = ROOT / "out"


def write_diff(bug: Bug) -> Path:
    """Write the bug as a patch file and return its path."""
    text = (ROOT / bug.file).read_text()
    lines = (text.splitlines(keepends=True), bug.plant_in(text).splitlines(keepends=True))
    path = OUT / "mutants" / f"{bug.name}.diff"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, "".join(difflib.unified_diff(*lines, f"a/{bug.file}", f"b/{bug.file}")))
    return path


def run(bugs: Sequence[Bug], folder: Path, jobs: int) -> int:
    """Plant the bugs one at a time in copies of the repository, test them, and print and store the outcomes.

    folder: folder of the copies. jobs: number of copies. Returns the exit status: 1 if a bug survived. Raises
    PlantError.
    """
    needed = {stage.name: stage for bug in bugs for stage in select_stages(bug)}
    with SandboxPool(folder, jobs) as sandboxes:
        sandboxes.prepare()
        sandboxes.check_without_bugs(list(needed.values()))
        outcomes = sandboxes.try_all(bugs)
    OUT.mkdir(exist_ok=True)
    write_whole(OUT / "mutants.json", json.dumps([asdict(outcome) for outcome in outcomes], indent=1) + "\n")
    detected = {outcome.name for outcome in outcomes if outcome.found_by}
    print(f"{len(detected)} of {len(bugs)} bugs detected")
    for bug in bugs:
        if bug.name not in detected:
            print(f"survived: {bug.name} ({bug.what}); inspect it with git apply {write_diff(bug).relative_to(ROOT)}")
    return 0 if len(detected) == len(bugs) else 1


def main() -> int:
    """Plant and test the bugs of bugs.toml, or list them.

    Exit status 0: all detected; 1: a bug survived; 2: the tool failed.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="plant only this bug")
    parser.add_argument("--list", action="store_true", help="list the bugs and exit")
    parser.add_argument("--jobs", type=int, default=2, help="number of parallel copies (default: 2)")
    parser.add_argument("--folder", type=Path, help="folder that keeps the copies (default: a temporary folder)")
    arguments = parser.parse_args()
    try:
        bugs = select_bugs(load_bugs(), arguments.only)
        if arguments.list:
            for bug in bugs:
                print(f"{bug.name}: {bug.file}: {bug.what}")
            return 0
        if arguments.folder:
            return run(bugs, arguments.folder.resolve(), arguments.jobs)
        with tempfile.TemporaryDirectory(prefix="taxel-mutants-") as folder:
            return run(bugs, Path(folder).resolve(), arguments.jobs)
    except PlantError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
