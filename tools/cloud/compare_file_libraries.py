"""Comparison of libraries for files of points and triangles with `taxel.cloud.files`: docs/cloud-libraries.md.

pip install trimesh meshio plyfile pypcd4                 into an environment of its own, with taxel
python tools/cloud/compare_file_libraries.py

Measured for each library: the valid and the malformed files of host/tests/cloud/file_samples.toml, 200 randomly changed
files of each format, the time to read and to write 100,000 points and 99,904 triangles, the time of the import, the
installed size. A library that is not installed is named and left out.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from compare_libraries import measure_size_mb
from file_libraries import LOADERS
from file_measurements import (
    CORRECT,
    REFUSED,
    check_malformed_files,
    check_valid_files,
    count_failures_on_changed_files,
    measure_speed,
)

SAMPLES: Final = Path(__file__).resolve().parents[2] / "host" / "tests" / "cloud" / "file_samples.toml"

Result = dict[str, Any]
"""Measurements of one library."""


def main() -> int:
    """Compare the libraries and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print all results, with every message, as JSON")
    parser.add_argument("--only", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        print(json.dumps(measure_library(options.only)))
        return 0
    results = {name: result for name in LOADERS if (result := measure_in_process(name)) is not None}
    if options.json:
        print(json.dumps(results, indent=1))
    else:
        print_tables(results)
    return 0


def measure_in_process(name: str) -> Result | None:
    """Measure one library in a process of its own; None if the library cannot be imported."""
    run = subprocess.run([sys.executable, __file__, "--only", name], capture_output=True, text=True)
    if run.returncode != 0:
        last_line = (run.stderr.strip().splitlines() or ["failed"])[-1]
        print(f"{name}: left out: {last_line}", file=sys.stderr)
        return None
    result: Result = json.loads(run.stdout.splitlines()[-1])
    return result


def measure_library(name: str) -> Result:
    """Measure one library in this process.

    Returns times, outcomes of valid, malformed and changed files, and for an installed library its size in MB, version
    and licence.
    """
    started = time.perf_counter()
    library = LOADERS[name]()
    result: Result = {"import_s": time.perf_counter() - started}
    samples = tomllib.loads(SAMPLES.read_text(encoding="ascii"))
    with tempfile.TemporaryDirectory() as folder:
        result["valid"] = check_valid_files(library, samples["valid"], Path(folder))
        result["malformed"] = check_malformed_files(library, samples["malformed"], Path(folder))
        result["changed"] = count_failures_on_changed_files(library, samples["valid"], Path(folder))
        result["speed_ms"] = measure_speed(library, Path(folder))
    if library.package:
        result["size_mb"], result["size_with_dependencies_mb"] = measure_size_mb(library.package)
        result["version"] = metadata.version(library.package)
        result["licence"] = _read_licence(library.package)
    return result


def print_tables(results: dict[str, Result]) -> None:
    """Print three tables as Markdown, then every deviation from the expected result."""
    _print_files(results)
    _print_speed(results)
    print("\n| library | version | licence | import, s | installed, MB | with dependencies, MB |")
    print("|---|---|---|---|---|---|")
    for name, result in results.items():
        if "version" in result:
            sizes = f"{result['size_mb']:.1f} | {result['size_with_dependencies_mb']:.1f}"
            print(f"| {name} | {result['version']} | {result['licence']} | {result['import_s']:.2f} | {sizes} |")
    print("\nDeviations:")
    for name, result in results.items():
        for group, expected in (("valid", CORRECT), ("malformed", REFUSED)):
            for item in result[group]:
                if item["outcome"] != expected:
                    reason = f" ({item['message'][:100]})" if item["message"] else ""
                    print(f"- {name}: {item['kind']}, {group} file, {item['name']}: {item['outcome']}{reason}")


def _print_files(results: dict[str, Result]) -> None:
    """Print the table of valid, malformed and changed files."""
    headings = (
        "library",
        "valid files correct",
        "malformed files refused",
        "failures on changed files",
        "longest error",
    )
    print(f"| {' | '.join(headings)} |")
    print("|---|---|---|---|---|")
    for name, result in results.items():
        correct = sum(item["outcome"] == CORRECT for item in result["valid"])
        refused = sum(item["outcome"] == REFUSED for item in result["malformed"])
        longest = max((len(item["message"]) for item in result["malformed"]), default=0)
        changed = result["changed"]
        failures = ", ".join(f"{count} {kind}" for kind, count in changed.items() if kind != "files") or "0"
        counts = f"{correct} of {len(result['valid'])} | {refused} of {len(result['malformed'])}"
        print(f"| {name} | {counts} | {failures} of {changed['files']} | {longest} characters |")


def _print_speed(results: dict[str, Result]) -> None:
    """Print a table of the computing times in ms: one row per file operation, one column per library."""
    operations = sorted({operation for result in results.values() for operation in result["speed_ms"]})
    print(f"\n| milliseconds | {' | '.join(results)} |")
    print("|---|" + "---|" * len(results))
    for operation in operations:
        times = (result["speed_ms"].get(operation) for result in results.values())
        print(f"| {operation} | {' | '.join('' if value is None else f'{value:.0f}' for value in times)} |")


def _read_licence(package: str) -> str:
    """Return the licence that the metadata of an installed Python package state."""
    fields = metadata.metadata(package)
    classifiers: list[str] = fields.get_all("Classifier") or []
    licences = [line.rpartition(" :: ")[2] for line in classifiers if line.startswith("License ::")]
    return ", ".join(licences) or str(fields["License"])


if __name__ == "__main__":
    sys.exit(main())
