"""Status, named effects, headline and reasons, derived from the probabilities."""
