"""A campaign on the emulated hand: in parallel, cut, and taken up again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.campaign.counts import contact_points
from taxel.campaign.emulated import run_emulated
from taxel.campaign.processes import ProcessLostError, in_processes
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import ContactLibraryError
from taxel.hand.frame_errors import FrameError
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset

PATIENCE_S = 60.0

CUT = """
import os, signal, sys
from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Timeline

def show(done, of):
    if done == 1:
        print("one", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)

run_emulated(sys.argv[1], {plan}, EmulatedSettings(timeline={timeline}), jobs=1, progress=show)
"""


def content(path) -> dict[str, object]:
    """All datasets and attributes of a file except when it was made."""
    found: dict[str, object] = {}

    def visit(name: str, item) -> None:
        found.update({f"{name}@{key}": str(value) for key, value in item.attrs.items() if key != "created"})
        if isinstance(item, h5py.Dataset):
            found[name] = (item.dtype.str, item.shape, np.asarray(item[()]).tobytes() if item.dtype.kind != "O" else 0)

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    return found


@pytest.fixture(scope="module")
def settings(timeline):
    return EmulatedSettings(timeline=timeline)


@pytest.fixture(scope="module")
def whole(setup, plan, settings, tmp_path_factory):
    """(the dataset of both sessions made in one process, the progress that was told)."""
    path, told = tmp_path_factory.mktemp("whole") / "real.h5", []
    run_emulated(path, plan, settings, setup, jobs=1, progress=lambda done, of: told.append((done, of)))
    return path, told


def test_the_file_is_a_real_dataset_of_the_plan(whole, plan, setup):
    path, told = whole
    with GraspDataset(path) as data:
        data.check()
        assert (data.source, data.hand) == ("real", "allegro")
        assert data.ids == tuple(planned.id for planned in plan)
        assert [grasp.session for grasp in data] == [0, 1]
        assert (data.taxels.position == setup.hand.position).all()
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_it_has_contact_points_on_its_object_alone(whole):
    counted = contact_points(whole[0])
    assert counted["cylinder"].grasps == 2
    assert counted["cylinder"].points > 20
    assert counted["rectangular_prism"] == counted["triangular_prism"]
    assert counted["rectangular_prism"].grasps == counted["rectangular_prism"].points == 0


def test_two_processes_make_the_same_content(whole, plan, settings, tmp_path):
    run_emulated(tmp_path / "real.h5", plan, settings, jobs=2)
    assert content(tmp_path / "real.h5") == content(whole[0])


def test_a_killed_campaign_leaves_a_whole_file_and_goes_on_to_the_same_content(
    whole, plan, settings, setup, timeline, tmp_path
):
    path, told = tmp_path / "real.h5", []
    code = "from taxel.grasp.timeline import Timeline\n" + CUT.format(
        plan=f"({_source(plan)})", timeline=repr(timeline)
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, timeout=PATIENCE_S, check=False)
    assert done.stdout == b"one\n"
    assert done.returncode != 0
    with GraspDataset(path) as data:
        data.check()
        assert data.ids == (plan[0].id,)
    run_emulated(path, plan, settings, setup, jobs=1, resume=True, progress=lambda done, of: told.append((done, of)))
    assert content(path) == content(whole[0])
    assert told == [(1, 2), (2, 2)]
    before = path.read_bytes()
    run_emulated(path, plan, settings, setup, resume=True)
    assert path.read_bytes() == before


def _source(plan) -> str:
    return "".join(
        f"PlannedGrasp({item.id!r}, {item.object!r}, {item.approach!r}, {item.iteration}, {item.session}), "
        for item in plan
    )


def test_a_file_that_exists_is_refused_before_anything_is_made(whole, plan, settings, setup):
    before = whole[0].read_bytes()
    with pytest.raises(DatasetError, match=r"real\.h5"):
        run_emulated(whole[0], plan, settings, setup, progress=_never)
    assert whole[0].read_bytes() == before


def test_other_settings_do_not_go_on_with_it(whole, plan, timeline, setup):
    with pytest.raises(DatasetError, match="another campaign") as caught:
        run_emulated(whole[0], plan, EmulatedSettings(seed=2, timeline=timeline), setup, resume=True, progress=_never)
    assert "\n" not in str(caught.value)


def test_effects_that_the_emulator_refuses_leave_no_file_and_replace_none(plan, timeline, setup, tmp_path):
    settings, path = EmulatedSettings(timeline=timeline, effects=("noise purple",)), tmp_path / "real.h5"
    with pytest.raises(ContactLibraryError, match="noise purple"):
        run_emulated(path, plan, settings, setup)
    assert not path.exists()
    path.write_text("kept")
    with pytest.raises(ContactLibraryError):
        run_emulated(path, plan, settings, setup, overwrite=True)
    assert path.read_text() == "kept"


def _never(done: int, of: int) -> None:
    raise AssertionError("it began")


def end_process(setup, part: int, settings: float) -> int:
    if part == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return part


def leave_a_mark(setup, part: int, folder: str) -> int:
    time.sleep(0.02)
    Path(folder, str(part)).touch()
    return part


def refuse(setup, part: int, settings: None) -> int:
    raise FrameError(f"part {part}")


def test_a_process_that_is_killed_gives_one_line(setup):
    with pytest.raises(ProcessLostError, match="go on with resume") as caught:
        list(in_processes(end_process, setup, [0, 1, 2, 3], 0.0, 2))
    assert "\n" not in str(caught.value)


def test_an_error_in_a_process_arrives_and_ends_the_rest(setup):
    with pytest.raises(FrameError, match="part 0"):
        list(in_processes(refuse, setup, range(50), None, 2))


def test_parts_come_in_order_and_an_abandoned_rest_is_not_made(setup, tmp_path):
    parts = in_processes(leave_a_mark, setup, range(500), str(tmp_path), 2)
    assert [next(parts) for _ in range(3)] == [0, 1, 2]
    parts.close()
    assert len(list(tmp_path.iterdir())) < 100
