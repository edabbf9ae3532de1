"""The presets of `taxel import`: values of a small file of each documented layout, and the error lines."""

import mujoco
import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.importers.files import FRAMES, make_time, make_values, numbered, write_csv, write_lerobot
from taxel.recording.general import GeneralDataset


@pytest.fixture
def import_preset(tmp_path):
    """Function that runs `taxel import ARGUMENTS --out out.h5` and returns the header and the contacts."""

    def run(*arguments):
        assert run_taxel("import", *arguments, "--out", tmp_path / "out.h5", "--overwrite") == 0
        with GeneralDataset(tmp_path / "out.h5") as data:
            return data.header, list(data)

    return run


@pytest.fixture
def refuse_preset(tmp_path, capsys):
    """Function that returns the error line of `taxel import ARGUMENTS --out out.h5`."""
    return lambda *arguments: run_refused_command(capsys, "import", *arguments, "--out", tmp_path / "out.h5")


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_lerobot_episodes_are_contacts_with_the_task_as_object(tmp_path, import_preset, version):
    episodes = [make_values(8), make_values(8, frames=30) + 1, make_values(8)]
    folder = write_lerobot(tmp_path / "robot", version, episodes)
    _, contacts = import_preset("lerobot", folder, "--column", "observation.tactile", "--session", 4)
    assert [contact.object for contact in contacts] == ["pick", "place", "pick"]
    assert {contact.session for contact in contacts} == {4}
    for contact, values in zip(contacts, episodes, strict=True):
        np.testing.assert_allclose(contact.values, values, rtol=1e-6)


def test_lerobot_elements_and_vectors(tmp_path, import_preset, refuse_preset):
    folder = write_lerobot(tmp_path / "robot", "v3.0", [make_values(8)])
    arguments = ("lerobot", folder, "--column", "observation.tactile")
    _, (contact,) = import_preset(*arguments, "--elements", "1-6", "--vectors", "--object", "cup")
    np.testing.assert_allclose(contact.values, make_values(8)[:, 1:7].reshape(FRAMES, 2, 3), rtol=1e-6)
    assert contact.object == "cup"
    assert "use observation.tactile" in refuse_preset("lerobot", folder, "--column", "observation.tactil")
    assert "--elements: expected a range" in refuse_preset(*arguments, "--elements", "6")


def write_tactile_map(path, values, first=0):
    """The table of the simulation of Lab-CORO: time_sec, frame, pred_0 ... pred_27."""
    frame = np.arange(len(values)) + first
    return write_csv(path, {"time_sec": frame / 50.0, "frame": frame, **numbered("pred_", values)})


def test_tsf85_files_of_both_pads_are_joined_by_their_common_frames(tmp_path, import_preset, refuse_preset):
    values = make_values(56)
    first = write_tactile_map(tmp_path / "TactileData_s1_tactile_maps.csv", values[:, :28])
    second = write_tactile_map(tmp_path / "TactileData_s2_tactile_maps.csv", values[2:, 28:], first=2)
    header, (contact,) = import_preset("tsf85", first, second, "--source", "sim")
    np.testing.assert_array_equal(contact.values, values[2:])
    assert np.bincount(header.places.sensor).tolist() == [28, 28]
    assert (header.source, header.sensor) == ("sim", "TSF-85")
    write_tactile_map(second, values[:, 28:], first=100)
    assert "/frame: expected frames that are also in" in refuse_preset("tsf85", first, second)


def test_tsf85_table_of_the_hardware_has_two_sets_of_28_columns(tmp_path, import_preset, refuse_preset):
    values = make_values(56)
    columns = {"timestamp_ms": make_time() * 1e3, **numbered("finger1_", values[:, :28], 1)}
    path = write_csv(tmp_path / "log.csv", columns | numbered("finger2_", values[:, 28:], 1))
    header, (contact,) = import_preset("tsf85", path)
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())
    assert header.properties.unit == "counts"
    _, (contact,) = import_preset("tsf85", path, "--columns", "finger2_1,finger2_28")
    np.testing.assert_array_equal(contact.values, values[:, 28:])
    assert "expected 28 or 56 columns, found 2" in refuse_preset("tsf85", path, "--columns", "finger2_1,finger2_2")
    other = write_csv(tmp_path / "b.csv", {"time": make_time(), **numbered("p", values[:, :20])})
    assert "expected one or two sets of 28 numbered columns" in refuse_preset("tsf85", other)


def test_uskin_columns_of_one_set_are_ordered_by_taxel_and_axis(tmp_path, import_preset, refuse_preset):
    values = make_values(16, 3)
    columns = {"t": make_time()}
    for axis, name in enumerate("xyz"):  # a table ordered by axis, with a second set of columns
        columns |= numbered(f"raw_{name}", values[:, :, axis]) | numbered(f"d_{name}", values[:, :, axis] - 1)
    path = write_csv(tmp_path / "log.csv", columns)
    header, (contact,) = import_preset("uskin", path, "--prefix", "d_")
    np.testing.assert_array_equal(contact.values, values - 1)
    assert header.properties.to_attributes() == {"unit": "counts", "contact": "signed", "modality": "magnetic"}
    columns.pop("raw_y3")
    path = write_csv(tmp_path / "log.csv", columns)
    assert "log.csv: /taxel 3: expected columns x, y and z, found no column y" in refuse_preset("uskin", path)
    assert "none with the prefix 'q_'" in refuse_preset("uskin", path, "--prefix", "q_")


