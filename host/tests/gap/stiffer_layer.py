"""Effect of the synthetic worlds: a hand whose layer is stiffer than that of the simulator."""


def stiffen(force, signal):
    """Return the signal of a layer with 1.8 times the force at half the full scale."""
    return 2000.0 * force / (force + 1.8 * 1.5)
