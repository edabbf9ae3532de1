"""Diagnosed effects added to a simulation, or handed to the simulator that made it."""
