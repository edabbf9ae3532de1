"""Phases and probes of the bench: those of the project, and those that other packages add by entry points.

A phase is added by an entry point of the group ``taxel.bench_phases``. Its name is the name of the phase in plans, and
its object is a callable without arguments, such as a class, that returns a `taxel_tools.testing.engine.Phase`. The
context of the phase is a `taxel_tools.bench.board_under_test.BoardUnderTest`.

A probe is added by an entry point of the group ``taxel.bench_probes``. Its name is the value of ``--probe``, or the
part of this value before the first colon. Its object is a callable that takes a
`taxel_tools.bench.probe.ProbeRequest` and returns a `taxel_tools.bench.probe.Probe`.
"""

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Final

from taxel.errors import TaxelError
from taxel.plugins import BENCH_PHASES, BENCH_PROBES, list_plugin_names, load_plugin, unusable_plugin
from taxel_tools.bench.probe.base import Probe, ProbeError, ProbeRequest
from taxel_tools.testing.engine import Phase

PHASES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "identify": "taxel_tools.bench.phases.identify:Identify",
        "electrical": "taxel_tools.bench.phases.electrical:Electrical",
        "rest": "taxel_tools.bench.phases.rest:Rest",
        "noise": "taxel_tools.bench.phases.noise:Noise",
        "drift": "taxel_tools.bench.phases.drift:Drift",
        "frames": "taxel_tools.bench.phases.frames:Frames",
        "presses": "taxel_tools.bench.phases.indentations:EachTaxel",
        "loading": "taxel_tools.bench.phases.loading:Loading",
        "small_forces": "taxel_tools.bench.phases.small_forces:SmallForces",
        "soak": "taxel_tools.bench.phases.soak:Soak",
        "faults": "taxel_tools.bench.phases.faults:Faults",
    }
)
"""Phases of the project, by their names in plans."""

PROBES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "none": "taxel_tools.bench.probe.base:open_no_probe",
        "operator": "taxel_tools.bench.probe.manual:open_manual_probe",
        "emulated": "taxel_tools.bench.probe.emulated:open_emulated_probe",
        "gcode": "taxel_tools.bench.probe.gcode:open_gcode_probe",
    }
)
"""Probes of the project, by the name in ``--probe``."""


def list_phase_names() -> tuple[str, ...]:
    """List the names of all phases of a board test, including those of plug-ins.

    Raises `PluginError` if two packages use one name.
    """
    return list_plugin_names(BENCH_PHASES, PHASES)


def load_phases(names: Collection[str]) -> tuple[Phase, ...]:
    """Load phases of a board test by name, in the order of `list_phase_names()`; unknown names are ignored.

    Raises `PluginError` with a one-line message that names entry point and distribution, for a phase that cannot be
    used.
    """
    return tuple(_load_phase(name) for name in list_phase_names() if name in names)


def _load_phase(name: str) -> Phase:
    """Load a test phase by name, from this package or a plug-in. Raises an error that names the plug-in if it is
    unusable.
    """
    factory = load_plugin(BENCH_PHASES, name, PHASES)
    try:
        phase = factory()
    except Exception as error:  # A plug-in may raise any exception.
        raise unusable_plugin(BENCH_PHASES, name, f"{type(error).__name__}: {error}") from error
    if not isinstance(phase, Phase):
        raise unusable_plugin(BENCH_PHASES, name, f"expected a phase, found an object of type {type(phase).__name__}")
    if phase.name != name:
        raise unusable_plugin(BENCH_PHASES, name, f"expected the phase name '{name}', found '{phase.name}'")
    return phase


def open_probe(request: ProbeRequest) -> Probe:
    """Open the probe that `request.url` names. Raises `TaxelError` with a one-line message."""
    name = request.url.partition(":")[0]
    names = list_plugin_names(BENCH_PROBES, PROBES)
    if name not in names:
        raise ProbeError(f"--probe: expected one of {', '.join(names)}, found '{request.url}'")
    factory = load_plugin(BENCH_PROBES, name, PROBES)
    try:
        probe = factory(request)
    except (TaxelError, OSError):
        raise
    except Exception as error:  # A plug-in may raise any exception.
        raise unusable_plugin(BENCH_PROBES, name, f"{type(error).__name__}: {error}") from error
    if not isinstance(probe, Probe):
        raise unusable_plugin(BENCH_PROBES, name, f"expected a probe, found an object of type {type(probe).__name__}")
    return probe
