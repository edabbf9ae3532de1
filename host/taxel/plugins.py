"""Plug-ins: objects that installed packages add to a group of entry points.

A group is a table of names. The names of this package are a mapping from name to ``"module:attribute"``; another
package adds names by entry points of the group (see docs/how-to-write-a-plugin.md). A module is imported when its
object is loaded.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any, Final

from taxel.errors import TaxelError

LINKS: Final = "taxel.links"
"""URL schemes. Object: a function ``(url: str, hand: taxel.hand.Hand | None) -> taxel.link.Link``."""
EFFECTS: Final = "taxel.effects"
"""Effects of the diagnosis. Object: a sequence of `taxel.gap.effects.effect.Effect`, the variants of one effect."""
DIAGNOSES: Final = "taxel.diagnoses"
"""Diagnoses that `taxel gap benchmark` scores. Object: a function ``(real: Path, sim: Path, seed: int) ->
Mapping[str, float]`` that returns the probability of each effect, of "unknown" and of "no_gap"."""
IMPORTERS: Final = "taxel.importers"
"""Importers of grasp datasets. Object: a typer function that becomes the command ``taxel import NAME``."""
BENCH_PHASES: Final = "taxel.bench_phases"
"""Phases of the board test. Object: a callable that returns a `taxel_tools.testing.engine.Phase`."""
BENCH_PROBES: Final = "taxel.bench_probes"
"""Probes of the board test. Object: a function ``(taxel_tools.bench.probe.ProbeRequest) -> Probe``."""
HIL_DRIVERS: Final = "taxel.hil_drivers"
"""Drivers of the hardware-in-the-loop harness, named ``DEVICE.DRIVER``. Object: a class; see hil_tests/harness."""
COMMANDS: Final = "taxel.commands"
"""Commands of the program ``taxel``. Object: a typer function or a `typer.Typer` group."""

OWN_DISTRIBUTION: Final = "taxel"
"""Distribution whose entry points belong to the project itself."""

NO_NAMES: Final[Mapping[str, str]] = MappingProxyType({})


class PluginError(TaxelError):
    """An entry point cannot be used. The message names the group, the entry point and the distribution."""


def list_plugin_names(group: str, built_in: Mapping[str, str] = NO_NAMES) -> tuple[str, ...]:
    """List all names of a group of plug-ins: the project's own names, then the sorted names of other packages.

    group: group of entry points. built_in: the project's own objects, as "module:attribute", by name. Raises
    `PluginError` if two distributions use the same name.
    """
    return (*built_in, *sorted(_list_added_points(group, built_in)))


def load_plugin(group: str, name: str, built_in: Mapping[str, str] = NO_NAMES) -> Any:
    """Load the object that a name of a group of plug-ins stands for.

    group: group of entry points. built_in: the project's own objects, as "module:attribute", by name. Raises `KeyError`
    for an unknown name, `PluginError` if two distributions use the same name or if the import of another package's
    object fails. An import error of the project's own objects is raised unchanged.
    """
    if name in built_in:
        module, _, attribute = built_in[name].partition(":")
        return getattr(import_module(module), attribute)
    point = _list_added_points(group, built_in)[name]
    try:
        return point.load()
    except Exception as error:  # a plug-in may raise anything while it is imported
        if _distribution_name(point) == OWN_DISTRIBUTION:
            raise
        raise PluginError(
            f"entry point '{name}' of group '{group}' in package '{_distribution_name(point)}' cannot be loaded "
            f"({type(error).__name__}: {error}); correct or uninstall that package"
        ) from error


def unusable_plugin(group: str, name: str, problem: str) -> PluginError:
    """Return the one-line error for a plug-in whose object was loaded but cannot be used; it names the package.

    group, name: group and name of the entry point. problem: what was expected and what was found.
    """
    text = f"entry point '{name}' of group '{group}' in package '{plugin_distribution(group, name)}' cannot be used"
    return PluginError(f"{text} ({' '.join(problem.split())}); correct or uninstall that package")


def plugin_distribution(group: str, name: str) -> str:
    """Return the name of the installed package that adds an entry point; "taxel" for a name without an entry point.

    group, name: group and name of the entry point.
    """
    return next(
        (_distribution_name(point) for point in _list_entry_points(group) if point.name == name), OWN_DISTRIBUTION
    )


def _list_added_points(group: str, built_in: Mapping[str, str]) -> dict[str, EntryPoint]:
    """Return the entry points that are added to a group, by name.

    Entry points of the project that repeat a built-in object are left out. Raises `PluginError` if two packages use the
    same name for different objects.
    """
    added: dict[str, EntryPoint] = {}
    for point in _list_entry_points(group):
        if built_in.get(point.name) == point.value:
            continue
        if point.name in built_in or (point.name in added and added[point.name].value != point.value):
            first = "taxel" if point.name in built_in else _distribution_name(added[point.name])
            raise PluginError(
                f"entry point '{point.name}' of group '{group}' is in two packages, '{first}' and "
                f"'{_distribution_name(point)}'; uninstall one of them"
            )
        added[point.name] = point
    return added


def refresh_plugins() -> None:
    """Read the installed entry points again, after a package was installed or removed while the program runs."""
    _list_entry_points.cache_clear()


@cache
def _list_entry_points(group: str) -> tuple[EntryPoint, ...]:
    """List the installed entry points of a group; cached until `refresh_plugins`."""
    return tuple(entry_points(group=group))


def _distribution_name(point: EntryPoint) -> str:
    """Return the name of the package that installs an entry point."""
    return point.dist.name if point.dist is not None else point.value
