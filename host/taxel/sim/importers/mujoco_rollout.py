"""Import of rollouts of any MuJoCo model: from recorded states to forces on the taxels.

For each state MuJoCo computes the contacts between the boards and the object. Their wrench on each board is distributed
over its taxels as in the simulator of this project (`taxel.sim.sensing`). If the file contains controls, the rollout is
replayed by stepping from its first state, unless the recorded states are to be evaluated.
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
from taxel.sim.contacts import ContactPoints, StepContacts, compute_board_wrenches
from taxel.sim.importers.csv_grasps import make_meshes
from taxel.sim.importers.errors import FileLocation
from taxel.sim.importers.grasp_rows import make_dataset_ids
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import (
    ImportedGrasp,
    compute_frame_rate,
    make_record,
    open_new_dataset,
    refuse_existing_file,
)
from taxel.sim.importers.rollout_names import ModelParts, find_parts
from taxel.sim.importers.rollout_object import RolloutObject, make_rollout_object
from taxel.sim.importers.rollout_states import STATES, RolloutStates, read_states
from taxel.sim.sensing import Sensing, sense
from taxel.types import FloatArray

__all__ = ["import_rollout", "load_model"]

NEAR_M = 0.010
"""A contact on a body belongs to the nearest board of this body, if one of its taxels is within this distance."""

REPLAY_TOLERANCE = 1e-3
"""Largest deviation of a replay from the recorded qpos, metres or radians; small against a taxel of 3 mm."""


def load_model(path: str | os.PathLike[str]) -> mujoco.MjModel:
    """Load a MuJoCo model from an XML file (MJCF or URDF) or a binary file (.mjb). Raises ImportDataError."""
    source, file = FileLocation(os.fspath(path)), Path(path)
    if not file.is_file():
        source.fail("a MuJoCo model", "a folder" if file.is_dir() else "no such file", "check the path")
    is_binary = file.suffix.lower() == ".mjb"
    read = mujoco.MjModel.from_binary_path if is_binary else mujoco.MjModel.from_xml_path
    try:
        return read(os.fspath(file))
    except (ValueError, mujoco.FatalError) as error:
        reason = format_value(" ".join(str(error).split()))
        source.fail("a model that MuJoCo reads", reason, "open it in MuJoCo's viewer to find the error")


def import_rollout(
    model: str | os.PathLike[str],
    states: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    model_map: Mapping[str, Any] | None = None,
    map_location: FileLocation | None = None,
    sensing: Sensing | None = None,
    is_replayed: bool = True,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Convert a rollout into a grasp dataset.

    Args:
        model: XML or MJB file.
        states: .npz file with qpos [T, nq]; optional: qvel, act, ctrl, mocap_pos, mocap_quat, qfrc_applied, eq_active,
            time [T], and phase, grasp, approach, iteration, session (one value, or [T]).
        out: the dataset.
        model_map: names of the boards and of the object in the model, see `rollout_names`.
        map_location: file of the map, for errors.
        sensing: model that distributes the wrenches on boards over their taxels.
        is_replayed: whether a rollout with ctrl is replayed; otherwise the recorded states are evaluated.
        options: common options.

    Raises:
        ImportDataError: the first error in a file.
        DatasetError: `out` cannot be written.
    """
    options, sensing = options or ImportOptions(), sensing or Sensing()
    refuse_existing_file(out, options.overwrite)
    loaded_model = load_model(model)
    location = map_location or FileLocation(os.fspath(model))
    parts = find_parts(loaded_model, options.hand, model_map or {}, location)
    rollout_object = make_rollout_object(loaded_model, parts, options.objects, location)
    recorded = read_states(states, _row_shapes(loaded_model), loaded_model.opt.timestep)
    grasps = recorded.rows_by_grasp()
    ids = make_dataset_ids([recorded.grasp[int(rows[0])] for rows in grasps])
    rate = compute_frame_rate([recorded.time_s[rows] for rows in grasps])
    layer = "coupled" if sensing.level == "coupled" else "uncoupled"
    description = f"import of a MuJoCo rollout, {sensing.level} sensing"
    report, run = ImportReport(), _Run(loaded_model, parts, rollout_object, options)
    meshes = make_meshes([rollout_object.grasp_object])
    with open_new_dataset(out, options, meshes, rate, description, sensing.stiffness_n_per_m, layer) as writer:
        for name, rows in zip(ids, grasps, strict=True):
            motion = run.compute_motion(recorded, rows, is_replayed)
            _count_contacts(motion.contacts, report)
            grasp = _import_grasp(name, recorded, int(rows[0]), motion, rollout_object, sensing, options)
            writer.add(make_record(grasp, options, recorded.source, report), name)
    return report


def _count_contacts(contacts: ContactPoints, report: ImportReport) -> None:
    """Add number and force of a grasp's contacts to the report; a contact without a board is counted as far."""
    is_far = contacts.board < 0
    report.contacts += len(is_far)
    report.far_contacts += int(is_far.sum())
    report.far_force_n += float(np.linalg.norm(contacts.force[is_far], axis=1).sum())


