"""Simulator mode of the twin: contacts compared with their predictions."""

import numpy as np
import pytest

from host.tests.command_line import run_refused_command
from host.tests.twin.simulated_rig import BOARD, BOX, HAND, make_poses, make_simulator, move_object
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.twin import Contact, ContactSchedule, Twin
from taxel.twin.errors import TwinInputError
from taxel.twin.reference import learn_reference
from taxel.twin.simulated.poses import ConstantPoses
from taxel.twin.simulated.predicted_contacts import SimulatedContacts
from taxel.twin.simulated.reference import learn_simulated_reference
from taxel.twin.simulated.set_up import make_shape
from taxel.twin.steps import HOLD, StepBuilder

RATE_HZ = 20.0


class Rig:
    """Generates contacts of the box with a random position and depth, measured by a skin of known gain.

    seed: of all random numbers. gain: f64[n], response relative to a healthy taxel.
    """

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.simulator = make_simulator()
        self.gain = np.ones(HAND.n_taxels)
        self.time_s = 0.0

    def indent(self, approach="centre"):
        """Indent the board once, for 8 s with the interval before.

        Returns the contact, the nominal poses and the poll cycles.
        """
        true = make_poses(depth_m=self.rng.uniform(0.0005, 0.0009), tilt_rad=self.rng.normal(0.0, 0.01))
        shift = self.rng.normal(0.0, 0.001, 3)
        nominal = move_object(true, tuple(shift), self.rng.normal(0.0, 0.02))
        signal = self.simulator.predict(true) * self.gain * (1.0 + 0.02 * self.rng.normal(size=HAND.n_taxels))
        start = self.time_s + 4.0
        contact = Contact((start, start + 1.0, start + 2.0, start + 3.0, start + 4.0), ("box", approach))
        times = self.time_s + (np.arange(round(8.0 * RATE_HZ)) + 0.5) / RATE_HZ
        self.time_s += 8.0
        share = np.interp(times, contact.times_s, (0.0, 1.0, 1.0, 0.0, 0.0), left=0.0, right=0.0)
        raw = 2400.0 - share[:, None] * signal + 4.0 * self.rng.normal(size=(len(times), HAND.n_taxels))
        cycles = (
            times,
            np.clip(np.rint(raw), 0, 65_535).astype(np.uint16),
            np.ones((len(times), len(HAND.boards)), bool),
        )
        return contact, nominal, cycles


def make_steps(contacts):
    """Return the steps of the contacts of `contacts`."""
    builder = StepBuilder(
        ContactSchedule([contact for contact, _, _ in contacts]), HAND.board_index, len(HAND.boards), 4.0
    )
    done = [step for _, _, cycles in contacts for step in builder.take(*cycles)]
    return done + builder.advance(contacts[-1][0].end_s + 1.0)


@pytest.fixture(scope="module")
def rig():
    """The rig after the contacts of the reference."""
    return Rig(seed=3)


@pytest.fixture(scope="module")
def reference(rig, tables):
    """Reference of the simulator mode from 12 contacts."""
    contacts = [rig.indent() for _ in range(12)]
    base = learn_reference(*tables, [(0, step) for step in make_steps(contacts)], "rig")
    assert len(base.steps) == 12
    predictions = SimulatedContacts({"box": rig.simulator})
    return learn_simulated_reference(base, predictions, [nominal for _, nominal, _ in contacts])


@pytest.fixture(scope="module")
def tables():
    """Tables of the taxels and boards of the rig."""
    size = np.full(HAND.n_taxels, HAND.size_m)
    address = np.array([board.address for board in HAND.boards], np.uint8)
    names = tuple(board.name for board in HAND.boards)
    return (
        TaxelTable(HAND.sensor, HAND.tx, HAND.rx, HAND.position, HAND.normal, size),
        SensorTable(address, names, names, np.full(len(names), RATE_HZ)),
    )


def indent_and_expect(rig, reference, approach, nominal_shift_m=0.0):
    """Indent the board once, and return the signals in the hold phase and the expectation of the reference."""
    contact, nominal, cycles = rig.indent(approach)
    reference.predictions.poses = ConstantPoses(move_object(nominal, (0.0, 0.0, nominal_shift_m), 0.0))
    (step,) = (step for step in make_steps([(contact, nominal, cycles)]) if step.contact is not None)
    return step, reference.expect(step)


