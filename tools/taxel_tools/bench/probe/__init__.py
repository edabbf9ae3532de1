"""Probes that indent single taxels of a board on a bench."""

from taxel_tools.bench.probe.base import NoProbe, Probe, ProbeError, ProbeRequest
from taxel_tools.bench.probe.manual import ManualProbe

__all__ = ["ManualProbe", "NoProbe", "Probe", "ProbeError", "ProbeRequest"]
