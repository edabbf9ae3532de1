"""`make audit` lists vulnerable versions, and states in one line where nothing could be checked."""

import importlib.util
import json
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / "tools" / "release" / "audit.py"
VULNERABLE = {"name": "x", "version": "1.0", "vulns": [{"id": "CVE-1", "fix_versions": ["1.1"]}]}
HEALTHY = {"name": "y", "version": "2.0", "vulns": []}
UNKNOWN = {"name": "z", "skip_reason": "not found"}


@pytest.fixture
def audit(monkeypatch):
    """A function that runs the audit with an answer of pip-audit; None: pip-audit is not installed."""
    spec = importlib.util.spec_from_file_location("audit", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def run(answer):
        """Run the audit with an answer of pip-audit (None: pip-audit is not installed) and return its exit status."""
        monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None if answer is None else object())
        finished = subprocess.CompletedProcess([], 0, stdout=answer or "")
        monkeypatch.setattr(module.subprocess, "run", lambda *arguments, **options: finished)
        monkeypatch.setattr(module.sys, "argv", ["audit.py"])
        return module.main()

    return run


@pytest.mark.parametrize(
    ("answer", "status", "expected"),
    [
        (None, 0, ["dependencies are not audited: pip-audit is missing (.venv/bin/python -m pip install pip-audit)"]),
        ("", 0, ["dependencies are not audited: the vulnerability database cannot be reached"]),
        ([UNKNOWN], 0, ["dependencies are not audited: the vulnerability database cannot be reached"]),
        ([HEALTHY, UNKNOWN], 0, ["1 versions audited, 1 unknown, 0 vulnerabilities"]),
        ([VULNERABLE, HEALTHY], 1, ["x 1.0: CVE-1, fixed in 1.1", "2 versions audited, 0 unknown, 1 vulnerabilities"]),
    ],
)
def test_audit_states_what_was_checked(capsys, audit, answer, status, expected):
    text = json.dumps({"dependencies": answer}) if isinstance(answer, list) else answer
    assert audit(text) == status
    assert capsys.readouterr().out.splitlines() == expected
