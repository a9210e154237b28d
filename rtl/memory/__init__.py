"""Reads of a memory: the port, its sharing, the block cache."""
