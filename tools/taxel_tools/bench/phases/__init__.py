"""Phases of a board test; `taxel_tools.bench.registry` lists them."""
