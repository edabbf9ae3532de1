"""One sensor board on a bench: what is measured of it, and which faults that names."""
