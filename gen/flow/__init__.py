"""Synthesis, timing, place and route, by tools of others."""
