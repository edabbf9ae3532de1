"""CloudCompare 2.11 through its command line, headless: its distances, outlier filter and alignment.

Its C2M distances are signed there, so their absolute values are taken. Coordinates pass through single precision.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from taxel.types import FloatArray

PROGRAMS: Final = ("CloudCompare", "cloudcompare")
PACKAGE: Final = "cloudcompare"
LIMIT_S: Final = 300.0
COMMON: Final = ("-C_EXPORT_FMT", "ASC", "-PREC", "10", "-NO_TIMESTAMP", "-AUTO_SAVE", "OFF")
ICP: Final = ("-ICP", "-ITER", "1000", "-OVERLAP", "100", "-RANDOM_SAMPLING_LIMIT", "100000")
"""As in the thesis (5.6): 1000 iterations, full overlap, a sampling limit above the number of points."""
C2M: Final = ("-C2M_DIST", "-OCTREE_LEVEL", "6")


def program() -> str | None:
    """The path of CloudCompare, or None if it is not installed."""
    return next((path for name in PROGRAMS if (path := shutil.which(name))), None)


@dataclass(frozen=True)
class CloudCompare:
    """program: its path. folder: for files that come and go."""

    program: str
    folder: Path

    def run(self, *arguments: str) -> str:
        """One call in the folder; its log. Raises RuntimeError if it fails."""
        log = self.folder / "cloudcompare.log"
        log.unlink(missing_ok=True)
        command = [self.program, "-SILENT", "-LOG_FILE", str(log), *COMMON, *arguments]
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "XDG_RUNTIME_DIR": str(self.folder)}
        ran = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, timeout=LIMIT_S)
        told = log.read_text(errors="replace") if log.exists() else ""
        if ran.returncode != 0 or "[ERROR]" in told:
            raise RuntimeError(f"{' '.join(arguments)}: CloudCompare failed: {told[-200:].strip() or ran.returncode}")
        return told

    def save(self, name: str, points: FloatArray, counts: FloatArray | None = None) -> str:
        """Write a cloud to a file of the folder; its name."""
        table = points if counts is None else np.column_stack([points, counts])
        np.savetxt(self.folder / f"{name}.xyz", table, fmt="%.10f")
        return f"{name}.xyz"

    def outliers_removed(self, cloud: str, k: int, n_sigma: float) -> FloatArray:
        """The points that its SOR filter keeps, f64[m, 3]."""
        self.run("-O", cloud, "-SOR", str(k), f"{n_sigma:g}", *self._into("kept"))
        return self._table("kept")[:, :3]

    def to_mesh(self, cloud: str, mesh: str) -> FloatArray:
        """Unsigned distances of a cloud's points to a mesh."""
        self.run("-O", cloud, "-O", mesh, *C2M, *self._into("distances"))
        return np.abs(self._table("distances")[:, -1])

    def to_cloud(self, cloud: str, target: str) -> FloatArray:
        """Distances of a cloud's points to another cloud."""
        self.run("-O", cloud, "-O", target, "-C2C_DIST", *self._into("distances", 2))
        return self._table("distances")[:, -1]

    def aligned(self, cloud: str, target: str) -> tuple[FloatArray, float]:
        """The cloud after its ICP to a mesh (.ply) or a cloud, f64[n, 3], and the RMS that it tells."""
        log = self.run("-O", cloud, "-O", target, *ICP, *self._into("aligned", 1 if target.endswith(".ply") else 2))
        return self._table("aligned")[:, :3], rms_in(log)

    def whole_row(
        self, cloud: str, mesh: str, threshold: float, sor: tuple[int, float] | None
    ) -> tuple[float, FloatArray]:
        """Force filter, outlier filter, ICP and distances in one call: the RMS told, and the unsigned distances."""
        clean = ("-SOR", str(sor[0]), f"{sor[1]:g}") if sor else ()
        force = ("-FILTER_SF", f"{threshold:g}", "MAX")
        log = self.run("-O", cloud, *force, *clean, "-O", mesh, *ICP, *C2M, *self._into("distances"))
        return rms_in(log), np.abs(self._table("distances")[:, -1])

    def _into(self, name: str, clouds: int = 1) -> tuple[str, ...]:
        """Save the first of the open clouds under a name; the others must be saved too."""
        for old in self.folder.glob("*.asc"):
            old.unlink()
        return "-SAVE_CLOUDS", "FILE", " ".join([f"{name}.asc", "other.asc"][:clouds])

    def _table(self, name: str) -> FloatArray:
        """What was saved."""
        path = self.folder / f"{name}.asc"
        if not path.exists():
            raise RuntimeError(f"{path.name}: expected a file of CloudCompare, found none")
        return np.loadtxt(path, ndmin=2)


def rms_in(log: str) -> float:
    """The RMS that an ICP wrote to the log."""
    found = re.findall(r"RMS: ([0-9.eE+-]+)", log)
    if not found:
        raise RuntimeError("ICP: CloudCompare told no RMS")
    return float(found[-1])
