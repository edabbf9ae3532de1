"""Which lines and taxels a simulated campaign presses: only there a break can be asked for."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.blind.answers import _places_found, answers
from taxel.blind.drawing import World
from taxel.blind.hidden import Cause, Hidden, Place
from taxel.blind.run import WORLDS
from taxel.recording import GraspDatasetWriter, GraspRecord, ObjectMesh, SensorModel, SensorTable, TaxelTable

ROWS, COLUMNS, FRAMES = 3, 2, 30
N = ROWS * COLUMNS
PRESSED = 3
"""The taxel at TX 1, RX 1."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A check of one world, whose report names nothing; in its simulation one taxel has a signal of 400 counts."""
    out = tmp_path_factory.mktemp("check")
    own = out / WORLDS / "0000"
    own.mkdir(parents=True)
    number = np.arange(N)
    place = np.column_stack([0.005 * (number // COLUMNS), 0.005 * (number % COLUMNS), np.zeros(N)])
    table = TaxelTable(
        np.full(N, 0x50, np.uint8),
        (number // COLUMNS).astype(np.uint8),
        (number % COLUMNS).astype(np.uint8),
        place,
        np.tile([0.0, 0.0, 1.0], (N, 1)),
        np.full(N, 0.003),
    )
    phase = np.repeat([0, 1, 2, 3, 4], FRAMES // 5).astype(np.uint8)
    raw = np.full((FRAMES, N), 30_000, np.uint16)
    raw[phase == 2, PRESSED] -= 400
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float) * 0.02
    mesh = ObjectMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32))
    with GraspDatasetWriter.create(
        own / "sim.h5",
        source="sim",
        hand="a board",
        taxels=table,
        sensors=SensorTable(np.array([0x50], np.uint8), ("a",), ("k",), np.full(1, 20.0)),
        objects={"block": mesh},
        generator="a test",
        sensor_model=SensorModel(30_000.0, 2000.0, 1.5, 4.0),
    ) as data:
        record = GraspRecord(
            object="block",
            approach="press",
            iteration=0,
            session=0,
            timestamp=np.arange(FRAMES) / 20.0,
            phase=phase,
            raw_counts=raw,
            valid=np.ones((FRAMES, 1), bool),
            sensor_pose=np.eye(4)[None],
            object_pose=np.eye(4),
            contact_force=np.zeros((FRAMES, N)),
            separation=np.zeros((FRAMES, N)),
        )
        data.add(record, "0000")
    (own / "report.json").write_text('{"error": "it names nothing"}')
    (own / "done").touch()
    return out


def idle(folder, *places: Place) -> tuple[str, ...]:
    causes = (Cause("dropout", "line open", (), places), Cause("noise", "noise white", ()))
    (answer,) = answers(folder, [World(0, "rig4", 1, Hidden("several", causes, ()), "00")])
    return answer.idle


@pytest.mark.parametrize(("places", "loaded"), [
    ((Place(0x50, "tx", 1),), True),
    ((Place(0x50, "rx", 1),), True),
    ((Place(0x50, "tx", 0),), False),
    ((Place(0x51, "tx", 1),), False),
    ((Place(0x50, "tx", 0), Place(0x50, "tx", 1)), True),
    ((Place(0x50, "taxel", PRESSED),), True),
    ((Place(0x50, "taxel", 1),), False),
    ((Place(0x51),), True),  # a board that answers no more is seen without a press
])  # fmt: skip
def test_a_break_of_several_causes_is_asked_for_where_something_bears(folder, places, loaded):
    assert idle(folder, *places) == (() if loaded else ("dropout",))


def test_of_single_causes_places_are_asked_for_by_themselves(folder):
    causes = (Cause("dropout", "line open", (), (Place(0x50, "tx", 0),)),)
    (answer,) = answers(folder, [World(0, "rig4", 1, Hidden("single", causes, ()), "00")])
    assert answer.idle == ()
    assert answer.found_places is None


@pytest.mark.parametrize(("lines", "taxels", "found"), [
    ([[0x50, "rx", 1]], [], True),
    ([], [PRESSED], True),  # no other taxel of the line bears: nothing tells a broken line from this one dead
    ([], [1], False),
    ([[0x50, "rx", 0]], [], False),
])  # fmt: skip
def test_of_a_line_that_one_taxel_shows_that_taxel_is_the_place(folder, lines, taxels, found):
    causes = (Cause("dropout", "line open", (), (Place(0x50, "rx", 1),)),)
    world = World(0, "rig4", 1, Hidden("single", causes, ()), "00")
    where = {"sensors": [], "lines": lines, "taxels": taxels}
    for believed in (True, False):
        effects = [{"name": "dropout", "in_verdict": believed, "where": where}]
        assert _places_found(world, effects, folder / WORLDS / "0000") is (found and believed)
