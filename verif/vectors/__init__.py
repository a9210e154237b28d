"""Operands and trees to try."""
