"""Isolation of the diagnosing process: it can access its folder and the Python installation, but no hidden cause."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import taxel.emulated
from taxel.blind import landlock
from taxel.blind.isolation import FORBIDDEN, is_forbidden

ISOLATED_PROGRAM = """
import ctypes, importlib, json, os, socket, subprocess, sys
from pathlib import Path
from taxel.blind import isolation

own, out, has_landlock = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3] == "landlock"
code = Path(isolation.__file__).parents[1]
if not has_landlock:
    isolation.landlock.restrict = lambda readable, writable: False
mechanism = isolation.isolate_process(own, [out])
import h5py
import taxel
from taxel.gap.diagnosis import diagnose
from taxel.blind.baselines import compute_baseline_verdicts

def open_in_c(path):
    number = ctypes.CDLL(None, use_errno=True).open(str(path).encode(), os.O_RDONLY)
    if number < 0:
        raise OSError(ctypes.get_errno(), "C open")

def execute_in_c():
    name = b"/bin/true"
    ctypes.CDLL(None, use_errno=True).execl(name, name, None)
    raise OSError(ctypes.get_errno(), "C exec")

class PathLike:
    def __fspath__(self):
        return str(out / "sealed/keys.json")

keys = out / "sealed/keys.json"
(own / "link").symlink_to(own / "here.txt")
attempts = {name: lambda name=name: importlib.import_module(name) for name in json.loads(sys.argv[4])}
attempts |= {
    "keys": lambda: open(keys),
    "keys by os": lambda: os.open(keys, os.O_RDONLY),
    "keys by relative path": lambda: open(own / ".." / own.name / ".." / out.name / "sealed" / "keys.json"),
    "keys by proc": lambda: open(f"/proc/self/root{keys}"),
    "keys by bytes": lambda: open(bytes(keys)),
    "keys by path-like object": lambda: open(PathLike()),
    "folder of keys": lambda: os.listdir(out / "sealed"),
    "folder of worlds": lambda: os.scandir(out / "worlds"),
    "link to keys": lambda: os.symlink(keys, out / "link"),
    "neighbour": lambda: open(own.parent / "neighbour.txt"),
    "parent's environment": lambda: open(f"/proc/{os.getppid()}/environ"),
    "source of the causes": lambda: open(code / "blind" / "catalogue_causes.py"),
    "library of the emulator": lambda: ctypes.CDLL(str(Path(json.loads(sys.argv[5])))),
    "write to the package": lambda: open(code / "gap" / "note.txt", "w"),
    "write to the parent folder": lambda: open(own.parent / "note.txt", "w"),
    "remove": lambda: os.remove(own.parent / "neighbour.txt"),
    "program": lambda: subprocess.run(["true"]),
    "shell": lambda: os.system("true"),
    "fork": lambda: os.fork(),
    "exec": lambda: os.execv("/bin/true", ["true"]),
    "spawn": lambda: os.posix_spawn("/bin/true", ["true"], {}),
    "socket": lambda: socket.socket(),
    "emulator by attribute": lambda: taxel.open("emulator:"),
    "runner by attribute": lambda: taxel.link.run_emulator,
}
if has_landlock:
    attempts |= {
        "keys by C": lambda: open_in_c(keys),
        "dataset by HDF5": lambda: h5py.File(out / "worlds" / "other.h5", "r"),
        "program by C": execute_in_c,
    }
errors = {}
for name, attempt in attempts.items():
    try:
        attempt()
        errors[name] = ""
    except (ImportError, OSError, AttributeError) as error:
        errors[name] = f"{type(error).__name__}: {error}"
