"""Bench of `node_test`: see `verif.benches.bench`."""

from lightloom.verif.benches.bench import blocked_output, full_rate, reset_in_flight, stalled

__all__ = ["blocked_output", "full_rate", "reset_in_flight", "stalled"]
