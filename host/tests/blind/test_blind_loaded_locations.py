"""Loaded lines and taxels of a simulated campaign: faults are expected in the report only there."""

import numpy as np
import pytest

from taxel.blind.hidden import Cause, FaultLocation, HiddenCauses
from taxel.blind.results import is_location_found, read_results
from taxel.blind.run_folder import WORLDS
from taxel.blind.world import World
from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorModel,
    SensorTable,
    TaxelTable,
)

ROWS, COLUMNS, FRAMES = 3, 2, 30
TAXELS = ROWS * COLUMNS
LOADED_TAXEL = 3
"""The taxel at TX 1, RX 1."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Make the folder of a check of one world without a report.

    In the simulated dataset of the world, only the taxel `LOADED_TAXEL` has a signal, 400 counts.
    """
    out = tmp_path_factory.mktemp("check")
    world_folder = out / WORLDS / "0000"
    world_folder.mkdir(parents=True)
    number = np.arange(TAXELS)
    position = np.column_stack([0.005 * (number // COLUMNS), 0.005 * (number % COLUMNS), np.zeros(TAXELS)])
    table = TaxelTable(
        np.full(TAXELS, 0x50, np.uint8),
        (number // COLUMNS).astype(np.uint8),
        (number % COLUMNS).astype(np.uint8),
        position,
        np.tile([0.0, 0.0, 1.0], (TAXELS, 1)),
        np.full(TAXELS, 0.003),
    )
    phase = np.repeat([0, 1, 2, 3, 4], FRAMES // 5).astype(np.uint8)
    raw = np.full((FRAMES, TAXELS), 30_000, np.uint16)
    raw[phase == 2, LOADED_TAXEL] -= 400
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float) * 0.02
    mesh = ObjectMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32))
    with GraspDatasetWriter.create(
        world_folder / "sim.h5",
        DatasetHeader(
            source="sim",
            hand="a board",
            taxels=table,
            sensors=SensorTable(np.array([0x50], np.uint8), ("a",), ("k",), np.full(1, 20.0)),
            objects={"block": mesh},
            generator="a test",
            sensor_model=SensorModel(30_000.0, 2000.0, 1.5, 4.0),
        ),
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
            contact_force=np.zeros((FRAMES, TAXELS)),
            separation=np.zeros((FRAMES, TAXELS)),
        )
        data.add(record, "0000")
    (world_folder / "report.json").write_text('{"error": "no report"}')
    (world_folder / "done").touch()
    return out


def find_unobservable_causes(folder, *locations: FaultLocation) -> tuple[str, ...]:
    """Return the unobservable causes of a world with a dropout at the given locations and white noise."""
    causes = (Cause("dropout", "line open", (), locations), Cause("noise", "noise white", ()))
    (result,) = read_results(folder, [World(0, "rig4", 1, HiddenCauses("several", causes, ()), "00")])
    return result.unobservable_causes


@pytest.mark.parametrize(("locations", "is_loaded"), [
    ((FaultLocation(0x50, "tx", 1),), True),
    ((FaultLocation(0x50, "rx", 1),), True),
    ((FaultLocation(0x50, "tx", 0),), False),
    ((FaultLocation(0x51, "tx", 1),), False),
    ((FaultLocation(0x50, "tx", 0), FaultLocation(0x50, "tx", 1)), True),
    ((FaultLocation(0x50, "taxel", LOADED_TAXEL),), True),
    ((FaultLocation(0x50, "taxel", 1),), False),
    ((FaultLocation(0x51),), True),  # a board that stops responding is observable without a load
])  # fmt: skip
def test_one_of_several_causes_is_unobservable_if_none_of_its_locations_is_loaded(folder, locations, is_loaded):
    assert find_unobservable_causes(folder, *locations) == (() if is_loaded else ("dropout",))


def test_location_of_a_single_cause_that_is_not_loaded_is_not_expected_in_the_report(folder):
    """No contact loads the broken line, so the data do not show the fault, and its location is not scored (None)."""
    causes = (Cause("dropout", "line open", (), (FaultLocation(0x50, "tx", 0),)),)
    (result,) = read_results(folder, [World(0, "rig4", 1, HiddenCauses("single", causes, ()), "00")])
    assert result.unobservable_causes == ()
    assert result.is_location_found is None


@pytest.mark.parametrize(("lines", "taxels", "is_found"), [
    ([[0x50, "rx", 1]], [], True),
    ([], [LOADED_TAXEL], True),  # the only loaded taxel of the line: a dead taxel looks like a broken line
    ([], [1], False),
    ([[0x50, "rx", 0]], [], False),
])  # fmt: skip
def test_location_is_found_if_the_verdict_names_the_line_or_its_only_observable_taxel(folder, lines, taxels, is_found):
    causes = (Cause("dropout", "line open", (), (FaultLocation(0x50, "rx", 1),)),)
    world = World(0, "rig4", 1, HiddenCauses("single", causes, ()), "00")
    location = {"sensors": [], "lines": lines, "taxels": taxels}
    for in_verdict in (True, False):
        effects = [{"name": "dropout", "in_verdict": in_verdict, "where": location}]
        assert is_location_found(world, effects, folder / WORLDS / "0000") is (is_found and in_verdict)
