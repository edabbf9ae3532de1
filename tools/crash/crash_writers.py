"""Kill every writer at every call that changes a file, and fail each call (`make crash-writers`)."""

import argparse
import gc
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build" / "crash"
LARGEST_MEMORY_BYTES = 8 << 30
"""Address space of a worker process; the libraries alone take 2 GiB of it."""

MARKS = ("<!-- table: begin -->", "<!-- table: end -->")


def build_shim() -> Path:
    """Compile the shim if it is missing or older than its source, and return its path.

    Raises OSError or CalledProcessError without a C compiler.
    """
    BUILD.mkdir(parents=True, exist_ok=True)
    shim = BUILD / "fault_shim.so"
    source = HERE / "fault_shim.c"
    if not shim.exists() or shim.stat().st_mtime < source.stat().st_mtime:
        part = shim.with_name(f"{shim.name}.{os.getpid()}")
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", part, source, "-ldl"], check=True)
        part.replace(shim)
    return shim


def run_worker(options: argparse.Namespace) -> None:
    """Run this worker's share of the campaigns in a process that has loaded the shim.

    Print each result as a JSON line.
    """
    from crash_campaign import Campaign, list_faults
    from crash_cases import CASES
    from crash_injection import Injector, Mode
    from crash_source import write_sources

    # A writer that needs more memory fails and is reported; the other programs of the machine are not affected.
    resource.setrlimit(resource.RLIMIT_AS, (LARGEST_MEMORY_BYTES, LARGEST_MEMORY_BYTES))
    injector = Injector(build_shim())
    # No `with` block: a child process must not remove the folder when it ends.
    folder = Path(tempfile.mkdtemp(prefix="taxel-crash-", dir=options.folder))
    source = write_sources(folder)
    gc.freeze()  # the child processes then share the memory of all modules
    for number, case in enumerate(CASES):
        if options.case not in (None, case.name) or number % options.jobs != options.worker:
            continue
        own = folder / str(number)
        own.mkdir()
        campaign = Campaign(case, injector, own, source)
        calls = campaign.measure()
        if options.call is not None:
            campaign.run([(options.call, Mode[options.mode])])
        else:
            campaign.run(list_faults(len(calls), options.sample, f"{options.seed} {case.name}"))
        print(json.dumps(vars(campaign.outcome)), flush=True)
        shutil.rmtree(own)
    shutil.rmtree(folder)


def run_workers(options: argparse.Namespace) -> list[dict[str, object]]:
    """Run the fault injection of all writers in `options.jobs` processes and return one result per writer.

    The processes preload the shim, a library that counts the file system calls and injects the faults. Each result is
    also printed to standard error as a table row.
    """
    shim = build_shim()
    environment = {**os.environ, "LD_PRELOAD": str(shim), "OMP_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"}

    def start(worker: int) -> list[dict[str, object]]:
        """Run one worker process and return its results. Exits the program if the worker fails."""
        command = [sys.executable, __file__, *sys.argv[1:], "--worker", str(worker), "--jobs", str(options.jobs)]
        outcomes = []
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                outcomes.append(json.loads(line))
                # Lines 0 and 1 of a table are its header.
                print(format_table(outcomes[-1:]).splitlines()[2], file=sys.stderr, flush=True)
        if process.returncode != 0:
            sys.exit(f"crash-writers: worker {worker} ended with status {process.returncode}")
        return outcomes

    with ThreadPoolExecutor(options.jobs) as pool:
        return [outcome for outcomes in pool.map(start, range(options.jobs)) for outcome in outcomes]


def format_table(outcomes: list[dict[str, object]]) -> str:
    """Return the Markdown table of the results by writer, with a last row of totals.

    calls: calls that change a file in a run without a fault. runs: runs with a fault. old, part, new: runs that left
    the old output, only some of the new records, or the complete new output.
    """
    rows = [
        "| writer | guarantee | calls | runs | old | part | new | broken guarantees |",
        "|---|---|---|---|---|---|---|---|",
    ]
    total = [0] * 6
    for outcome in outcomes:
        ends = outcome["ends"]
        assert isinstance(ends, dict)
        problems = outcome["problems"]
        assert isinstance(problems, list)
        numbers = [
            outcome["calls"],
            outcome["runs"],
            *(ends.get(end, 0) for end in ("old", "part", "new")),
            len(problems),
        ]
        total = [first + int(str(second)) for first, second in zip(total, numbers, strict=True)]
        rows.append(f"| {outcome['name']} | {outcome['guarantee']} | {' | '.join(map(str, numbers))} |")
    rows.append(f"| **total** | | {' | '.join(map(str, total))} |")
    return "\n".join(rows)


def write_page(page: Path, table: str) -> None:
    """Replace the table of a documentation page, which lies between two comments (`MARKS`)."""
    from taxel.output import write_whole

    before, _, remainder = page.read_text().partition(MARKS[0])
    _, _, after = remainder.partition(MARKS[1])
    write_whole(page, f"{before}{MARKS[0]}\n{table}\n{MARKS[1]}{after}")


def main() -> int:
    """Inject faults into every writer of files and print the results; the exit status is 1 if a guarantee is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", help="only this writer")
    parser.add_argument("--call", type=int, help="only this call, from 1; with --mode")
    parser.add_argument("--mode", default="KILL", help="KILL, KILL_TORN, FULL, FULL_ONCE, BROKEN, BROKEN_ONCE")
    parser.add_argument("--sample", type=int, help="random runs of each writer (default: all)")
    parser.add_argument("--seed", default="1", help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="number of processes")
    parser.add_argument("--folder", type=Path, help="folder for the files (default: the one for temporary files)")
    parser.add_argument("--page", type=Path, help="page whose table is replaced")
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker is not None:
        run_worker(options)
        return 0
    if options.folder is not None:
        options.folder.mkdir(parents=True, exist_ok=True)
    start_s = time.monotonic()
    outcomes = run_workers(options)
    table = format_table(outcomes)
    print(table)
    problems = [line for outcome in outcomes for line in outcome["problems"]]  # type: ignore[attr-defined]
    print(*problems, sep="\n")
    print(f"crash-writers: {time.monotonic() - start_s:.0f} s, seed {options.seed}, {len(problems)} broken guarantees")
    if options.page is not None:
        write_page(options.page, table)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
