"""Causes injected into the counts of a recording, in functional forms that emulator and catalogue do not contain."""