@pytest.mark.parametrize("has_time", [True, False])
def test_uskin_table_without_header_is_in_the_order_of_the_server(tmp_path, import_preset, has_time):
    values = make_values(16, 3)
    columns = {"t": make_time()} if has_time else {}
    path = write_csv(tmp_path / "log.csv", columns | numbered("c", values.reshape(FRAMES, -1)), header=False)
    _, (contact,) = import_preset("uskin", path, *(() if has_time else ("--rate-hz", 50)))
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())


MODEL = """<mujoco>
<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
<asset><mesh name="pad" builtin="plate" params="4 3" scale=".05 .05 .01"/></asset>
<worldbody>
  <body name="board"><geom type="box" size=".05 .05 .01"/>
  <site name="site" pos="0 0 .03" type="box" size=".05 .05 .03"/>
  <geom name="skin" type="mesh" mesh="pad" pos="0 0 .012" contype="0" conaffinity="0"/></body>
  <body pos="0 0 .029"><freejoint/><geom type="sphere" size=".02"/></body>
</worldbody>
<sensor>
  <gyro name="imu" site="site"/>
  <touch name="tip" site="site"/>
  <plugin name="grid" plugin="mujoco.sensor.touch_grid" objtype="site" objname="site">
    <config key="nchannel" value="3"/><config key="size" value="4 3"/>
    <config key="fov" value="90 90"/><config key="gamma" value="0"/></plugin>
  <tactile name="skin" geom="skin" mesh="pad"/>
</sensor></mujoco>"""


@pytest.fixture
def simulated(tmp_path):
    """A simulated MuJoCo model with the three sensors: folder with model.xml and run.npz, and sensordata [T, k]."""
    from taxel.recording.importers.mujoco_sensors import _load_plugins

    _load_plugins(mujoco)
    (tmp_path / "model.xml").write_text(MODEL)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    rows, times = [], []
    for _ in range(FRAMES):
        mujoco.mj_step(model, data)
        rows.append(data.sensordata.copy())
        times.append(data.time)
    np.savez(tmp_path / "run.npz", sensordata=rows, time=times)
    return tmp_path, np.array(rows)


def test_mujoco_touch_is_one_value_and_touch_grid_and_tactile_are_vectors(simulated, import_preset, refuse_preset):
    folder, data = simulated
    arguments = ("mujoco-sensors", folder / "run.npz", "--model", folder / "model.xml")
    header, (contact,) = import_preset(*arguments, "--sensors", "tip")
    np.testing.assert_array_equal(contact.values, data[:, 3:4])
    assert contact.values.max() > 0
    assert (header.source, header.properties.unit, header.properties.contact) == ("sim", "N", "raises")
    _, (contact,) = import_preset(*arguments, "--sensors", "grid")
    images = data[:, 4:40].reshape(FRAMES, 3, 12)
    np.testing.assert_array_equal(contact.values[..., 2], images[:, 0])
    np.testing.assert_array_equal(contact.values[..., 0], images[:, 1])
    header, (contact,) = import_preset(*arguments, "--sensors", "skin")
    assert contact.values.shape == (FRAMES, 12, 3)
    assert header.properties.unit is None
    assert "expected sensors of one number of components" in refuse_preset(*arguments)
    header, (contact,) = import_preset(*arguments, "--normal-only")
    assert contact.values.shape == (FRAMES, 25)
    assert np.bincount(header.places.sensor).tolist() == [1, 12, 12]


def test_mujoco_layout_replaces_the_model(simulated, import_preset, refuse_preset):
    folder, _ = simulated
    layout = "imu:skip:3,tip:touch,grid:touch_grid:4x3x3,skin:tactile:12"
    arguments = ("mujoco-sensors", folder / "run.npz")
    _, (by_layout,) = import_preset(*arguments, "--layout", layout, "--sensors", "grid,skin")
    _, (by_model,) = import_preset(*arguments, "--model", folder / "model.xml", "--sensors", "grid,skin")
    np.testing.assert_array_equal(by_layout.values, by_model.values)
    assert "expected sensors such as" in refuse_preset(*arguments, "--layout", "tip:touch:4")
    assert "--model and --layout: expected one of them" in refuse_preset(*arguments)
    assert "expected shape [T, k] with k of at least 900" in refuse_preset(*arguments, "--layout", "a:tactile:300")
    assert "none of this name" in refuse_preset(*arguments, "--layout", layout, "--sensors", "tap")
    (folder / "bad.xml").write_text("<mujoco><x/></mujoco>")
    assert "expected a MuJoCo model" in refuse_preset(*arguments, "--model", folder / "bad.xml")


