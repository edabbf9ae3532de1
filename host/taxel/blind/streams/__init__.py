"""Blind check over time: hours of use with a hidden fault that begins at a secret time."""
