"""Simulated contacts, composite models of effects, and least-squares estimates of their parameters."""
