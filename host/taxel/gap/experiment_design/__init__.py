"""What to press next: the presses that would tell most of what a diagnosis leaves open."""
