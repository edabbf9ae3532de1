"""What a diagnosing process can see: its own folder and the Python installation, and nothing that knows the truth."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import taxel.emulated
from taxel.blind import landlock
from taxel.blind.blindfold import FORBIDDEN, is_forbidden

CHECK = """
import ctypes, importlib, json, os, socket, subprocess, sys
from pathlib import Path
from taxel.blind import blindfold as module

own, out, kernel = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3] == "kernel"
code = Path(module.__file__).parents[1]
if not kernel:
    module.landlock.restrict = lambda readable, writable: False
held_by = module.blindfold(own, [out])
import h5py
import taxel
from taxel.gap.diagnosis import diagnose
from taxel.blind.simpler import simpler_answers

def opened_by_c(path):
    number = ctypes.CDLL(None, use_errno=True).open(str(path).encode(), os.O_RDONLY)
    if number < 0:
        raise OSError(ctypes.get_errno(), "C open")

def started_by_c():
    name = b"/bin/true"
    ctypes.CDLL(None, use_errno=True).execl(name, name, None)
    raise OSError(ctypes.get_errno(), "C exec")

class Disguised:
    def __fspath__(self):
        return str(out / "sealed/keys.json")

keys = out / "sealed/keys.json"
(own / "link").symlink_to(own / "here.txt")
tries = {name: lambda name=name: importlib.import_module(name) for name in json.loads(sys.argv[4])}
tries |= {
    "keys": lambda: open(keys),
    "keys by os": lambda: os.open(keys, os.O_RDONLY),
    "keys by detour": lambda: open(own / ".." / own.name / ".." / out.name / "sealed" / "keys.json"),
    "keys by proc": lambda: open(f"/proc/self/root{keys}"),
    "keys by bytes": lambda: open(bytes(keys)),
    "keys in disguise": lambda: open(Disguised()),
    "folder of keys": lambda: os.listdir(out / "sealed"),
    "folder of others": lambda: os.scandir(out / "worlds"),
    "link to keys": lambda: os.symlink(keys, out / "link"),
    "neighbour": lambda: open(own.parent / "neighbour.txt"),
    "parent's environment": lambda: open(f"/proc/{os.getppid()}/environ"),
    "words of the emulator": lambda: open(code / "blind" / "kinds.py"),
    "library of the emulator": lambda: ctypes.CDLL(str(Path(json.loads(sys.argv[5])))),
    "write beside code": lambda: open(code / "gap" / "told.txt", "w"),
    "write elsewhere": lambda: open(own.parent / "told.txt", "w"),
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
if kernel:
    tries |= {
        "keys by C": lambda: opened_by_c(keys),
        "dataset by HDF5": lambda: h5py.File(out / "worlds" / "other.h5", "r"),
        "program by C": started_by_c,
    }
found = {}
for name, attempt in tries.items():
    try:
        attempt()
        found[name] = ""
    except (ImportError, OSError, AttributeError) as error:
        found[name] = f"{type(error).__name__}: {error}"
(own / "written.txt").write_text("x")
allowed = [(own / "here.txt").read_text(), (own / "link").read_text(), sorted(os.listdir(own))]
print(json.dumps({"held_by": held_by, "found": found, "allowed": allowed, "seen": sorted(sys.modules)}))
"""

HERE = ("drawing", "hidden", "kinds", "making", "run", "seal")
UNTOLD = [*FORBIDDEN, "taxel.emulated.contact", *(f"taxel.blind.{name}" for name in HERE)]


@pytest.fixture(scope="module", params=["kernel", "hook alone"])
def report(request, tmp_path_factory):
    """What a blindfolded process could do and not do."""
    if request.param == "kernel" and not landlock.version():
        pytest.skip("the kernel has no Landlock")
    base = tmp_path_factory.mktemp("blindfold")
    own, out = base / "own", base / "check"
    for folder in (own, out / "sealed", out / "worlds"):
        folder.mkdir(parents=True)
    (own / "here.txt").write_text("mine")
    (base / "neighbour.txt").write_text("")
    (out / "sealed" / "keys.json").write_text("[]")
    h5py.File(out / "worlds" / "other.h5", "w").close()
    arguments = [str(own), str(out), request.param, json.dumps(UNTOLD), json.dumps(str(contact_library()))]
    done = subprocess.run(
        [sys.executable, "-c", CHECK, *arguments], cwd=own, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return {**json.loads(done.stdout), "asked": request.param}


def contact_library() -> Path:
    folders = (Path(path).parent / "native" for path in taxel.emulated.__path__)
    packaged = [Path(path) / "native" for path in taxel.__path__]
    return next(path / "libtaxel_contact.so" for path in (*packaged, *folders) if path.exists())


def test_it_says_what_holds(report):
    assert report["held_by"] == ("landlock and audit hook" if report["asked"] == "kernel" else "audit hook")


def test_nothing_that_knows_the_truth_can_be_imported_opened_or_started(report):
    assert [name for name, error in report["found"].items() if not error] == []
    sealed = [name for name in report["found"] if name.startswith(("taxel.", "keys", "folder", "program", "fork"))]
    assert all("sealed while" in report["found"][name] for name in sealed if not name.endswith("by C"))


def test_nothing_of_it_was_imported_before(report):
    assert [name for name in report["seen"] if is_forbidden(name)] == []


def test_its_own_folder_is_open_to_it(report):
    assert report["allowed"][:2] == ["mine", "mine"]
    assert report["allowed"][2] == ["here.txt", "link", "written.txt"]


def test_names_of_modules_are_judged_whole():
    assert is_forbidden("taxel.emulated.contact")
    assert is_forbidden("taxel.blind.kinds")
    assert not is_forbidden("taxel.blind.simpler")
    assert not is_forbidden("taxel.simulated")
    assert not is_forbidden("taxel.link")
    assert not is_forbidden("other.blind.kinds")


def test_the_process_answers_with_an_error_and_goes_on(tmp_path):
    job = json.dumps({"real": "no.h5", "sim": "no.h5", "without": [], "seed": 0, "out": "report.json"})
    done = subprocess.run(
        [sys.executable, "-m", "taxel.blind.diagnosing", str(tmp_path)],
        cwd=tmp_path,
        input=f"{job}\n{job}\n",
        capture_output=True,
        text=True,
        check=True,
    )
    first, second = done.stdout.splitlines()
    assert json.loads(first)["error"].startswith("DatasetError: no.h5")
    assert first == second