def test_the_prediction_is_nearer_to_a_contact_than_the_mean_of_its_repeats(rig, reference):
    step, known = indent_and_expect(rig, reference, "centre")
    means = step.compute_means()
    signal = (means[-1] - means)[HOLD].mean(axis=0)
    from_repeats = reference.conditions["box", "centre"].mean[HOLD].mean(axis=0)
    error = np.linalg.norm(known.mean[HOLD].mean(axis=0) - signal)
    assert error < 0.5 * np.linalg.norm(from_repeats - signal)


def test_a_contact_that_the_reference_does_not_contain_is_predicted(rig, reference):
    step, known = indent_and_expect(rig, reference, "new approach")
    assert reference.has_variance(known)
    assert np.isinf(reference.compute_variance(known, step)[1:5]).all()  # closing: its course is not known
    assert np.isfinite(reference.compute_variance(known, step)[HOLD]).all()


def test_a_pose_that_jumps_is_reported_and_the_contact_is_not_compared(rig, reference):
    reports = []
    reference.predictions.on_fault = reports.append
    _, known = indent_and_expect(rig, reference, "centre", nominal_shift_m=0.1)
    assert known is None
    assert len(reports) == 1
    assert "the pose of box does not explain the contact" in reports[0]


def test_an_unknown_pose_is_reported(rig, reference):
    reports = []
    reference.predictions.on_fault = reports.append
    contact, nominal, cycles = rig.indent()
    reference.predictions.poses = ConstantPoses(None)
    step = next(step for step in make_steps([(contact, nominal, cycles)]) if step.contact is not None)
    assert reference.expect(step) is None
    assert reports == ["the pose of box is unknown; the contact is not compared"]


def test_a_line_that_responds_less_raises_an_alarm_in_contacts_of_a_new_approach(rig, reference):
    healthy, changed = Rig(seed=8), Rig(seed=9)
    line = np.flatnonzero((HAND.board_index == HAND.boards.index(BOARD)) & (HAND.tx == 3))
    changed.gain[line] = 0.6
    alarms = []
    for source in (healthy, changed):
        contacts = [source.indent("another approach") for _ in range(12)]
        twin = Twin(reference, ContactSchedule([contact for contact, _, _ in contacts]))
        found = []
        for _, nominal, cycles in contacts:
            reference.predictions.poses = ConstantPoses(nominal)
            found += [event for result in twin.take(*cycles) for event in result.events]
        alarms.append([str(event) for event in found])
    assert alarms[0] == []
    assert any("TX line 3 of slab" in text for text in alarms[1]), alarms[1]


def test_a_reference_without_explained_contacts_is_refused(rig, tables):
    contacts = [rig.indent() for _ in range(4)]
    base = learn_reference(*tables, [(0, step) for step in make_steps(contacts)], "rig")
    away = [move_object(nominal, (0.0, 0.0, 0.3), 0.0) for _, nominal, _ in contacts]
    with pytest.raises(TwinInputError, match="--simulate: reference: expected a condition with at least 3 contacts"):
        learn_simulated_reference(base, SimulatedContacts({"box": rig.simulator}), away)


def test_a_mesh_that_is_not_convex_is_refused():
    vertices, faces = BOX.mesh()
    assert make_shape("box", ObjectMesh(vertices, faces), None, "x.h5").bounds == pytest.approx(BOX.bounds, abs=1e-9)
    dented = vertices.copy()
    dented[0] = 0.3 * vertices[0] + 0.7 * vertices.mean(axis=0)
    with pytest.raises(TwinInputError, match=r"x\.h5: /objects/box: expected a convex mesh"):
        make_shape("box", ObjectMesh(dented, faces), None, "x.h5")


def test_sources_of_poses_need_the_simulator_mode(capsys):
    message = run_refused_command(capsys, "twin", "x.h5", "--reference", "y.h5", "--joint-angles", "0.1,0.2")
    assert "add --simulate" in message
