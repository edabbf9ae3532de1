"""`taxel import map`: every kind of file, every rule of the mapping, and the error line of each wrong mapping."""

import json
import sqlite3

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from rosbags.rosbag2 import StoragePlugin

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.importers.files import (
    FRAMES,
    START_NS,
    make_time,
    make_values,
    number_columns,
    write_bag1,
    write_bag2,
    write_csv,
    write_map,
)
from taxel.recording.errors import DatasetError
from taxel.recording.general import GeneralDataset
from taxel.recording.importers.sources import open_source

PLAIN = '[time]\nfield = "time"\n[values]\nfield = "values"\n'


def import_map(folder, text, *files):
    """Import files by a mapping; return the header and the contacts of the dataset."""
    path = write_map(folder / "map.toml", text)
    assert run_taxel("import", "map", *files, "--map", path, "--out", folder / "out.h5", "--overwrite") == 0
    with GeneralDataset(folder / "out.h5") as data:
        return data.header, list(data)


def refuse_map(capsys, folder, text, *files):
    """Import files by a wrong mapping; check that no dataset is written, and return the error line."""
    path = write_map(folder / "map.toml", text)
    line = run_refused_command(capsys, "import", "map", *files, "--map", path, "--out", folder / "out.h5")
    assert not (folder / "out.h5").exists()
    return line


@pytest.fixture
def npz(tmp_path):
    """Path of an archive with times, the values of 6 taxels, and their positions (`xyz`, millimetres)."""
    np.savez(tmp_path / "a.npz", time=make_time(), values=make_values(6), xyz=np.arange(18.0).reshape(6, 3))
    return tmp_path / "a.npz"


def test_declared_properties_and_the_sensor_are_written(tmp_path, npz, capsys):
    text = (
        'sensor = "mat"\nunit = "kPa"\ncontact = "raises"\nfull_scale = 100\nresolution = 0.5\nmodality = "resistive"\n'
    )
    header, _ = import_map(tmp_path, text + PLAIN, npz)
    assert header.sensor == "mat"
    assert header.properties.to_attributes() == {
        "unit": "kPa",
        "contact": "raises",
        "full_scale": 100.0,
        "resolution": 0.5,
        "modality": "resistive",
    }
    assert "1 contacts, 40 frames, 6 taxels" in capsys.readouterr().out


def test_json_output_has_the_numbers_of_the_report(tmp_path, npz, capsys):
    path = write_map(tmp_path / "map.toml", PLAIN)
    assert run_taxel("import", "map", npz, "--map", path, "--out", tmp_path / "o.h5", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report == {"file": str(tmp_path / "o.h5"), "contacts": 1, "frames": 40, "taxels": 6, "components": 1}


# Writers of one file each, with the fields `time` and `values` f64[T frames, n taxels]. They return its path.


def write_parquet(folder, values):
    flat = pyarrow.FixedSizeListArray.from_arrays(values.ravel(), values.shape[1])
    pyarrow.parquet.write_table(pyarrow.table({"time": make_time(), "values": flat}), folder / "a.parquet")
    return folder / "a.parquet"


def write_nested_parquet(folder, values):
    """Write a table in which the values of a frame are a list of two lists."""
    rows = values.reshape(len(values), 2, -1).tolist()
    pyarrow.parquet.write_table(pyarrow.table({"time": make_time(), "values": rows}), folder / "n.parquet")
    return folder / "n.parquet"


def write_hdf5(folder, values):
    with h5py.File(folder / "a.h5", "w") as file:
        file["time"], file["values"] = make_time(), values
    return folder / "a.h5"


def write_zarr(folder, values):
    """Write a Zarr store; skip the test if the package `zarr` is not installed."""
    zarr = pytest.importorskip("zarr")
    root = zarr.open_group(str(folder / "a.zarr"), mode="w")
    for name, array in (("time", make_time()), ("values", values)):
        root.create_array(name, shape=array.shape, dtype=array.dtype)[...] = array
    return folder / "a.zarr"


@pytest.mark.parametrize("write", [write_parquet, write_nested_parquet, write_hdf5, write_zarr])
def test_values_of_a_file_of_arrays_are_unchanged(tmp_path, write):
    values = make_values(6)
    _, (contact,) = import_map(tmp_path, PLAIN, write(tmp_path, values))
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())


