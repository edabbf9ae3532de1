"""The simulated contact, sequences of effects, and least-squares estimates of their parameters."""
