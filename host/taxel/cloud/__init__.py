"""Contact clouds: accumulation, filters, registration, distances, shape matching."""
