"""Rollouts of a user's own MuJoCo model: states in, what every taxel felt out.

For each state MuJoCo computes the contacts between the boards and the object; their wrench on each board is spread
over its taxels as in the project's own simulator (`taxel.sim.sensing`). With controls and times the rollout may
instead be replayed by stepping from its first state.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.errors import format_value
from taxel.hand.kinematics import compute_taxel_positions
from taxel.sim.closing import GraspMotion
from taxel.sim.contacts import ContactPoints, StepContacts, board_wrenches
from taxel.sim.importers.csv_grasps import meshes_of
from taxel.sim.importers.errors import Source
from taxel.sim.importers.grasp_rows import dataset_ids
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import FeltGrasp, check_new, frame_rate, new_dataset, record_of
from taxel.sim.importers.rollout_names import ModelParts, find_parts
from taxel.sim.importers.rollout_object import RolloutObject, object_of
from taxel.sim.importers.rollout_states import STATES, RolloutStates, read_states
from taxel.sim.sensing import Sensing, sense
from taxel.types import FloatArray

__all__ = ["import_rollout", "load_model"]

NEAR_M = 0.010
"""A contact on a body belongs to the nearest of its boards, if a taxel of it is as near as this."""

REPLAY_TOLERANCE = 1e-3
"""How far a replay may leave the recorded qpos, metres or radians: a millimetre is what a taxel tells apart."""


def load_model(path: str | os.PathLike[str]) -> mujoco.MjModel:
    """A model from MJCF or URDF (XML) or from a binary .mjb. Raises ImportDataError."""
    source, file = Source(os.fspath(path)), Path(path)
    if not file.is_file():
        source.fail("a MuJoCo model", "a folder" if file.is_dir() else "no such file", "check the path")
    binary = file.suffix.lower() == ".mjb"
    read = mujoco.MjModel.from_binary_path if binary else mujoco.MjModel.from_xml_path
    try:
        return read(os.fspath(file))
    except (ValueError, mujoco.FatalError) as error:
        reason = format_value(" ".join(str(error).split()))
        source.fail("a model that MuJoCo reads", reason, "open it in MuJoCo's viewer to see the mistake")


def import_rollout(
    model: str | os.PathLike[str],
    states: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    parts: Mapping[str, Any] | None = None,
    parts_source: Source | None = None,
    sensing: Sensing | None = None,
    forward: bool = False,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Turn a rollout into a grasp dataset.

    model: XML or MJB. states: .npz of qpos [T, nq] and, optionally, qvel, act, ctrl, mocap_pos, mocap_quat,
    qfrc_applied, time [T], phase, grasp, approach, iteration, session (one, or [T]). parts: which parts of the model
    are the boards and the object, see `rollout_names`; parts_source: its file. sensing: how wrenches become forces.
    forward: with ctrl too, take the states as they stand instead of replaying them.

    Raises ImportDataError for the first mistake in a file, DatasetError for `out`.
    """
    options, sensing = options or ImportOptions(), sensing or Sensing()
    check_new(out, options.overwrite)
    loaded = load_model(model)
    source = parts_source or Source(os.fspath(model))
    found = find_parts(loaded, options.hand, parts or {}, source)
    thing = object_of(loaded, found, options.objects, source)
    given = read_states(states, _row_shapes(loaded), loaded.opt.timestep)
    grasps = given.grasps()
    ids = dataset_ids([given.grasp[int(rows[0])] for rows in grasps])
    rate = frame_rate([given.time_s[rows] for rows in grasps])
    layer = "coupled" if sensing.level == "coupled" else "uncoupled"
    what = f"import of a MuJoCo rollout, {sensing.level} sensing"
    report, run = ImportReport(), _Run(loaded, found, thing, options)
    meshes = meshes_of([thing.item])
    with new_dataset(out, options, meshes, rate, what, sensing.stiffness_n_per_m, layer) as writer:
        for name, rows in zip(ids, grasps, strict=True):
            motion = run.motion(given, rows, forward)
            _count(motion.contacts, report)
            felt = _felt(name, given, rows, motion, thing, sensing, options)
            writer.add(record_of(felt, options, given.source, report), name)
    return report


def _count(contacts: ContactPoints, report: ImportReport) -> None:
    lost = contacts.board < 0
    report.contacts += len(lost)
    report.far_contacts += int(lost.sum())
    report.far_force_n += float(np.linalg.norm(contacts.force[lost], axis=1).sum())


def _felt(
    name: str,
    given: RolloutStates,
    rows: NDArray[np.intp],
    motion: GraspMotion,
    thing: RolloutObject,
    sensing: Sensing,
    options: ImportOptions,
) -> FeltGrasp:
    first = int(rows[0])
    felt = sense(options.hand, thing.item.shape, motion, sensing)
    nominal = options.object_poses.get(thing.item.name, motion.object_pose[0])
    return FeltGrasp(
        name,
        thing.item.name,
        given.approach[first],
        int(given.iteration[first]),
        int(given.session[first]),
        motion.time_s,
        motion.phase,
        motion.sensor_poses,
        nominal,
        felt.contact_force,
        felt.separation,
    )


