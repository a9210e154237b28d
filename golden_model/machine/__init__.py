"""Cycles of a modelled machine: costs, schedule, budget."""
