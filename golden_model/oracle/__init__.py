"""Converged answers that no hardware computes."""
