"""A small recipe that is generated once without interruption."""

from pathlib import Path
from typing import NamedTuple

import pytest

from taxel.generate.recipe import Recipe
from taxel.generate.run import generate
from taxel.generate.workers import Processes

SMALL_RECIPE = Recipe(grasps=3, seed=3, grasps_per_shard=2)


class GeneratedFolder(NamedTuple):
    """A folder that was generated in one run."""

    recipe: Recipe
    folder: Path


@pytest.fixture(scope="session")
def small_recipe() -> Recipe:
    """Return the recipe of the generated folder."""
    return SMALL_RECIPE


@pytest.fixture(scope="session")
def generated(tmp_path_factory) -> GeneratedFolder:
    """Generate three grasps in two shards with one process, without interruption."""
    folder = tmp_path_factory.mktemp("generated") / "complete"
    assert generate(SMALL_RECIPE, folder, Processes(1)).generated_grasps == 3
    return GeneratedFolder(SMALL_RECIPE, folder)


def list_contents(folder: Path) -> dict[str, bytes]:
    """Read the contents of all files of a folder, including hidden ones, by name."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="session")
def read_files():
    """Return the function `list_contents`."""
    return list_contents
