"""The simulator as the reference of the twin."""