def test_a_zarr_store_with_a_damaged_array_is_refused_and_an_empty_group_is_not(tmp_path):
    path = write_zarr(tmp_path, make_values(6))
    group = pytest.importorskip("zarr").open_group(str(path), mode="a").create_group("sub")
    group.create_group("empty")
    group.create_array("extra", data=np.arange(3.0))
    assert "sub/extra" in open_source(path).fields
    metadata = path / "sub" / "extra" / "zarr.json"
    metadata.write_text(metadata.read_text().replace("node_type", "no_type"))
    with pytest.raises(DatasetError, match=r"a\.zarr: "):
        open_source(path)


@pytest.mark.parametrize("key", ["dtype", "zarr_format"])
@pytest.mark.parametrize("name", ["time", "values"])
def test_a_zarr_store_of_format_2_whose_array_has_lost_a_key_is_refused(tmp_path, name, key):
    zarr = pytest.importorskip("zarr")
    root = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=2)
    for each in ("time", "values"):
        root.create_array(each, data=np.arange(4.0))
    metadata = tmp_path / "a.zarr" / name / ".zarray"
    metadata.write_text(metadata.read_text().replace(key, "another"))
    with pytest.raises(DatasetError, match=f"/{name}: expected a readable array or group, found damaged metadata"):
        open_source(tmp_path / "a.zarr")


def test_a_zarr_store_without_the_package_zarr_gives_one_error_line(tmp_path, capsys, monkeypatch):
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr/zarr.json").write_text("{}")
    monkeypatch.setitem(__import__("sys").modules, "zarr", None)
    assert "install the extra 'parquet'" in refuse_map(capsys, tmp_path, PLAIN, tmp_path / "a.zarr")


BAG_MAP = '[time]\nfield = "/tactile:header.stamp"\nunit = "ns"\n[values]\nfield = "/tactile:pads.values"\n'


@pytest.mark.parametrize("storage", ["mcap", "mcap file", "sqlite3", "sqlite3 file", "ROS 1"])
def test_a_topic_of_a_third_party_in_a_bag_is_imported_with_exact_times(tmp_path, storage):
    values = make_values(8).round()
    if storage == "ROS 1":
        path = write_bag1(tmp_path / "a.bag", values)
    else:
        plugin = StoragePlugin.MCAP if storage.startswith("mcap") else StoragePlugin.SQLITE3
        path = write_bag2(tmp_path / "bag", values, plugin)
        if storage.endswith("file"):
            path = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    text = write_map(tmp_path / "map.toml", BAG_MAP)
    assert run_taxel("import", "bag", path, "--map", text, "--out", tmp_path / "out.h5") == 0
    with GeneralDataset(tmp_path / "out.h5") as data:
        (contact,) = data
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time(), rtol=0, atol=1e-12)


