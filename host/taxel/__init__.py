"""taxel: host library of a mutual-capacitance tactile skin.

>>> import taxel
>>> with taxel.open("emulator:?speed=max&duration_s=10") as skin:
...     baseline = skin.take_baseline()
...     activation = taxel.Activation(baseline.mean)
...     scan = next(skin.scans())
...     int(activation(scan.raw_counts, scan.valid).active.sum())
0

The names of the package are imported at their first use, so that ``import taxel`` itself takes a few milliseconds.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from taxel.version import VERSION

__version__ = VERSION

if TYPE_CHECKING:
    from taxel.errors import TaxelError
    from taxel.hand import Hand, load_hand
    from taxel.signal import Activation, Baseline
    from taxel.skin import MultiSkin, Skin, SkinFrame
    from taxel.skin import open_skin as open
    from taxel.stream import TaxelFrame

__all__ = [
    "Activation",
    "Baseline",
    "Hand",
    "MultiSkin",
    "Skin",
    "SkinFrame",
    "TaxelError",
    "TaxelFrame",
    "__version__",
    "load_hand",
    "open",
]

_ORIGINS = {
    "Activation": ("taxel.signal", "Activation"),
    "Baseline": ("taxel.signal", "Baseline"),
    "Hand": ("taxel.hand", "Hand"),
    "MultiSkin": ("taxel.skin", "MultiSkin"),
    "Skin": ("taxel.skin", "Skin"),
    "SkinFrame": ("taxel.skin", "SkinFrame"),
    "TaxelError": ("taxel.errors", "TaxelError"),
    "TaxelFrame": ("taxel.stream", "TaxelFrame"),
    "load_hand": ("taxel.hand", "load_hand"),
    "open": ("taxel.skin", "open_skin"),
}


def __getattr__(name: str) -> Any:
    """Import a name of the package `taxel` from its module at the first access, which keeps `import taxel` fast."""
    if name not in _ORIGINS:
        raise AttributeError(f"module 'taxel' has no attribute '{name}'")
    module, attribute = _ORIGINS[name]
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the names of the package `taxel`, including those that are imported at their first access."""
    return sorted({*globals(), *__all__})
