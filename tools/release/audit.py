"""Search the versions of constraints.txt for published vulnerabilities, with pip-audit.

python tools/release/audit.py [FILE]

Exit status 1 if a version is vulnerable. Without pip-audit, or without a connection to the vulnerability database, one
line states that nothing was checked, and the exit status is 0.
"""

import argparse
import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[2]
TIMEOUT_S: Final = 15
"""Longest wait for one answer of the database, seconds (the default of pip-audit)."""


def run_audit(path: Path) -> list[dict[str, Any]] | None:
    """Return the packages of a file of pinned versions with their vulnerabilities; None if pip-audit prints no result.

    path: lines "name==version". Packages that the database does not contain have a `skip_reason`.
    """
    command = [sys.executable, "-m", "pip_audit", "--requirement", str(path), "--no-deps", "--disable-pip"]
    command += ["--format", "json", "--progress-spinner", "off", "--timeout", str(TIMEOUT_S)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        packages: list[dict[str, Any]] = json.loads(result.stdout)["dependencies"]
    except (ValueError, KeyError):
        return None
    return packages


def format_findings(packages: list[dict[str, Any]]) -> list[str]:
    """Return one line for each vulnerability: package, version, identifier and the versions without it."""
    lines = []
    for package in packages:
        for finding in package.get("vulns", []):
            fixed = ", ".join(finding["fix_versions"]) or "none yet"
            lines.append(f"{package['name']} {package['version']}: {finding['id']}, fixed in {fixed}")
    return lines


def main() -> int:
    """Audit the pinned versions; the exit status is 1 if a version is vulnerable."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, nargs="?", default=ROOT / "constraints.txt")
    path: Path = parser.parse_args().file
    if importlib.util.find_spec("pip_audit") is None:
        print("dependencies are not audited: pip-audit is missing (.venv/bin/python -m pip install pip-audit)")
        return 0
    packages = run_audit(path)
    audited = [package for package in packages or [] if "skip_reason" not in package]
    if packages is None or not audited:
        print("dependencies are not audited: the vulnerability database cannot be reached")
        return 0
    lines = format_findings(audited)
    skipped = len(packages) - len(audited)
    print("\n".join([*lines, f"{len(audited)} versions audited, {skipped} unknown, {len(lines)} vulnerabilities"]))
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
