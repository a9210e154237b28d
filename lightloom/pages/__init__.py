"""Pages of docs/ that are made."""
