"""Scene descriptions."""
