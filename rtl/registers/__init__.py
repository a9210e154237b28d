"""Registers: what software reads and writes of a unit, and the hardware that answers it."""
