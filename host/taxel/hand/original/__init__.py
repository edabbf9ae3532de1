"""Numbers of the original host and simulator that differ from the description of the original hand."""
