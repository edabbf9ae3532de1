"""Diagnosed effects, added to a simulated dataset or passed to the user's simulator."""
