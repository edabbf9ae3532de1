"""The comparisons in tools/cloud: they say what is missing, and read what CloudCompare writes."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.cloud.models import get_builtin_models

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "cloud"
NAMES = ("cloudcompare", "compare_cloudcompare", "candidates", "compare_libraries", "measure_fusion")


@pytest.fixture(scope="module")
def tool():
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in NAMES})
    for name in NAMES:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def test_without_cloudcompare_it_says_how_to_get_it(tool, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["compare_cloudcompare.py", "real.h5", "sim.h5"])
    assert tool.compare_cloudcompare.main() == 2
    expected = "compare_cloudcompare: CloudCompare is missing: apt-get install cloudcompare\n"
    assert capsys.readouterr().err == expected


STAND_IN = """#!{python}
import sys
arguments = sys.argv[1:]
names = arguments[arguments.index("-SAVE_CLOUDS") + 2].split()
open(arguments[arguments.index("-LOG_FILE") + 1], "w").write("[10:00:00] RMS: 0.00125\\n")
for name in names:
    open(name, "w").write("0.1 0.2 0.3 -0.004\\n0.1 0.2 0.5 0.002\\n" if name != "other.asc" else "")
"""


def test_what_cloudcompare_writes_is_read(tool, tmp_path):
    program = tmp_path / "CloudCompare"
    program.write_text(STAND_IN.format(python=sys.executable))
    program.chmod(0o755)
    its = tool.cloudcompare.CloudCompare(str(program), tmp_path)
    cloud = its.save("cloud", np.zeros((2, 3)))
    assert its.to_mesh(cloud, "mesh.ply").tolist() == [0.004, 0.002]
    points, rms = its.aligned(cloud, "target.xyz")
    assert (points.shape, rms) == ((2, 3), 0.00125)
    program.write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(RuntimeError, match=r"-C2C_DIST .* CloudCompare failed: 3"):
        its.to_cloud(cloud, cloud)


def test_a_broken_bound_is_told(tool):
    row = tool.compare_cloudcompare.Row("mine", 10, 0.1, -1.5, 0.0, 0.0, 98.0, 2.0, -5.0)
    speed = tool.compare_cloudcompare.Speed("mine", 22, 1.0, 9.0, 0.0, 0.0)
    told = tool.compare_cloudcompare.broken([row], speed)
    assert [line.split(":")[0] for line in told] == ["mine", "mine", "mine", "sweep"]
    assert "mesh_rms differs by -1.500 %" in told[0]


@pytest.mark.parametrize("name", ["taxel.cloud", "own: SciPy and NumPy", "small_gicp", "libigl"])
def test_candidates_answer_the_same_questions_alike(tool, name):
    answers = next(one for one in tool.candidates.CANDIDATES if one.name == name).load()
    mesh = get_builtin_models()["triangular_prism"]
    points = mesh.sample(300, seed=3) + 0.001
    if answers.align is not None:
        transform = answers.align(points, mesh.sample(300, seed=3))
        assert transform[:3, 3] == pytest.approx([-0.001] * 3, abs=1e-6)
    if answers.measure is not None:
        exact = mesh.find_closest(points).distance
        assert answers.measure(points, mesh.vertices, mesh.faces) == pytest.approx(exact, abs=1e-9)


def test_sizes_are_of_what_is_installed(tool):
    own, brought = tool.compare_libraries.size_mb("small_gicp")
    assert 0.1 < own <= brought < 20.0
    assert "cp311" in tool.compare_libraries.wheel("small_gicp") or sys.version_info[:2] != (3, 11)