def _row_shapes(model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    sizes = (model.nq,), (model.nv,), (model.na,), (model.nu,), (model.nmocap, 3), (model.nmocap, 4), (model.nv,)
    return dict(zip(STATES, sizes, strict=True))


@dataclass(frozen=True, eq=False)
class _Moment:
    sensors: FloatArray
    object: FloatArray
    contacts: StepContacts


class _Run:
    """A model with its parts, put into one state after the other."""

    def __init__(self, model: mujoco.MjModel, parts: ModelParts, thing: RolloutObject, options: ImportOptions) -> None:
        self.model, self.parts, self.thing, self.options = model, parts, thing, options
        self.hand: Hand = options.hand
        self.data = mujoco.MjData(model)

    def motion(self, states: RolloutStates, rows: NDArray[np.intp], forward: bool) -> GraspMotion:
        """What moved and what pressed at the states `rows` of one grasp."""
        replay = states.start_only or ("ctrl" in states.values and not forward)
        moments: list[_Moment] = []
        for done, row in enumerate(rows.tolist()):
            self.options.progress(f"grasp {states.grasp[row]}", done, len(rows))
            if not replay or done == 0:
                mujoco.mj_resetData(self.model, self.data)
                self._put(states, row, STATES)
            else:
                self._step_to(states, row)
            moments.append(self._moment())
        self.options.progress(f"grasp {states.grasp[int(rows[0])]}", len(rows), len(rows))
        contacts = [moment.contacts for moment in moments]
        sensors = np.stack([moment.sensors for moment in moments])
        wrench = [board_wrenches(step, moment.sensors) for step, moment in zip(contacts, moments, strict=True)]
        nothing = np.zeros((len(rows), 0))
        return GraspMotion(
            states.time_s[rows],
            states.phase[rows],
            nothing,
            nothing.reshape(len(rows), 0, 1, 1),
            sensors,
            np.stack([moment.object for moment in moments]),
            np.stack(wrench),
            ContactPoints.of(contacts),
        )

    def _put(self, states: RolloutStates, row: int, names: tuple[str, ...]) -> None:
        for name in names:
            if name in states.values:
                values = states.values[name]
                getattr(self.data, name)[...] = values[row if len(values) > 1 else 0]

    def _step_to(self, states: RolloutStates, row: int) -> None:
        """Step from the state before to `row` under what was commanded there."""
        self._put(states, row - 1, ("ctrl", "mocap_pos", "mocap_quat", "qfrc_applied"))
        passed, step = states.time_s[row] - states.time_s[row - 1], self.model.opt.timestep
        for _ in range(max(round(passed / step), 1)):
            mujoco.mj_step(self.model, self.data)
        self._put(states, row, ("mocap_pos", "mocap_quat"))
        if states.start_only:
            return
        apart = np.abs(self.data.qpos - states.values["qpos"][row])
        if apart.max(initial=0.0) > REPLAY_TOLERANCE:
            at = int(np.argmax(apart))
            expected = f"the state that stepping under ctrl leads to, within {REPLAY_TOLERANCE:g}"
            remedy = "save ctrl and time at every step, or take the states as they stand (--forward)"
            states.source.key(f"qpos[{row}, {at}]").fail(expected, f"one {apart[at]:.3g} away", remedy)

    def _moment(self) -> _Moment:
        mujoco.mj_forward(self.model, self.data)
        body = self.parts.board_body
        sensors = _poses(self.data.xmat[body], self.data.xpos[body]) @ self.parts.board_pose
        item = self.parts.object_body
        where = _poses(self.data.xmat[item], self.data.xpos[item]) @ self.thing.frame
        return _Moment(sensors, where, self._contacts(sensors))

    def _contacts(self, sensors: FloatArray) -> StepContacts:
        """Contact points of anything with the object, forces on the side that is not the object."""
        contact = self.data.contact
        geoms = np.asarray(contact.geom, dtype=np.int64).reshape(-1, 2)
        is_object = self.thing.geoms[geoms]
        used = np.flatnonzero((is_object.sum(axis=1) == 1) & (np.asarray(contact.efc_address) >= 0))
        first = is_object[used, 0]  # MuJoCo's normal points from the first geom to the second
        other = np.where(first, geoms[used, 1], geoms[used, 0])
        frame = np.asarray(contact.frame)[used].reshape(-1, 3, 3)
        own, wrench = np.zeros((len(used), 3)), np.zeros(6)
        for row, index in enumerate(used):
            mujoco.mj_contactForce(self.model, self.data, int(index), wrench)
            own[row] = wrench[:3]
        sign = np.where(first, 1.0, -1.0)[:, None]
        position = np.asarray(contact.pos)[used].copy()
        force = sign * np.einsum("ci,cij->cj", own, frame)
        board = self._board(other, position, sensors)
        kept = (board >= 0) | self._on_hand(other)
        depth = -np.asarray(contact.dist)[used]
        return StepContacts(board[kept], position[kept], (sign * frame[:, 0])[kept], depth[kept], force[kept])

    def _on_hand(self, geom: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether geoms sit on a body that carries boards: others, such as a table, do not touch the hand."""
        return np.isin(self.model.geom_bodyid[geom], self.parts.board_body)

    def _board(self, geom: NDArray[np.int64], position: FloatArray, sensors: FloatArray) -> NDArray[np.int64]:
        """The board that each contact point is on, i64[c]; -1: none."""
        board = self.parts.board_of_geom[geom]
        unsure = np.flatnonzero(board < 0)
        if not len(unsure) or not self.parts.by_body.any():
            return board
        centres = compute_taxel_positions(self.hand, sensors)
        body_of_taxel = np.where(self.parts.by_body, self.parts.board_body, -1)[self.hand.board_index]
        for index in unsure:
            near = np.linalg.norm(centres - position[index], axis=1)
            near[body_of_taxel != self.model.geom_bodyid[geom[index]]] = np.inf
            taxel = int(np.argmin(near))
            if near[taxel] <= NEAR_M:
                board[index] = self.hand.board_index[taxel]
        return board


def _poses(rotations: FloatArray, origins: FloatArray) -> FloatArray:
    result = np.zeros((*origins.shape[:-1], 4, 4))
    result[..., :3, :3] = rotations.reshape(*origins.shape[:-1], 3, 3)
    result[..., :3, 3] = origins
    result[..., 3, 3] = 1.0
    return result
