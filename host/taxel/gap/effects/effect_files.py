"""Effects from a Python file of the user, for one run of a command: `taxel gap diagnose --effects FILE`."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

from taxel.gap.effects.catalogue import OWN_EFFECTS, add_effects
from taxel.gap.effects.effect import Effect
from taxel.gap.errors import GapInputError

VARIANTS = "VARIANTS"
"""Name of the variable in the file: a sequence of `Effect` objects, the variants of one or several effects."""

REMEDY = "see docs/how-to-add-an-effect.md"


def add_effect_file(path: Path) -> list[str]:
    """Run a Python file, add its effects to the catalogue of this process, and return the names of these effects.

    Raises `GapInputError` for a file that cannot be run, that has no sequence `VARIANTS` of effects, or that uses the
    name of an effect of the project.
    """
    spec = importlib.util.spec_from_file_location(f"taxel_effects_{path.stem}", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise GapInputError("--effects", "a Python file with the extension .py", str(path), REMEDY)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # the decorator of a dataclass in the file reads its module from sys.modules
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise GapInputError(str(path), "a Python file that can be run", reason, REMEDY) from None
    variants = getattr(module, VARIANTS, None)
    if not isinstance(variants, Sequence) or not variants or not all(isinstance(item, Effect) for item in variants):
        raise GapInputError(
            str(path), f"{VARIANTS}, a tuple of taxel.gap.effects.effect.Effect", repr(variants), REMEDY
        )
    names = list(dict.fromkeys(variant.name for variant in variants))
    for name in names:
        if name in OWN_EFFECTS:
            raise GapInputError(str(path), "a name that no effect of the project has", repr(name), "use another name")
    add_effects({name: tuple(variant for variant in variants if variant.name == name) for name in names})
    return names
