"""What is left after the best effects, against a bank of generic distortions."""
