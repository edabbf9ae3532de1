"""Changes of the contact forces of a simulation, stated at some net forces of each board."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from taxel.gap.effects.board_contacts import BoardContact
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

LEVELS: Final = np.array([0.2, 0.5, 1.0, 1.25])
"""L levels at which a contact is computed again, as shares of the net force of the board in hold.

Chosen; the changes between two levels are interpolated linearly.
"""


def make_neutral_change(state: State) -> FloatArray:
    """Return a change f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels) for `apply_change` that changes no
    force: kept share 1, gained force 0.
    """
    change = np.zeros((len(state.condition), 2, len(LEVELS), state.pair.n))
    change[:, 0] = 1.0
    return change


def assemble_change(
    state: State, contacts: Sequence[BoardContact], contact_changes: Mapping[int, FloatArray]
) -> FloatArray:
    """Return the change f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels) for `apply_change` from the changes
    of single boards.

    contact_changes: f64[2, L, m] (m taxels of the board) by index in `contacts`; the other contacts do not change.
    """
    change = make_neutral_change(state)
    for number, contact_change in contact_changes.items():
        contact = contacts[number]
        change[contact.row][..., contact.taxels] = contact_change
    return change


def apply_change(state: State, signal: Signal, change: FloatArray) -> Signal:
    """Return a signal with changed forces.

    change: f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels), the share of the force that each taxel keeps and
    the force that it gains, newtons, at the net forces `LEVELS` of its board. Between two levels the change is
    interpolated linearly.

    A decrease is stated as a share, because the changes are computed from meshes and depths, whose forces deviate from
    the simulated forces. A taxel that loses contact (share 0) then has exactly no force, which a difference of two
    different forces would not ensure.
    """
    assert signal.force is not None
    kept_weights, gained_weights = _compute_level_weights(state, signal)
    force = signal.force.copy()
    for board, layout in enumerate(state.pair.boards):
        kept, gained = change[:, 0][..., layout.columns], change[:, 1][..., layout.columns]
        is_changed = ((kept != 1.0) | (gained != 0.0)).any(axis=(1, 2))
        board_force = signal.force[..., layout.columns][is_changed]
        board_force *= kept_weights[is_changed, :, board] @ kept[is_changed]
        board_force += gained_weights[is_changed, :, board] @ gained[is_changed]
        force[np.ix_(is_changed, np.arange(force.shape[1]), layout.taxels)] = board_force
    return signal.with_force(force)


@lru_cache(maxsize=4)
def _compute_level_weights(state: State, signal: Signal) -> tuple[FloatArray, FloatArray]:
    """Return the interpolation weights of the L `LEVELS` for each board and node, two arrays f64[Q, K, s, L] (Q
    simulated contacts, K time nodes).

    The first array applies to kept shares, the second to gained forces. The weights follow from the net force of each
    of the s boards, relative to its mean in hold. Cached, because a fit applies many changes to one signal.
    """
    assert signal.force is not None
    hold, board = state.time_grid.phase == Phase.HOLD, state.pair.groups.sum_matrices[2]
    net = (board @ signal.force.reshape(-1, state.pair.n).T).T.reshape(*signal.force.shape[:2], -1)
    level = net / np.maximum(net[:, hold].mean(axis=1, keepdims=True), 1e-9)
    right = np.clip(np.searchsorted(LEVELS, level), 1, len(LEVELS) - 1)
    share = np.clip((level - LEVELS[right - 1]) / (LEVELS[right] - LEVELS[right - 1]), 0.0, 1.0)[..., None]
    number = np.arange(len(LEVELS))
    # Linear interpolation: weight `share` for the level on the right, 1 - `share` for the level before it.
    kept_weights = np.where(right[..., None] == number, share, 0.0) + np.where(
        right[..., None] == number + 1, 1.0 - share, 0.0
    )
    # Below the lowest level the gained force is proportional to the net force: a board without force gains no force.
    return kept_weights, kept_weights * np.minimum(level / LEVELS[0], 1.0)[..., None]
