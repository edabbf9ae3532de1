"""Share of the grasps that a treatment step changes, and electrode lines on which the removed points lie."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.recording.grasp_tables import TaxelTable
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.types import BoolArray


@dataclass(frozen=True)
class LineShares:
    """How often removed points and inactive taxels share a TX or RX line with a contact.

    removed: share of the points removed by the outlier filter that have a line in common with a kept point of the same
    board and grasp. inactive: the corresponding share of the inactive taxels on the boards of the removed points.
    """

    removed: float
    inactive: float

    @property
    def ratio(self) -> float | None:
        """Share `removed` divided by the share `inactive`; None if `inactive` is 0."""
        return self.removed / self.inactive if self.inactive > 0.0 else None


def compute_prevalence(clouds: Mapping[str, ContactCloud]) -> dict[str, float]:
    """Compute the share of the grasps that each step of the treatment changes, by name of the cloud after the step.

    clouds: clouds by name, as in `ObjectClouds`. A grasp is changed if the step changes its number of points.
    """
    steps = ((REAL, FILTERED), (FILTERED, CLEANED), (SIM, SPREAD))
    return {after: _changed_share(clouds[before], clouds[after]) for before, after in steps}


def _changed_share(before: ContactCloud, after: ContactCloud) -> float:
    """Compute the share of the grasps whose number of points differs between two clouds of the same grasps."""
    grasps = len(before.grasps)
    counts = [np.bincount(cloud.grasp, minlength=grasps) for cloud in (before, after)]
    return float(np.mean(counts[0] != counts[1]))


def compute_line_shares(
    filtered: ContactCloud, cleaned: ContactCloud, taxels: TaxelTable, used: BoolArray
) -> LineShares:
    """Compare the lines of the points that the outlier filter removes with those of inactive taxels.

    Returns the share of the removed points that have a TX or RX line in common with a kept point, and the same share of
    the inactive taxels on the boards of the removed points. A kept point is a point that the filter keeps on the same
    board in the same grasp.

    filtered, cleaned: cloud before and after the outlier filter. taxels: taxel table of the dataset. used: bool[n],
    taxels that the clouds can contain. Boards without a kept point or without an inactive taxel in a grasp are left
    out; both shares are 0 if no removed point remains.
    """
    kept_keys = set(zip(cleaned.grasp.tolist(), cleaned.taxel.tolist(), strict=True))
    points = list(zip(filtered.grasp.tolist(), filtered.taxel.tolist(), strict=True))
    removed_shares, inactive_shares = [], []
    for grasp in sorted({grasp for grasp, _ in points}):
        active = np.array([taxel for row, taxel in points if row == grasp])
        is_kept = np.array([(grasp, taxel) in kept_keys for taxel in active.tolist()])
        for board in np.unique(taxels.sensor[active[~is_kept]]):
            on_board = used & (taxels.sensor == board)
            kept = active[is_kept & (taxels.sensor[active] == board)]
            removed = active[~is_kept & (taxels.sensor[active] == board)]
            is_inactive = on_board.copy()
            is_inactive[active] = False
            if not len(kept) or not is_inactive.any():
                continue
            on_line = np.isin(taxels.tx, taxels.tx[kept]) | np.isin(taxels.rx, taxels.rx[kept])
            removed_shares += on_line[removed].tolist()
            inactive_shares += [float(on_line[is_inactive].mean())] * len(removed)
    if not removed_shares:
        return LineShares(0.0, 0.0)
    return LineShares(float(np.mean(removed_shares)), float(np.mean(inactive_shares)))
