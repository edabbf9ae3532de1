"""Bring-up of the first board: tests of the bring-up image, and their comparison with the firmware's assumptions."""
