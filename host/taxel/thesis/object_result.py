"""Results of one object: distances of its clouds, numbers of points and of grasps; storage as JSON values."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from taxel.cloud.distance import DistanceStats
from taxel.thesis.prevalence import LineShares


@dataclass(frozen=True)
class ObjectResult:
    """All distances of the clouds of one object.

    name, printed_name: name of the object in the dataset and in the thesis. grasps: number of real grasps. cad:
    distances to the object's CAD model, by name of the cloud. force: distances of the real cloud to it, by threshold of
    the force filter in counts. sor: distances of the force-filtered real cloud after the statistical outlier filter
    (SOR), by the printed N and nSigma. neighbours: N that was used for each printed N. to_sim: distances from real to
    simulated cloud, by stage. sim_points: number of points of the simulated cloud, by stage. cross: distances by side
    ("real" or "sim") and printed name of the CAD model. iterations: number of grasps by approach. prevalence: share of
    the grasps that a step of the treatment changes, by name of the cloud after the step. line_shares: how often removed
    points share electrode lines with contacts; None: unknown.
    """

    name: str
    printed_name: str
    grasps: int
    cad: dict[str, DistanceStats]
    force: dict[int, DistanceStats]
    sor: dict[tuple[int, float], DistanceStats]
    neighbours: dict[int, int]
    to_sim: dict[str, DistanceStats]
    sim_points: dict[str, int]
    cross: dict[tuple[str, str], DistanceStats] = field(default_factory=dict)
    iterations: dict[str, int] = field(default_factory=dict)
    prevalence: dict[str, float] = field(default_factory=dict)
    line_shares: LineShares | None = None

    def to_json(self) -> dict[str, Any]:
        """Convert the results of the object to JSON values."""
        return {
            "name": self.name,
            "printed_name": self.printed_name,
            "grasps": self.grasps,
            "cad": {key: asdict(stats) for key, stats in self.cad.items()},
            "force": {str(key): asdict(stats) for key, stats in self.force.items()},
            "sor": {f"{n} / {sigma:g}": asdict(stats) for (n, sigma), stats in self.sor.items()},
            "neighbours": {str(key): value for key, value in self.neighbours.items()},
            "to_sim": {key: asdict(stats) for key, stats in self.to_sim.items()},
            "sim_points": self.sim_points,
            "cross": {f"{cloud} on {mesh}": asdict(stats) for (cloud, mesh), stats in self.cross.items()},
            "iterations": self.iterations,
            "prevalence": self.prevalence,
            "line_shares": None if self.line_shares is None else asdict(self.line_shares),
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> "ObjectResult":
        """Create the results of an object from the values of `to_json`. Raises KeyError, TypeError or ValueError."""

        def parse(stats: Mapping[str, Mapping[str, Any]]) -> dict[str, DistanceStats]:
            """Create the statistics in a dictionary from JSON values; the keys stay."""
            return {key: DistanceStats(**item) for key, item in stats.items()}

        sor, cross = parse(values["sor"]), parse(values["cross"])
        lines = values["line_shares"]
        return cls(
            values["name"],
            values["printed_name"],
            values["grasps"],
            parse(values["cad"]),
            {int(key): stats for key, stats in parse(values["force"]).items()},
            {(int(n), float(sigma)): sor[f"{n} / {sigma}"] for n, sigma in (key.split(" / ") for key in sor)},
            {int(key): int(value) for key, value in values["neighbours"].items()},
            parse(values["to_sim"]),
            dict(values["sim_points"]),
            {(side, mesh): cross[f"{side} on {mesh}"] for side, mesh in (key.split(" on ") for key in cross)},
            dict(values["iterations"]),
            dict(values["prevalence"]),
            None if lines is None else LineShares(**lines),
        )
