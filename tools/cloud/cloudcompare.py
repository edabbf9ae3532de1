"""CloudCompare 2.11 through its command line, without a display: distances, outlier filter and alignment.

Its distances to a mesh (C2M) are signed, so that their absolute values are used. It stores coordinates in single
precision.
"""

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
TIME_LIMIT_S: Final = 300.0
COMMON_OPTIONS: Final = ("-C_EXPORT_FMT", "ASC", "-PREC", "10", "-NO_TIMESTAMP", "-AUTO_SAVE", "OFF")
ICP: Final = ("-ICP", "-ITER", "1000", "-OVERLAP", "100", "-RANDOM_SAMPLING_LIMIT", "100000")
"""As in the thesis (5.6): 1000 iterations, full overlap, a sampling limit above the number of points."""
C2M: Final = ("-C2M_DIST", "-OCTREE_LEVEL", "6")


def find_program() -> str | None:
    """Return the path of CloudCompare, or None if it is not installed."""
    return next((path for name in PROGRAMS if (path := shutil.which(name))), None)


@dataclass(frozen=True)
class CloudCompare:
    """The program CloudCompare. program: its path. folder: folder for temporary files."""

    program: str
    folder: Path

    def run(self, *arguments: str) -> str:
        """Run one command of CloudCompare in its folder, and return its log.

        Raises RuntimeError if the command fails.
        """
        log = self.folder / "cloudcompare.log"
        log.unlink(missing_ok=True)
        command = [self.program, "-SILENT", "-LOG_FILE", str(log), *COMMON_OPTIONS, *arguments]
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "XDG_RUNTIME_DIR": str(self.folder)}
        result = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, timeout=TIME_LIMIT_S)
        text = log.read_text(errors="replace") if log.exists() else ""
        if result.returncode != 0 or "[ERROR]" in text:
            reason = text[-200:].strip() or result.returncode
            raise RuntimeError(f"{' '.join(arguments)}: CloudCompare failed: {reason}")
        return text

    def save(self, name: str, points: FloatArray, counts: FloatArray | None = None) -> str:
        """Write a point cloud for CloudCompare. points: f64[n, 3]; counts: f64[n]. Returns the name of the file."""
        table = points if counts is None else np.column_stack([points, counts])
        np.savetxt(self.folder / f"{name}.xyz", table, fmt="%.10f")
        return f"{name}.xyz"

    def remove_outliers(self, cloud: str, k: int, n_sigma: float) -> FloatArray:
        """Return the points f64[m, 3] that CloudCompare's statistical outlier removal (SOR) keeps.

        k: number of neighbours; n_sigma: limit of the mean neighbour distance, in standard deviations.
        """
        self.run("-O", cloud, "-SOR", str(k), f"{n_sigma:g}", *self._save_as("kept"))
        return self._read_table("kept")[:, :3]

    def measure_to_mesh(self, cloud: str, mesh: str) -> FloatArray:
        """Measure the unsigned distances f64[n] of the points of a cloud to a mesh. cloud, mesh: file names."""
        self.run("-O", cloud, "-O", mesh, *C2M, *self._save_as("distances"))
        return np.abs(self._read_table("distances")[:, -1])

    def measure_to_cloud(self, cloud: str, target: str) -> FloatArray:
        """Measure the distances f64[n] of the points of a cloud to another cloud. cloud, target: file names."""
        self.run("-O", cloud, "-O", target, "-C2C_DIST", *self._save_as("distances", 2))
        return self._read_table("distances")[:, -1]

    def align(self, cloud: str, target: str) -> tuple[FloatArray, float]:
        """Align a cloud by the ICP of CloudCompare to a mesh (.ply) or another cloud.

        Returns the aligned points f64[n, 3] and the RMS distance that CloudCompare reports.
        """
        log = self.run("-O", cloud, "-O", target, *ICP, *self._save_as("aligned", 1 if target.endswith(".ply") else 2))
        return self._read_table("aligned")[:, :3], parse_rms(log)

    def compute_sweep_row(
        self, cloud: str, mesh: str, threshold: float, sor: tuple[int, float] | None
    ) -> tuple[float, FloatArray]:
        """Filter a cloud by force and outliers, align it to a mesh and measure distances, in one command.

        threshold: smallest force in counts. sor: number of neighbours and limit of the outlier removal; None without
        it. Returns the RMS of the alignment, and the unsigned distances.
        """
        outlier_options = ("-SOR", str(sor[0]), f"{sor[1]:g}") if sor else ()
        force_options = ("-FILTER_SF", f"{threshold:g}", "MAX")
        options = (*force_options, *outlier_options, "-O", mesh, *ICP, *C2M)
        log = self.run("-O", cloud, *options, *self._save_as("distances"))
        return parse_rms(log), np.abs(self._read_table("distances")[:, -1])

    def _save_as(self, name: str, clouds: int = 1) -> tuple[str, ...]:
        """Return the options that save the first open cloud under a name.

        CloudCompare requires a name for every open cloud.
        """
        for old in self.folder.glob("*.asc"):
            old.unlink()
        return "-SAVE_CLOUDS", "FILE", " ".join([f"{name}.asc", "other.asc"][:clouds])

    def _read_table(self, name: str) -> FloatArray:
        """Read the text table `name`.asc that CloudCompare has written.

        Raises `RuntimeError` if the file does not exist.
        """
        path = self.folder / f"{name}.asc"
        if not path.exists():
            raise RuntimeError(f"{path.name}: expected a file of CloudCompare, found none")
        return np.loadtxt(path, ndmin=2)


def parse_rms(log: str) -> float:
    """Parse the RMS of the last alignment from a log of CloudCompare. Raises RuntimeError if the log has none."""
    values = re.findall(r"RMS: ([0-9.eE+-]+)", log)
    if not values:
        raise RuntimeError("ICP: expected an RMS in the log of CloudCompare, found none")
    return float(values[-1])
