"""Features in counts; gap, floor and excess with intervals; the gap in millimetres with a placebo."""
