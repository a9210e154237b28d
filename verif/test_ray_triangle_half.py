"""Bench of `ray_triangle_half`: see `verif.bench`."""

from verif.bench import blocked_output, full_rate, reset_in_flight, stalled

__all__ = ["blocked_output", "full_rate", "reset_in_flight", "stalled"]
