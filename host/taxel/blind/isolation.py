"""Isolation of a diagnosing process: it can read only its own folder and the Python installation."""

import os
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import taxel
from taxel.blind import landlock
from taxel.grasp.polytope_library import load_polytope_library

FORBIDDEN: Final = (
    "taxel.campaign",
    "taxel.cli",
    "taxel.emulated",
    "taxel.link.emulator",
    "taxel.native",
    "taxel.sim",
    "taxel.skin",
)
"""Modules with access to the hidden causes or to the emulator; in `taxel.blind` all but `ALLOWED_IN_BLIND`."""

ALLOWED_IN_BLIND: Final = ("isolation", "diagnosis_process", "landlock", "baselines")

SYSTEM_PATHS: Final = (
    "/dev/null",
    "/dev/urandom",
    "/etc/ld.so.cache",
    "/lib",
    "/lib64",
    "/proc/self/maps",
    "/usr/lib",
    "/usr/lib64",
)
"""Files for the loading of further libraries, and for the detection of loaded ones."""

SEALED_EVENTS: Final = (
    "os.exec",
    "os.fork",
    "os.posix_spawn",
    "os.spawn",
    "os.startfile",
    "os.system",
    "pty.spawn",
    "socket.",
    "subprocess.Popen",
)
"""Audit events of new processes and of networks, or prefixes of them (docs.python.org: audit events table)."""

READ_EVENTS: Final = ("os.listdir", "os.scandir", "os.chdir", "ctypes.dlopen")
WRITE_EVENTS: Final = ("os.link", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink", "os.truncate")

_WRITE_FLAGS: Final = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class SealedError(PermissionError):
    """An attempt to access something that a blind diagnosis must not see."""

    def __init__(self, resource: str) -> None:
        """Create the error of a forbidden access. resource: path, module or audit event that was accessed."""
        super().__init__(resource)

    def __str__(self) -> str:
        """Format the error as one line that names the resource."""
        return f"{self.args[0]} is sealed while a world is diagnosed"


def isolate_process(folder: Path, hidden: Sequence[Path] = ()) -> str:
    """Restrict the calling process irrevocably, so that a diagnosis cannot read the hidden causes.

    Afterwards the process can write below `folder`, and read `folder` and the Python installation. hidden: folders that
    are unreadable even inside the installation. Returns the enforcing mechanisms: "landlock and audit hook", or "audit
    hook" if the kernel has no Landlock.
    """
    sys.dont_write_bytecode = True
    import_module("taxel.recording")  # its dependency taxel.link imports the emulator, which is removed below
    load_polytope_library()  # its folder, which also contains the emulator, cannot be read below
    own_folder = Path(os.path.realpath(folder))
    sealed = (*_sealed_sources(), *(Path(os.path.realpath(path)) for path in hidden))
    readable = [path for root in _installation_folders() for path in _paths_without(root, sealed)]
    _remove_forbidden_modules()
    sys.meta_path.insert(0, _ImportGuard())
    has_landlock = landlock.restrict([*readable, own_folder], [own_folder])
    sys.addaudithook(_AccessHook(own_folder, (*readable, own_folder)))
    return "landlock and audit hook" if has_landlock else "audit hook"


def is_forbidden(module: str) -> bool:
    """Whether a module must not be imported during a blind diagnosis. module: full name, such as "taxel.blind.seal"."""
    package, _, name_in_blind = module.partition(".blind.")
    if package == "taxel" and name_in_blind:
        return name_in_blind not in ALLOWED_IN_BLIND
    return any(module == name or module.startswith(f"{name}.") for name in FORBIDDEN)


class _ImportGuard(MetaPathFinder):
    """Import finder that rejects the modules which a blind diagnosis must not use; placed before all other finders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Raise ImportError for a forbidden module; leave all other modules to the next finder (result None)."""
        if is_forbidden(fullname):
            raise ImportError(f"{fullname} is sealed while a world is diagnosed", name=fullname)
        return None


class _AccessHook:
    """Audit hook of Python that prevents forbidden access to files, processes and networks by an exception.

    folder: writable. readable: resolved paths, including `folder`.
    """

    def __init__(self, folder: Path, readable: Sequence[Path]) -> None:
        """Create the audit hook of a sandboxed process.

        folder: writable. readable: resolved paths, including `folder`.
        """
        self._folder, self._readable = folder, readable

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Check one audit event of Python; raises SealedError if it accesses a forbidden file, process or network.

        event: name of the event, such as "open". arguments: values of the event, defined by the Python documentation.
        """
        if event == "open":
            path, mode, flags = arguments
            self._check(path, _is_write(mode, flags))
        elif event in READ_EVENTS:
            self._check(arguments[0], False)
        elif event in WRITE_EVENTS:
            for path in arguments:
                self._check(path, True)
        elif event.startswith(SEALED_EVENTS):
            raise SealedError(event)

    def _check(self, name: Any, is_write: bool) -> None:
        """Raise SealedError for a file outside the permitted folders. name: path, file descriptor or None."""
        # A file descriptor belongs to a file that was checked when it was opened; None is the current folder.
        if name is None or isinstance(name, int):
            return
        path = Path(os.path.realpath(os.fsdecode(name)))
        roots = (self._folder,) if is_write else self._readable
        if not any(path.is_relative_to(root) for root in roots):
            raise SealedError(str(path))


def _is_write(mode: str | None, flags: int) -> bool:
    """Whether a file is opened for writing. mode: of Python's `open`, or None. flags: of the system call."""
    return bool(flags & _WRITE_FLAGS) or bool(mode and set(mode) & set("wax+"))


def _installation_folders() -> list[Path]:
    """List the folders of Python, of its packages and of the system that the sandboxed diagnosis may read."""
    paths = sysconfig.get_paths()
    roots = [sys.prefix, sys.base_prefix, *(paths[key] for key in ("stdlib", "platstdlib", "purelib", "platlib"))]
    return sorted({*(Path(os.path.realpath(root)) for root in (*roots, *SYSTEM_PATHS)), *_package_folders()})


def _package_folders() -> list[Path]:
    """List the folders of the packages `taxel` and `taxel_protocol`, which contain this project's modules."""
    import taxel_protocol

    return [Path(os.path.realpath(path)) for package in (taxel, taxel_protocol) for path in package.__path__]


def _sealed_sources() -> list[Path]:
    """List the source files and folders of the forbidden modules, which would otherwise be readable as text."""
    sealed = []
    for root in _package_folders():
        for name in FORBIDDEN:
            path = root.joinpath(*name.split(".")[1:])
            sealed += [path, path.with_suffix(".py")]
        allowed = (*ALLOWED_IN_BLIND, "__init__")
        sealed += [path for path in (root / "blind").glob("*.py") if path.stem not in allowed]
    return sealed


def _paths_without(root: Path, sealed: Sequence[Path]) -> Iterator[Path]:
    """Yield paths that together cover everything below `root` except the sealed paths."""
    if any(root.is_relative_to(path) for path in sealed):
        return
    if not any(path.is_relative_to(root) and path.exists() for path in sealed):
        yield root
        return
    for child in sorted(root.iterdir()):
        if not child.is_symlink():
            yield from _paths_without(child, sealed)


def _remove_forbidden_modules() -> None:
    """Remove sealed modules that `import taxel` has loaded, and the objects that other modules took from them."""
    for name in [name for name in sys.modules if is_forbidden(name)]:
        del sys.modules[name]
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] != "taxel":
            continue
        for key, value in list(vars(module).items()):
            origin = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(origin, str) and is_forbidden(origin):
                delattr(module, key)
