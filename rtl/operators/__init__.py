"""The number units: float32 operators under the numeric contract, one result a cycle, depth a parameter."""