(own / "written.txt").write_text("x")
allowed = [(own / "here.txt").read_text(), (own / "link").read_text(), sorted(os.listdir(own))]
print(json.dumps({"mechanism": mechanism, "errors": errors, "allowed": allowed, "modules": sorted(sys.modules)}))
"""

SEALED_BLIND_MODULES = ("sampling", "hidden", "catalogue_causes", "world_datasets", "run", "seal")
SEALED_MODULES = [
    *FORBIDDEN,
    "taxel.emulated.contact",
    *(f"taxel.blind.{name}" for name in SEALED_BLIND_MODULES),
]


@pytest.fixture(scope="module", params=["landlock", pytest.param("audit hook only", marks=pytest.mark.slow)])
def report(request, tmp_path_factory):
    """Run a process that isolates itself and tries forbidden accesses; return the error of each attempt.

    Further keys: enforcing mechanism, requested mechanism, permitted accesses, loaded modules.
    """
    if request.param == "landlock" and not landlock.version():
        pytest.skip("the kernel has no Landlock")
    base = tmp_path_factory.mktemp("isolation")
    own_folder, out = base / "own", base / "check"
    for folder in (own_folder, out / "sealed", out / "worlds"):
        folder.mkdir(parents=True)
    (own_folder / "here.txt").write_text("own text")
    (base / "neighbour.txt").write_text("")
    (out / "sealed" / "keys.json").write_text("[]")
    h5py.File(out / "worlds" / "other.h5", "w").close()
    arguments = [
        str(own_folder),
        str(out),
        request.param,
        json.dumps(SEALED_MODULES),
        json.dumps(str(find_contact_library())),
    ]
    result = subprocess.run(
        [sys.executable, "-c", ISOLATED_PROGRAM, *arguments],
        cwd=own_folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return {**json.loads(result.stdout), "requested": request.param}


def find_contact_library() -> Path:
    """Return the path of the shared library of the emulated contact."""
    folders = (Path(path).parent / "native" for path in taxel.emulated.__path__)
    packaged = [Path(path) / "native" for path in taxel.__path__]
    return next(path / "libtaxel_contact.so" for path in (*packaged, *folders) if path.exists())


def test_isolation_states_whether_landlock_enforces_it(report):
    expected = "landlock and audit hook" if report["requested"] == "landlock" else "audit hook"
    assert report["mechanism"] == expected


def test_every_attempt_to_access_modules_files_programs_or_networks_fails(report):
    assert [name for name, error in report["errors"].items() if not error] == []


def test_errors_of_forbidden_accesses_state_that_the_resource_is_sealed(report):
    sealed = [name for name in report["errors"] if name.startswith(("taxel.", "keys", "folder", "program", "fork"))]
    assert all("sealed while" in report["errors"][name] for name in sealed if not name.endswith("by C"))


def test_no_forbidden_module_is_loaded_after_the_isolation(report):
    assert [name for name in report["modules"] if is_forbidden(name)] == []


def test_folder_of_the_isolated_process_is_readable_and_writable(report):
    assert report["allowed"][:2] == ["own text", "own text"]
    assert report["allowed"][2] == ["here.txt", "link", "written.txt"]


def test_module_names_are_compared_by_whole_components():
    assert is_forbidden("taxel.emulated.contact")
    assert is_forbidden("taxel.blind.catalogue_causes")
    assert not is_forbidden("taxel.blind.baselines")
    assert not is_forbidden("taxel.simulated")
    assert not is_forbidden("taxel.link")
    assert not is_forbidden("other.blind.catalogue_causes")


def test_diagnosing_process_answers_a_failed_diagnosis_with_an_error_and_continues(tmp_path):
    files = {"real": "no.h5", "sim": "no.h5", "out": "report.json"}
    job = json.dumps({**files, "without": [], "seed": 0, "shares_cores": True})
    result = subprocess.run(
        [sys.executable, "-m", "taxel.blind.diagnosis_process", str(tmp_path)],
        cwd=tmp_path,
        input=f"{job}\n{job}\n",
        capture_output=True,
        text=True,
        check=True,
    )
    first_answer, second_answer = result.stdout.splitlines()
    assert json.loads(first_answer)["error"].startswith("DatasetError: no.h5")
    assert first_answer == second_answer
