"""What a diagnosing process may see: copied files in its own folder, and the Python installation."""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import taxel
from taxel.blind import landlock

FORBIDDEN: Final = (
    "taxel.campaign",
    "taxel.cli",
    "taxel.emulated",
    "taxel.link.emulator",
    "taxel.native",
    "taxel.sim",
    "taxel.skin",
)
"""Modules that know how worlds are made; of `taxel.blind` all but `ALLOWED_HERE`."""

ALLOWED_HERE: Final = ("blindfold", "diagnosing", "landlock", "simpler")

SYSTEM: Final = (
    "/dev/null",
    "/dev/urandom",
    "/etc/ld.so.cache",
    "/lib",
    "/lib64",
    "/proc/self/maps",
    "/usr/lib",
    "/usr/lib64",
)
"""What libraries that are loaded late need, and what finds out which are loaded."""

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
"""Audit events of other processes and of networks, or how their names begin (docs.python.org: audit events table)."""

READING_EVENTS: Final = ("os.listdir", "os.scandir", "os.chdir", "ctypes.dlopen")
CHANGING_EVENTS: Final = ("os.link", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink", "os.truncate")

_CHANGING_FLAGS: Final = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class SealedError(PermissionError):
    """Something was asked for that a blind diagnosis must not see."""

    def __init__(self, what: str) -> None:
        super().__init__(what)

    def __str__(self) -> str:
        return f"{self.args[0]} is sealed while a world is diagnosed"


def blindfold(folder: Path, sealed: Sequence[Path] = ()) -> str:
    """From here on this process sees files below `folder`, where alone it writes, and the Python installation.

    sealed: folders that stay unseen even if they lie in that installation. It cannot be undone. Returns what holds:
    "landlock and audit hook", or "audit hook" where the kernel has no Landlock.
    """
    sys.dont_write_bytecode = True
    own = Path(os.path.realpath(folder))
    unseen = (*_code_sealed(), *(Path(os.path.realpath(path)) for path in sealed))
    readable = [path for root in _installation() for path in _without(root, unseen)]
    _forget()
    sys.meta_path.insert(0, _Guard())
    kernel = landlock.restrict([*readable, own], [own])
    sys.addaudithook(_Watch(own, (*readable, own)))
    return "landlock and audit hook" if kernel else "audit hook"


def is_forbidden(module: str) -> bool:
    """Whether a module's name stands for something that is sealed."""
    package, _, rest = module.partition(".blind.")
    if package == "taxel" and rest:
        return rest not in ALLOWED_HERE
    return any(module == name or module.startswith(f"{name}.") for name in FORBIDDEN)


class _Guard(MetaPathFinder):
    """Stands before all other finders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if is_forbidden(fullname):
            raise ImportError(f"{fullname} is sealed while a world is diagnosed", name=fullname)
        return None


class _Watch:
    """An audit hook; what it refuses does not happen. readable: resolved; `folder` is among them."""

    def __init__(self, folder: Path, readable: Sequence[Path]) -> None:
        self._folder, self._readable = folder, readable

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = arguments
            self._check(path, _changes(mode, flags))
        elif event in READING_EVENTS:
            self._check(arguments[0], False)
        elif event in CHANGING_EVENTS:
            for path in arguments:
                self._check(path, True)
        elif event.startswith(SEALED_EVENTS):
            raise SealedError(event)

    def _check(self, name: Any, changes: bool) -> None:
        # An open file's number stands for a file that was checked when it was opened; None for the own folder.
        if name is None or isinstance(name, int):
            return
        path = Path(os.path.realpath(os.fsdecode(name)))
        roots = (self._folder,) if changes else self._readable
        if not any(path.is_relative_to(root) for root in roots):
            raise SealedError(str(path))


def _changes(mode: str | None, flags: int) -> bool:
    return bool(flags & _CHANGING_FLAGS) or bool(mode and set(mode) & set("wax+"))


def _installation() -> list[Path]:
    paths = sysconfig.get_paths()
    roots = [sys.prefix, sys.base_prefix, *(paths[key] for key in ("stdlib", "platstdlib", "purelib", "platlib"))]
    return sorted({*(Path(os.path.realpath(root)) for root in (*roots, *SYSTEM)), *_code()})


def _code() -> list[Path]:
    """Where this library's modules and compiled parts lie."""
    import taxel_protocol

    return [Path(os.path.realpath(path)) for package in (taxel, taxel_protocol) for path in package.__path__]


def _code_sealed() -> list[Path]:
    """Files and folders of what is not to be imported, readable as text otherwise."""
    sealed = []
    for root in _code():
        for name in FORBIDDEN:
            part = root.joinpath(*name.split(".")[1:])
            sealed += [part, part.with_suffix(".py")]
        sealed += [path for path in (root / "blind").glob("*.py") if path.stem not in (*ALLOWED_HERE, "__init__")]
    return sealed


def _without(root: Path, sealed: Sequence[Path]) -> Iterator[Path]:
    """`root`, or so much of what lies in it that nothing sealed is below."""
    if any(root.is_relative_to(path) for path in sealed):
        return
    if not any(path.is_relative_to(root) and path.exists() for path in sealed):
        yield root
        return
    for child in sorted(root.iterdir()):
        if not child.is_symlink():
            yield from _without(child, sealed)


def _forget() -> None:
    """Sealed modules that came along with `import taxel`, and what others took from them."""
    for name in [name for name in sys.modules if is_forbidden(name)]:
        del sys.modules[name]
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] != "taxel":
            continue
        for key, value in list(vars(module).items()):
            home = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(home, str) and is_forbidden(home):
                delattr(module, key)
