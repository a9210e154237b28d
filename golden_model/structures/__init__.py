"""Acceleration structures over scenes whose objects move."""
