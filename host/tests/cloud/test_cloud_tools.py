"""The comparison programs in tools/cloud."""

import importlib
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.cloud.models import get_builtin_models

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "cloud"
MODULES = (
    "candidates",
    "cloudcompare",
    "compare_cloudcompare",
    "compare_file_libraries",
    "compare_libraries",
    "file_libraries",
    "file_measurements",
    "measure_fusion",
)


@pytest.fixture(scope="module")
def tools():
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
    for name in MODULES:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def test_missing_cloudcompare_is_reported_with_its_package(tools, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["compare_cloudcompare.py", "real.h5", "sim.h5"])
    assert tools.compare_cloudcompare.main() == 2
    expected = "compare_cloudcompare: CloudCompare is missing: apt-get install cloudcompare\n"
    assert capsys.readouterr().err == expected


FAKE_CLOUDCOMPARE = """#!{python}
import sys
arguments = sys.argv[1:]
names = arguments[arguments.index("-SAVE_CLOUDS") + 2].split()
open(arguments[arguments.index("-LOG_FILE") + 1], "w").write("[10:00:00] RMS: 0.00125\\n")
for name in names:
    open(name, "w").write("0.1 0.2 0.3 -0.004\\n0.1 0.2 0.5 0.002\\n" if name != "other.asc" else "")
"""


def test_output_files_of_cloudcompare_are_read_and_its_failure_is_reported(tools, tmp_path):
    program = tmp_path / "CloudCompare"
    program.write_text(FAKE_CLOUDCOMPARE.format(python=sys.executable))
    program.chmod(0o755)
    runner = tools.cloudcompare.CloudCompare(str(program), tmp_path)
    cloud = runner.save("cloud", np.zeros((2, 3)))
    # The substitute for CloudCompare writes the distances -0.004 and 0.002 m, and an RMS of 0.00125 m.
    assert runner.measure_to_mesh(cloud, "mesh.ply").tolist() == [0.004, 0.002]
    points, rms = runner.align(cloud, "target.xyz")
    assert (points.shape, rms) == ((2, 3), 0.00125)
    program.write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(RuntimeError, match=r"-C2C_DIST .* CloudCompare failed: 3"):
        runner.measure_to_cloud(cloud, cloud)


def test_every_exceeded_bound_is_listed(tools):
    """The RMS to the mesh, the agreement of the filters, the RMS after ICP to the mesh and the speed exceed a bound.

    A difference of -5 % of the RMS after ICP to the cloud is permitted: taxel.cloud then has the smaller RMS.
    """
    row = tools.compare_cloudcompare.Row("cloud", 10, 0.1, -1.5, 0.0, 0.0, 98.0, 2.0, -5.0)
    speed = tools.compare_cloudcompare.Speed("cloud", 22, 1.0, 9.0, 0.0, 0.0)
    violations = tools.compare_cloudcompare.list_violations([row], speed)
    assert [line.split(":")[0] for line in violations] == ["cloud", "cloud", "cloud", "sweep"]
    assert "mesh_rms differs by -1.500 %" in violations[0]


@pytest.mark.parametrize("name", ["taxel.cloud", "reference: SciPy and NumPy", "small_gicp", "libigl"])
def test_compared_library_reverses_a_shift_and_measures_the_exact_distances(tools, name):
    operations = next(candidate for candidate in tools.candidates.CANDIDATES if candidate.name == name).load()
    mesh = get_builtin_models()["triangular_prism"]
    points = mesh.sample(300, seed=3) + 0.001
    if operations.align is not None:
        transform = operations.align(points, mesh.sample(300, seed=3))
        assert transform[:3, 3] == pytest.approx([-0.001] * 3, abs=1e-6)
    if operations.measure is not None:
        exact = mesh.find_closest(points).distance
        assert operations.measure(points, mesh.vertices, mesh.faces) == pytest.approx(exact, abs=1e-9)


def test_size_and_python_version_of_an_installed_wheel_are_reported(tools):
    package_mb, total_mb = tools.compare_libraries.measure_size_mb("small_gicp")
    assert 0.1 < package_mb <= total_mb < 20.0
    assert "cp311" in tools.compare_libraries.describe_wheel("small_gicp") or sys.version_info[:2] != (3, 11)


def test_taxel_reads_all_valid_and_refuses_all_malformed_sample_files(tools, tmp_path):
    measurements = tools.file_measurements
    library = tools.file_libraries.load_taxel()
    samples = tomllib.loads(tools.compare_file_libraries.SAMPLES.read_text(encoding="ascii"))
    valid = measurements.check_valid_files(library, samples["valid"], tmp_path)
    malformed = measurements.check_malformed_files(library, samples["malformed"], tmp_path)
    assert [result for result in valid if result["outcome"] != measurements.CORRECT] == []
    assert [result for result in malformed if result["outcome"] != measurements.REFUSED] == []
