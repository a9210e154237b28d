"""The benches, as cocotb runs them, and what they share."""
