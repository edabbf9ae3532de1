"""All targets by name."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from fuzz_files.target import Target

FAMILIES: Final = ("recordings", "descriptions", "firmware", "geometry", "datasets", "imports", "stored", "emulator")


def list_targets() -> dict[str, Target]:
    """Return all targets by name, family by family."""
    modules = [import_module(f"fuzz_files.targets.{family}") for family in FAMILIES]
    return {target.name: target for module in modules for target in module.TARGETS}
