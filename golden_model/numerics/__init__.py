"""Arithmetic under the numeric contract, vectors, directions, counter-based random numbers, structured arrays."""