def test_a_bag_with_a_damaged_index_is_refused(tmp_path):
    """SQLite uses the index on the time stamps without a check, and would return the messages in another order."""
    path = write_bag2(tmp_path / "bag", make_values(8), StoragePlugin.SQLITE3)
    (database,) = path.glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("CREATE INDEX IF NOT EXISTS timestamps ON messages (timestamp)")
        (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE type = 'index'").fetchone()
        (size,) = connection.execute("PRAGMA page_size").fetchone()
    data = bytearray(database.read_bytes())
    entry = data.index((START_NS + 5).to_bytes(8, "big"), (root - 1) * size)
    data[entry + 7] ^= 1
    database.write_bytes(data)
    with pytest.raises(DatasetError, match="with an undamaged SQLite database"):
        open_source(path)


def test_a_damaged_bag_gives_one_error_line(tmp_path, capsys):
    path = write_bag1(tmp_path / "a.bag", make_values(8))
    path.write_bytes(path.read_bytes()[:2000])
    assert "a.bag: /: expected a complete ROS bag" in refuse_map(capsys, tmp_path, BAG_MAP, path)


SELECTIONS = {
    "columns": 'columns = ["p2", "p0", "p1"]',
    "prefix": 'prefix = "p"',
    "range": 'range = ["p0", "p2"]',
    "elements": 'prefix = "p"\nelements = [1, 2]',
}


@pytest.mark.parametrize("case", SELECTIONS)
def test_columns_of_a_table_are_selected_in_the_declared_order(tmp_path, case):
    values = make_values(3)
    columns = number_columns("p", values)
    path = write_csv(tmp_path / "a.csv", {"time": make_time(), **dict(reversed(columns.items()))})
    if case == "range":  # selects columns by their position in the file, so the file must have them in order
        path = write_csv(tmp_path / "a.csv", {"time": make_time(), **columns})
    _, (contact,) = import_map(tmp_path, f'[time]\nfield = "time"\n[values]\n{SELECTIONS[case]}\n', path)
    expected_columns = {"columns": [2, 0, 1], "elements": [1, 2]}.get(case, [0, 1, 2])
    np.testing.assert_array_equal(contact.values, values[:, expected_columns])


@pytest.mark.parametrize("order", ["taxel", "component"])
def test_vectors_are_arranged_by_the_declared_order(tmp_path, order):
    values = make_values(4, 3)
    flat = values.reshape(FRAMES, -1) if order == "taxel" else values.swapaxes(1, 2).reshape(FRAMES, -1)
    np.savez(tmp_path / "a.npz", time=make_time(), values=flat)
    _, (contact,) = import_map(
        tmp_path, f'{PLAIN}components = 3\norder = "{order}"\nshape = [2, 2]\n', tmp_path / "a.npz"
    )
    np.testing.assert_array_equal(contact.values, values)


def test_a_frame_axis_at_the_end_is_moved_to_the_front(tmp_path):
    values = make_values(6)
    np.savez(tmp_path / "a.npz", time=make_time(), values=values.T)
    _, (contact,) = import_map(tmp_path, f"{PLAIN}frame_axis = 1\n", tmp_path / "a.npz")
    np.testing.assert_array_equal(contact.values, values)


def test_a_pause_starts_a_new_contact_and_short_contacts_are_left_out_on_request(tmp_path, capsys):
    time = make_time(100)
    time[40:] += 3.0
    time[90:] += 3.0
    np.savez(tmp_path / "a.npz", time=time, values=make_values(6, frames=100))
    text = PLAIN + "[grasp]\ngap_s = 1.0\n"
    line = refuse_map(capsys, tmp_path, text, tmp_path / "a.npz")
    assert "contact 3: expected at least 20 frames, found 10" in line
    _, contacts = import_map(tmp_path, text + "skip_short = true\n", tmp_path / "a.npz")
    assert [len(contact.time) for contact in contacts] == [40, 50]
    assert contacts[1].time[0] == 0.0


def test_frames_without_a_contact_number_are_left_out(tmp_path):
    ids = np.repeat([0, -1, 1], [30, 10, 30])
    np.savez(tmp_path / "a.npz", time=make_time(70), values=make_values(6, frames=70), id=ids)
    _, contacts = import_map(tmp_path, PLAIN + '[grasp]\nfield = "id"\n', tmp_path / "a.npz")
    assert [len(contact.time) for contact in contacts] == [30, 30]


def test_every_file_is_a_contact_with_the_labels_of_its_pattern(tmp_path):
    for name in ("day1_cube.npz", "day2_ball.npz"):
        np.savez(tmp_path / name, time=make_time(), values=make_values(6))
    text = 'session = 7\nobject = "none"\napproach = "top"\n' + PLAIN
    text += '[[files]]\npattern = "day2_*"\nsession = 2\n[[files]]\npattern = "*ball*"\nobject = "ball"\n'
    _, contacts = import_map(tmp_path, text, tmp_path / "day1_cube.npz", tmp_path / "day2_ball.npz")
    labels = [(contact.session, contact.object, contact.approach) for contact in contacts]
    assert labels == [(7, "none", "top"), (2, "ball", "top")]


def test_positions_of_a_declared_grid_have_its_pitch(tmp_path, npz):
    header, _ = import_map(tmp_path, PLAIN + "[positions]\nrows = 2\ncolumns = 3\npitch_mm = 4.0\n", npz)
    np.testing.assert_allclose(header.places.position[4], [0.004, 0.004, 0.0])
    np.testing.assert_allclose(header.places.size, 0.004)


def test_positions_of_a_field_are_converted_to_metres(tmp_path, npz):
    header, _ = import_map(tmp_path, PLAIN + '[positions]\nfield = "xyz"\nunit = "mm"\n', npz)
    np.testing.assert_allclose(header.places.position, np.arange(18.0).reshape(6, 3) * 1e-3)


def test_declared_sensors_and_lines_of_the_taxels_are_written(tmp_path, npz):
    text = PLAIN + "[taxels]\nsensor = [0, 0, 0, 1, 1, 1]\ntx = [0, 0, 0, 1, 1, 1]\nrx = [0, 1, 2, 0, 1, 2]\n"
    places = import_map(tmp_path, text, npz)[0].places
    assert places.sensor.tolist() == [0, 0, 0, 1, 1, 1]
    assert (places.tx.tolist(), places.rx.tolist()) == ([0, 0, 0, 1, 1, 1], [0, 1, 2, 0, 1, 2])


def test_validity_and_forces_of_a_simulation_are_read(tmp_path):
    valid = np.ones(FRAMES)
    valid[3] = 0
    np.savez(tmp_path / "a.npz", time=make_time(), values=make_values(6), ok=valid, f=make_values(6), d=make_values(6))
    text = 'valid = "ok"\nforce = "f"\nseparation = "d"\n' + PLAIN
    path = write_map(tmp_path / "map.toml", text)
    path.write_text(path.read_text().replace('"real"', '"sim"'))
    assert run_taxel("import", "map", tmp_path / "a.npz", "--map", path, "--out", tmp_path / "out.h5") == 0
    with GeneralDataset(tmp_path / "out.h5") as data:
        (contact,) = data
    assert contact.is_missing().nonzero()[0].tolist() == [3]
    np.testing.assert_array_equal(contact.force, make_values(6))


def test_a_rate_replaces_missing_times(tmp_path, npz):
    _, (contact,) = import_map(tmp_path, '[time]\nrate_hz = 50.0\n[values]\nfield = "values"\n', npz)
    np.testing.assert_allclose(contact.time, make_time())


def test_unsigned_nanoseconds_since_1970_keep_their_differences(tmp_path):
    time = np.uint64(1_700_000_000_000_000_001) + np.arange(FRAMES, dtype=np.uint64) * np.uint64(20_000_000)
    np.savez(tmp_path / "a.npz", time=time, values=make_values(6))
    text = PLAIN.replace("[values]", 'unit = "ns"\n[values]')
    _, (contact,) = import_map(tmp_path, text, tmp_path / "a.npz")
    np.testing.assert_allclose(contact.time, make_time(), rtol=0, atol=1e-12)


def test_an_empty_entry_of_a_table_is_a_missing_value(tmp_path):
    path = write_csv(tmp_path / "a.csv", {"time": make_time(), **number_columns("p", make_values(3))})
    lines = path.read_text().splitlines()
    lines[5] = lines[5].rpartition(",")[0] + ","
    path.write_text("\n".join(lines))
    _, (contact,) = import_map(tmp_path, '[time]\nfield = "time"\n[values]\nprefix = "p"\n', path)
    assert np.argwhere(np.isnan(contact.values)).tolist() == [[4, 2]]


WRONG_MAPS = {  # case: (mapping, expected text of the error)
    "unknown key": ('colour = "red"\n' + PLAIN, "map.toml: /colour: expected a known key, found an unknown one"),
    "unknown key in a table": (PLAIN + 'fields_ = "x"\n', "map.toml: /values/fields_: expected a known key"),
    "no values": ('[time]\nfield = "time"\n', "map.toml: /values: expected a table, found nothing"),
    "no time": ('[values]\nfield = "values"\n', "map.toml: /time: expected a table, found nothing"),
    "two selections": (PLAIN + 'prefix = "p"\n', "map.toml: /values: expected one of the keys field, fields"),
    "time and rate": (
        PLAIN.replace("[values]", "rate_hz = 5.0\n[values]"),
        "expected either field or rate_hz, found both",
    ),
    "unit": (PLAIN.replace("[values]", 'unit = "h"\n[values]'), "/time/unit: expected one of s, ms, us, ns, found 'h'"),
    "components": (PLAIN + "components = 2\n", "/values/components: expected 1 or 3, found 2"),
    "vectors": (PLAIN.replace('"values"', '"odd"') + "components = 3\n", "expected a multiple of 3 values in a frame"),
    "shape": (PLAIN + "shape = [2, 2]\n", "/values/shape: expected 4 taxels (2 x 2), found 6 taxels"),
    "missing field": (PLAIN.replace('"values"', '"value"'), "a.npz: /value: expected a field of the NumPy archive"),
    "suggestion": (PLAIN.replace('"values"', '"value"'), "use values"),
    "grid": (PLAIN + "[positions]\nrows = 2\ncolumns = 2\npitch_mm = 1.0\n", "expected shape (6, 3)"),
    "two rules": (PLAIN + '[grasp]\ngap_s = 1.0\nfield = "time"\n', "expected at most one of field, gap_s and axis"),
    "session": ("session = -1\n" + PLAIN, "/session: expected a number of 0 or more"),
    "force alone": ('force = "values"\n' + PLAIN, "expected both force and separation"),
    "direction": ('contact = "up"\n' + PLAIN, "/contact: expected one of raises, lowers, signed, found 'up'"),
    "full scale": ("full_scale = -1.0\n" + PLAIN, "full_scale"),
    "text as values": (
        PLAIN.replace('"values"', '"label"'),
        "a.npz: /label: expected an array of numbers, found 'cube'",
    ),
    "NaN time": (
        PLAIN.replace('"time"', '"nan_time"'),
        "/time: expected a finite time of every frame, found nan in frame 7",
    ),
    "other length": (PLAIN.replace('"time"', '"short"'), "a.npz: /short: expected 40 times, one for each frame"),
    "decreasing": (PLAIN.replace('"time"', '"reverse"'), "expected increasing times in a contact"),
    "phase": ('phase = "short"\n' + PLAIN, "expected 40 entries, one for each frame, found 39"),
    "infinite": (PLAIN.replace('"values"', '"infinite"'), "expected finite numbers, or NaN for a missing value"),
    "no frames": (
        PLAIN.replace('"time"', '"empty"').replace('"values"', '"empty_values"'),
        "expected at least one frame",
    ),
    "positions": (
        PLAIN + '[positions]\nfield = "time"\n',
        "/time: expected 3 coordinates of each taxel, found shape (40,)",
    ),
    "NaN session": ('session = { field = "all_nan" }\n' + PLAIN, "/session: expected a number of 0 or more, found nan"),
    "label": (
        'object = { field = "time" }\n' + PLAIN,
        "/object: expected one label in each contact, found 0.0 and 0.02",
    ),
}


@pytest.mark.parametrize("case", WRONG_MAPS)
def test_a_wrong_mapping_gives_one_error_line_with_file_and_key(tmp_path, capsys, case):
    nan_time, infinite = make_time(), make_values(6)
    nan_time[7] = np.nan
    infinite[3, 3] = np.inf
    np.savez(
        tmp_path / "a.npz",
        time=make_time(),
        values=make_values(6),
        odd=make_values(7),
        label=np.array(["cube"] * FRAMES),
        nan_time=nan_time,
        short=make_time()[:-1],
        reverse=make_time()[::-1],
        infinite=infinite,
        empty=np.empty(0),
        empty_values=np.empty((0, 6)),
        all_nan=np.full(FRAMES, np.nan),
    )
    text, message = WRONG_MAPS[case]
    assert message in refuse_map(capsys, tmp_path, text, tmp_path / "a.npz")


@pytest.mark.parametrize("text", ["[time\n", 'format = "other"\n', 'format = "taxel-import-map"\nversion = 2\n'])
def test_a_file_that_is_no_mapping_gives_one_error_line(tmp_path, npz, capsys, text):
    (tmp_path / "map.toml").write_text(text)
    line = run_refused_command(capsys, "import", "map", npz, "--map", tmp_path / "map.toml", "--out", tmp_path / "o.h5")
    assert "map.toml" in line