def test_isaac_force_field_has_shear_and_normal_components(tmp_path, import_preset, refuse_preset):
    normal, shear = make_values(4, 5), make_values(4, 5, 2)
    arrays = {"tactile_normal_force": normal, "tactile_shear_force": shear}
    np.savez(tmp_path / "a.npz", time=make_time(), **arrays)
    header, (contact,) = import_preset("isaac", tmp_path / "a.npz")
    np.testing.assert_array_equal(contact.values[..., 2], normal.reshape(FRAMES, 20))
    np.testing.assert_array_equal(contact.values[..., :2], shear.reshape(FRAMES, 20, 2))
    assert (header.sensor, header.properties.contact) == ("Isaac Lab", "signed")
    _, contacts = import_preset("isaac", tmp_path / "a.npz", "--environments")
    assert len(contacts) == 4
    np.testing.assert_array_equal(contacts[3].values[..., 2], normal[:, 3])
    np.savez(tmp_path / "b.npz", time=make_time(), **arrays | {"tactile_shear_force": shear[:, :3]})
    assert "b.npz: /tactile_shear_force: expected shape (40, 4, 5, 2)" in refuse_preset("isaac", tmp_path / "b.npz")


def test_isaac_contact_forces_of_bodies_and_filters(tmp_path, import_preset, refuse_preset):
    net = make_values(2, 3, 3)  # 2 environments, 3 bodies
    np.savez(tmp_path / "a.npz", net_forces_w=net)
    _, contacts = import_preset("isaac", tmp_path / "a.npz", "--rate-hz", 50)
    np.testing.assert_array_equal(contacts[1].values, net[:, 1])
    matrix = make_values(3, 2, 3)  # 3 bodies, 2 filters
    np.savez(tmp_path / "b.npz", force_matrix_w=matrix, time=make_time())
    _, (contact,) = import_preset("isaac", tmp_path / "b.npz")
    np.testing.assert_allclose(contact.values, matrix.sum(axis=2))
    assert "--rate-hz" in refuse_preset("isaac", tmp_path / "a.npz")
    np.savez(tmp_path / "c.npz", time=make_time(), other=net)
    assert "expected an array tactile_normal_force" in refuse_preset("isaac", tmp_path / "c.npz")
    np.savez(tmp_path / "d.npz", time=make_time(), net_forces_w=make_values(4))
    assert "d.npz: /net_forces_w: expected shape [T, bodies, 3]" in refuse_preset("isaac", tmp_path / "d.npz")


def test_genesis_arrays_of_read(tmp_path, import_preset, refuse_preset):
    force, penetration = make_values(2, 6, 3), make_values(2, 6)  # 2 environments, 6 probes
    np.savez(tmp_path / "a.npz", force=force, penetration=penetration, time=make_time())
    header, contacts = import_preset("genesis", tmp_path / "a.npz", "--environments")
    np.testing.assert_array_equal(contacts[1].values, force[:, 1])
    assert header.properties.to_attributes() == {"unit": "N", "contact": "signed", "modality": "other"}
    header, contacts = import_preset("genesis", tmp_path / "a.npz", "--environments", "--field", "penetration")
    np.testing.assert_array_equal(contacts[0].values, penetration[:, 0])
    assert header.properties.unit == "m"
    np.save(tmp_path / "b.npy", make_values(4, 5, 3))
    _, (contact,) = import_preset("genesis", tmp_path / "b.npy", "--rate-hz", 50)
    np.testing.assert_array_equal(contact.values, make_values(4, 5, 3).reshape(FRAMES, 20, 3))
    np.savez(tmp_path / "c.npz", x=force, y=force)
    assert "choose one with --field: x, y" in refuse_preset("genesis", tmp_path / "c.npz")
    np.save(tmp_path / "d.npy", make_time())
    assert "expected shape [T, probes]" in refuse_preset("genesis", tmp_path / "d.npy", "--rate-hz", 50)


def test_a_pause_divides_the_recording_of_a_preset(tmp_path, import_preset):
    time = make_time()
    time[20:] += 5.0
    np.savez(tmp_path / "a.npz", force=make_values(6, 3), time=time)
    _, contacts = import_preset("genesis", tmp_path / "a.npz", "--gap-s", 1, "--object", "cup", "--approach", "top")
    assert [(len(contact.time), contact.object, contact.approach) for contact in contacts] == [(20, "cup", "top")] * 2


@pytest.mark.parametrize("option", [("--source", "fake"), ("--time-unit", "h"), ("--columns", "a")])
def test_an_invalid_option_gives_one_line(tmp_path, refuse_preset, option):
    write_csv(tmp_path / "a.csv", {"time": make_time(), **numbered("p", make_values(28))})
    assert f"{option[0]}: expected" in refuse_preset("tsf85", tmp_path / "a.csv", *option)