def _import_grasp(
    name: str,
    states: RolloutStates,
    first_row: int,
    motion: GraspMotion,
    rollout_object: RolloutObject,
    sensing: Sensing,
    options: ImportOptions,
) -> ImportedGrasp:
    """Compute the taxel forces of a grasp from its replayed motion, and return the grasp for the dataset.

    name: id in the dataset. first_row: row of the first state of the grasp, whose labels are used.
    """
    grasp_object = rollout_object.grasp_object
    sensed = sense(options.hand, grasp_object.shape, motion, sensing)
    nominal_pose = options.object_poses.get(grasp_object.name, motion.object_pose[0])
    return ImportedGrasp(
        name,
        grasp_object.name,
        states.approach[first_row],
        int(states.iteration[first_row]),
        int(states.session[first_row]),
        motion.time_s,
        motion.phase,
        motion.sensor_poses,
        nominal_pose,
        sensed.contact_force,
        sensed.separation,
    )


def _row_shapes(model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    """Return the shape of one recorded state of each array of `STATES`, such as qpos, for this model."""
    # In the order of `STATES`: qpos, qvel, act, ctrl, mocap_pos, mocap_quat, qfrc_applied, eq_active.
    sizes = [(model.nq,), (model.nv,), (model.na,), (model.nu,), (model.nmocap, 3), (model.nmocap, 4)]
    sizes += [(model.nv,), (model.neq,)]
    return dict(zip(STATES, sizes, strict=True))


@dataclass(frozen=True, eq=False)
class _Snapshot:
    """Poses and contacts in one state of the MuJoCo model.

    sensors: f64[s, 4, 4], brackets, and object_pose: f64[4, 4], both in the world.
    """

    sensors: FloatArray
    object_pose: FloatArray
    contacts: StepContacts


class _Run:
    """Replay of a MuJoCo model: the model is set to, or stepped to, one recorded state after the other."""

    def __init__(
        self, model: mujoco.MjModel, parts: ModelParts, rollout_object: RolloutObject, options: ImportOptions
    ) -> None:
        """Prepare the replay of a MuJoCo model: its hand and object parts, and the options of the import."""
        self.model, self.parts, self.rollout_object, self.options = model, parts, rollout_object, options
        self.hand: Hand = options.hand
        self.data = mujoco.MjData(model)

    def compute_motion(self, states: RolloutStates, rows: NDArray[np.intp], is_replayed: bool) -> GraspMotion:
        """Compute poses and contacts at the recorded states `rows` of one grasp.

        is_replayed: step the model with the recorded controls (if the file has them) instead of evaluating each
        recorded state. If the file contains only the first state, the model is always stepped. Raises ImportDataError
        if the replay deviates from the recording.
        """
        is_stepped = states.has_start_only or ("ctrl" in states.values and is_replayed)
        snapshots: list[_Snapshot] = []
        for done, row in enumerate(rows.tolist()):
            self.options.progress(f"grasp {states.grasp[row]}", done, len(rows))
            if not is_stepped or done == 0:
                mujoco.mj_resetData(self.model, self.data)
                self._set_values(states, row, STATES)
            else:
                self._step_to(states, row)
            snapshots.append(self._take_snapshot())
        self.options.progress(f"grasp {states.grasp[int(rows[0])]}", len(rows), len(rows))
        contacts = [snapshot.contacts for snapshot in snapshots]
        sensors = np.stack([snapshot.sensors for snapshot in snapshots])
        wrench = [
            compute_board_wrenches(step, snapshot.sensors) for step, snapshot in zip(contacts, snapshots, strict=True)
        ]
        no_joints = np.zeros((len(rows), 0))
        return GraspMotion(
            states.time_s[rows],
            states.phase[rows],
            no_joints,
            no_joints.reshape(len(rows), 0, 1, 1),
            sensors,
            np.stack([snapshot.object_pose for snapshot in snapshots]),
            np.stack(wrench),
            ContactPoints.concatenate(contacts),
        )

    def _set_values(self, states: RolloutStates, row: int, names: tuple[str, ...]) -> None:
        """Copy the arrays `names` of the recorded state `row` into the data of the MuJoCo model."""
        for name in names:
            if name in states.values:
                values = states.values[name]
                getattr(self.data, name)[...] = values[row if len(values) > 1 else 0]  # one row: the first state only

    def _step_to(self, states: RolloutStates, row: int) -> None:
        """Simulate from the state before `row` to the state `row`, with the controls of the state before.

        Raises ImportDataError if the result deviates from the recorded state by more than `REPLAY_TOLERANCE`.
        """
        self._set_values(states, row - 1, ("ctrl", "mocap_pos", "mocap_quat", "qfrc_applied", "eq_active"))
        elapsed_s, step_s = states.time_s[row] - states.time_s[row - 1], self.model.opt.timestep
        for _ in range(max(round(elapsed_s / step_s), 1)):
            mujoco.mj_step(self.model, self.data)
        self._set_values(states, row, ("mocap_pos", "mocap_quat", "eq_active"))
        if states.has_start_only:
            return
        deviation = np.abs(self.data.qpos - states.values["qpos"][row])
        if deviation.max(initial=0.0) > REPLAY_TOLERANCE:
            index = int(np.argmax(deviation))
            expected = f"the result of stepping with ctrl, within {REPLAY_TOLERANCE:g}"
            remedy = "save ctrl and time at every step, or evaluate the recorded states (--forward)"
            found = f"a deviation of {deviation[index]:.3g}"
            states.source.key(f"qpos[{row}, {index}]").fail(expected, found, remedy)

    def _take_snapshot(self) -> _Snapshot:
        """Return bracket poses, object pose and contacts of the present state of the MuJoCo model."""
        mujoco.mj_forward(self.model, self.data)
        body = self.parts.board_body
        sensors = _poses(self.data.xmat[body], self.data.xpos[body]) @ self.parts.board_pose
        object_body = self.parts.object_body
        body_pose = _poses(self.data.xmat[object_body], self.data.xpos[object_body])
        return _Snapshot(sensors, body_pose @ self.rollout_object.frame, self._find_contacts(sensors))

    def _find_contacts(self, sensors: FloatArray) -> StepContacts:
        """Find the contact points between the object and bodies with boards; forces and normals point into the boards.

        sensors: f64[s, 4, 4], poses of the brackets in the world.
        """
        contact = self.data.contact
        geoms = np.asarray(contact.geom, dtype=np.int64).reshape(-1, 2)
        is_object = self.rollout_object.is_geom[geoms]
        # efc_address is -1 for a contact without a force, such as one within the margin.
        indices = np.flatnonzero((is_object.sum(axis=1) == 1) & (np.asarray(contact.efc_address) >= 0))
        is_object_first = is_object[indices, 0]  # MuJoCo's normal points from the first geom to the second
        other_geom = np.where(is_object_first, geoms[indices, 1], geoms[indices, 0])
        frame = np.asarray(contact.frame)[indices].reshape(-1, 3, 3)
        local_force, wrench = np.zeros((len(indices), 3)), np.zeros(6)
        for row, index in enumerate(indices):
            mujoco.mj_contactForce(self.model, self.data, int(index), wrench)
            local_force[row] = wrench[:3]
        sign = np.where(is_object_first, 1.0, -1.0)[:, None]
        normal = sign * frame[:, 0]
        position = np.asarray(contact.pos)[indices].copy()
        force = sign * np.einsum("ci,cij->cj", local_force, frame)
        board = self._find_boards(other_geom, position, sensors)
        on_hand = (board >= 0) | self._is_on_hand(other_geom)
        depth = -np.asarray(contact.dist)[indices]
        return StepContacts(board[on_hand], position[on_hand], normal[on_hand], depth[on_hand], force[on_hand])

    def _is_on_hand(self, geom: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether each geom belongs to a body with boards, bool[c]; other bodies are, for example, a table."""
        return np.isin(self.model.geom_bodyid[geom], self.parts.board_body)

    def _find_boards(self, geom: NDArray[np.int64], position: FloatArray, sensors: FloatArray) -> NDArray[np.int64]:
        """Return the board of each of c contact points, i64[c]; -1: none.

        geom: i64[c], index of the touched MuJoCo geom. position: f64[c, 3], world, metres. sensors: f64[s, 4, 4],
        bracket poses in the world. A geom that belongs to no board, but to the body of boards, gets the board of the
        nearest taxel of this body.
        """
        board = self.parts.board_of_geom[geom]
        without_geom = np.flatnonzero(board < 0)
        if not len(without_geom) or not self.parts.is_by_body.any():
            return board
        centres = compute_taxel_positions(self.hand, sensors)
        body_of_taxel = np.where(self.parts.is_by_body, self.parts.board_body, -1)[self.hand.board_index]
        for index in without_geom:
            distance = np.linalg.norm(centres - position[index], axis=1)
            distance[body_of_taxel != self.model.geom_bodyid[geom[index]]] = np.inf
            taxel = int(np.argmin(distance))
            if distance[taxel] <= NEAR_M:
                board[index] = self.hand.board_index[taxel]
        return board


def _poses(rotations: FloatArray, origins: FloatArray) -> FloatArray:
    """Build poses f64[..., 4, 4] from MuJoCo's rotation matrices f64[..., 9] and origins f64[..., 3]."""
    result = np.zeros((*origins.shape[:-1], 4, 4))
    result[..., :3, :3] = rotations.reshape(*origins.shape[:-1], 3, 3)
    result[..., :3, 3] = origins
    result[..., 3, 3] = 1.0
    return result
