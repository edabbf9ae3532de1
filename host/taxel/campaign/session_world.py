"""World file of one session on the emulated hand: objects, boards and the random mounting of every bracket."""

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.variation import make_small_motion
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.hand.world import WorldSettings

_SESSION_STREAM = 1


def check_world(setup: Setup, settings: EmulatedSettings) -> None:
    """Raise `ContactLibraryError` if the emulator rejects the effects of the settings."""
    with SkinContact(format_session_world(setup, settings, 0)):
        pass


def format_session_world(setup: Setup, settings: EmulatedSettings, session: int) -> str:
    """Format the emulator's world file of one session, in which every bracket is mounted with its own random offset."""
    world = WorldSettings(
        seed=int(np.random.SeedSequence([settings.seed, session]).generate_state(1)[0]),
        parts_seed=settings.seed,  # clocks, gains and other properties of the boards are equal in all sessions
        scl_hz=settings.scl_hz,
        baud=settings.baud,
        noise_counts=settings.noise_counts,
        effects=settings.world_effect_lines(),
    )
    return format_scene(setup.hand, _make_scene(setup, settings, session), world)


def _make_scene(setup: Setup, settings: EmulatedSettings, session: int) -> EmulatedScene:
    """Make the scene of a session on the emulated hand: shapes of the objects, and offsets of brackets and objects.

    Each bracket has a random offset, because the boards are mounted anew before each session; an offset of this bracket
    in the settings is added to it.
    """
    rng = np.random.default_rng([settings.seed, _SESSION_STREAM, session])
    variation = settings.variation
    metres, radians = variation.remount_m, variation.remount_rad
    brackets = {board.name: _sample_motion(rng, metres, radians) for board in setup.hand.boards}
    for name, offset in settings.offsets("bracket_offset").items():
        brackets[name] = offset @ brackets[setup.hand.find_board(name).name]
    shapes = {name: item.shape for name, item in setup.objects.items()}
    return EmulatedScene(shapes, brackets, settings.offsets("object_offset"))


def _sample_motion(rng: np.random.Generator, metres: float, radians: float) -> NDArray[np.float64]:
    """Sample a random small motion f64[4, 4]. metres, radians: standard deviations per axis."""
    rotation = rng.normal(size=3)
    return make_small_motion(rng.normal(size=3), rotation, metres, radians)
