"""Power in an emulated world: each board and the hub alone."""

from taxel.link.virtual import VirtualWorld


class VirtualPower:
    """Plugs and unplugs."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world

    def switch(self, on: bool, address: int | None = None) -> None:
        name = "plug" if on else "unplug"
        if address is None:
            self._world.inject(f"hub_{name}")
        else:
            self._world.inject(name, address)
