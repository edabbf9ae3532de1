"""Distance and approach speed of a target before it touches the skin."""
