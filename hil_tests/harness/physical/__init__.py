"""Drivers of physical rigs: ports and adapters of this machine, opened as the rig file names them."""
