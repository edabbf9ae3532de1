"""`taxel import inspect`: contents of a file, and a proposed mapping that works unchanged."""

import json
import tomllib

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.importers.files import (
    FRAMES,
    make_time,
    make_values,
    number_columns,
    write_bag2,
    write_csv,
    write_lerobot,
)
from taxel.recording.general import GeneralDataset


def import_by_proposal(folder, *files):
    """Propose a mapping for the first file, import all files by it unchanged, and return the contacts."""
    assert run_taxel("import", "inspect", files[0], "--map-out", folder / "map.toml") == 0
    assert run_taxel("import", "map", *files, "--map", folder / "map.toml", "--out", folder / "out.h5") == 0
    with GeneralDataset(folder / "out.h5") as data:
        return list(data)


def test_the_proposal_for_a_plain_npz_works_unchanged(tmp_path):
    """The import accepts the mapping that `taxel import inspect` proposes. The first time becomes 0."""
    values = make_values(16)
    np.savez(tmp_path / "pad.npz", t=make_time() + 5.0, pressure=values)
    (contact,) = import_by_proposal(tmp_path, tmp_path / "pad.npz")
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())
    assert (contact.session, contact.object) == (1, "object")


@pytest.mark.parametrize("unit", ["s", "ms"])
def test_the_proposal_for_a_csv_of_a_10_x_10_mat_works_unchanged(tmp_path, unit):
    """The import accepts the mapping that `taxel import inspect` proposes, for times in seconds or milliseconds."""
    values = make_values(100)
    time = make_time() * (1000 if unit == "ms" else 1)
    write_csv(tmp_path / "mat.csv", {"time": time, **number_columns("p", values)})
    (contact,) = import_by_proposal(tmp_path, tmp_path / "mat.csv")
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())


def test_the_proposal_for_a_csv_without_header_takes_the_increasing_first_column_as_time(tmp_path):
    """Proposal: the mapping that `taxel import inspect` proposes, by which the file is imported unchanged."""
    values = make_values(100)
    write_csv(tmp_path / "mat.csv", {"time": make_time(), **number_columns("p", values)}, header=False)
    (contact,) = import_by_proposal(tmp_path, tmp_path / "mat.csv")
    np.testing.assert_array_equal(contact.values, values)


def test_the_proposal_takes_labels_and_contacts_from_the_columns_with_their_names(tmp_path):
    """Proposal: the mapping that `taxel import inspect` proposes. The column `episode` numbers the contacts."""
    values = make_values(6, frames=80)
    columns = {
        "stamp": np.tile(make_time(), 2),
        "episode": np.repeat([0, 1], FRAMES),
        "object": ["cube"] * FRAMES + ["ball"] * FRAMES,
        "session": np.repeat([3, 4], FRAMES),
        "phase": (["baseline"] * 20 + ["hold"] * 20) * 2,
    }
    write_csv(tmp_path / "log.csv", columns | number_columns("taxel_", values))
    first, second = import_by_proposal(tmp_path, tmp_path / "log.csv")
    assert (first.object, second.object, first.session, second.session) == ("cube", "ball", 3, 4)
    assert first.phase.tolist() == [0] * 20 + [2] * 20
    np.testing.assert_array_equal(second.values, values[FRAMES:])


def test_the_proposal_for_arrays_of_several_contacts_has_a_contact_axis(tmp_path):
    """Proposal: the mapping that `taxel import inspect` proposes. The first axis of the array has two contacts."""
    values = np.stack([make_values(9), make_values(9) + 1])
    with h5py.File(tmp_path / "sim.h5", "w") as file:
        file["run/values"] = values
        file["run/time"] = make_time()
    contacts = import_by_proposal(tmp_path, tmp_path / "sim.h5")
    assert len(contacts) == 2
    np.testing.assert_array_equal(contacts[1].values, values[1])


def test_the_proposal_for_vectors_has_three_components(tmp_path):
    """Proposal: the mapping that `taxel import inspect` proposes. The array has a force vector for each of 5 taxels."""
    values = make_values(5, 3)
    np.savez(tmp_path / "a.npz", time=make_time(), force=values)
    (contact,) = import_by_proposal(tmp_path, tmp_path / "a.npz")
    np.testing.assert_array_equal(contact.values, values)


def test_the_proposal_for_a_bag_works_unchanged(tmp_path):
    """The import of a ROS 2 bag accepts the mapping that `taxel import inspect` proposes."""
    values = make_values(8).round()
    bag = write_bag2(tmp_path / "bag", values)
    (contact,) = import_by_proposal(tmp_path, bag)
    np.testing.assert_array_equal(contact.values, values)


def test_the_proposal_for_a_lerobot_folder_works_unchanged_with_its_tasks_as_objects(tmp_path):
    folder = write_lerobot(tmp_path / "robot", "v3.0", [make_values(8), make_values(8)])
    assert [contact.object for contact in import_by_proposal(tmp_path, folder)] == ["pick", "place"]


def test_inspect_prints_the_shapes_of_the_fields_and_the_mapping_also_as_json(tmp_path, capsys):
    np.savez(tmp_path / "pad.npz", t=make_time(), pressure=make_values(16), name=np.array("mat"))
    assert run_taxel("import", "inspect", tmp_path / "pad.npz") == 0
    printed = capsys.readouterr().out
    assert "40 x 16" in printed
    assert "[values]" in printed
    assert run_taxel("import", "inspect", tmp_path / "pad.npz", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert {entry["name"] for entry in report["fields"]} == {"t", "pressure", "name"}
    assert tomllib.loads(report["map"])["values"] == {"field": "pressure"}


def test_inspect_does_not_replace_an_existing_mapping(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", t=make_time(), x=make_values(4))
    (tmp_path / "map.toml").write_text("mine")
    assert "exists" in run_refused_command(
        capsys, "import", "inspect", tmp_path / "a.npz", "--map-out", tmp_path / "map.toml"
    )
    assert (tmp_path / "map.toml").read_text() == "mine"


def test_a_file_without_an_array_of_taxels_gives_one_error_line(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", t=make_time())
    line = run_refused_command(capsys, "import", "inspect", tmp_path / "a.npz")
    assert "a.npz: /: expected an array [frame, taxel]" in line
