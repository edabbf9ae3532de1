"""Taxels of the original hand: true and coded centres, masked taxels, boards without coordinates."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from taxel.cloud.contacts import BACK_KIND, UNUSED_BOARDS
from taxel.hand import Hand
from taxel.hand.original.centres import PluginCoordinates, get_plugin_coordinates, load_coded_centres
from taxel.thesis.own_gap.effects import OwnEffects
from taxel.types import BoolArray, FloatArray, IntArray

MASKED_TAXELS: Final = MappingProxyType(
    {"proximal_front": range(45, 65), "medial_front": range(18, 27), "fingertip": range(30)}
)
"""Taxel indices that the host of the hardware ignores, by kind of board. Source: coordinates_listener of the original.

They lie on the sides of the fingers: 117 of the 463 taxels of the eight front boards. The range of the medial fronts
contains the taxels 21 to 26 of the pinkie, which the host never updates.
"""


@dataclass(frozen=True, eq=False)
class TaxelSets:
    """Properties of the n taxels of a hand on which the effects of the original programs depend.

    Attributes:
        board: i64[n], row of the taxel's board in `hand.boards`.
        true_centres: f64[n, 3], metres, bracket frame.
        coded_centres: f64[n, 3], metres, bracket frame; NaN: no coded centre.
        is_used: bool[n], taxels that the experiments of the thesis use.
        has_no_coordinates: bool[n], taxels of boards that both original programs place at the bracket's origin.
        is_masked: bool[n], used taxels that the host of the hardware ignores.
    """

    board: IntArray
    true_centres: FloatArray
    coded_centres: FloatArray
    is_used: BoolArray
    has_no_coordinates: BoolArray
    is_masked: BoolArray

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.board)


def make_taxel_sets(hand: Hand) -> TaxelSets:
    """Determine the properties of the original hand's taxels. Raises NoCodedCentresError for another hand."""
    board = np.zeros(hand.n_taxels, np.int64)
    is_used, has_no_coordinates, is_masked = (np.zeros(hand.n_taxels, bool) for _ in range(3))
    for row, (item, coordinates) in enumerate(zip(hand.boards, get_plugin_coordinates(hand), strict=True)):
        where, kind = hand.get_slice(item.address), item.kind.name
        board[where] = row
        is_used[where] = BACK_KIND not in kind and item.name not in UNUSED_BOARDS
        has_no_coordinates[where] = coordinates is PluginCoordinates.ORIGIN
        # MASKED_TAXELS counts the taxels from the first taxel of the board.
        is_masked[np.arange(hand.n_taxels)[where][list(MASKED_TAXELS.get(kind, ()))]] = True
    coded = load_coded_centres(hand)
    return TaxelSets(board, hand.position, coded, is_used, has_no_coordinates, is_masked & is_used)


def select_used(sets: TaxelSets, effects: OwnEffects, *, is_real: bool) -> BoolArray:
    """Select the taxels whose contacts are used on one side, bool[n].

    The effect `back_boards` adds the taxels without coordinates. The effect `mask` removes, on the hardware only, the
    taxels that its host program ignores. is_real: True for the hardware, False for the simulation.
    """
    used = sets.is_used | sets.has_no_coordinates if effects.back_boards else sets.is_used.copy()
    return used & ~sets.is_masked if is_real and effects.mask else used


def get_centres(sets: TaxelSets, effects: OwnEffects, *, is_real: bool) -> FloatArray:
    """Return the centres at which the program of one side places its taxels, f64[n, 3], metres, bracket frame.

    A program with the effect of coded centres uses these centres where they exist, otherwise the true centres. Both
    programs place taxels without coordinates at the origin of the bracket. is_real: True for the hardware, False for
    the simulation.
    """
    is_coded = effects.coded_host if is_real else effects.coded_simulation
    centres = sets.true_centres.copy()
    if is_coded:
        centres = np.where(np.isfinite(sets.coded_centres), sets.coded_centres, centres)
    centres[sets.has_no_coordinates] = 0.0
    return centres


def place_in_object_frame(sets: TaxelSets, centres: FloatArray, brackets: FloatArray) -> FloatArray:
    """Place taxel centres in the frame of the object, f64[n, 3], metres.

    centres: f64[n, 3], bracket frame. brackets: f64[s, 4, 4], poses of the brackets in the frame of the object.
    """
    poses = brackets[sets.board]
    return np.asarray(np.einsum("nij,nj->ni", poses[:, :3, :3], centres) + poses[:, :3, 3])
