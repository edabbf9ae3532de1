"""What presses a board on a bench."""

from taxel_tools.bench.probe.base import NoProbe, Probe, ProbeError
from taxel_tools.bench.probe.manual import ManualProbe

__all__ = ["ManualProbe", "NoProbe", "Probe", "ProbeError"]
