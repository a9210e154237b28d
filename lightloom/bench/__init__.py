"""Measurements, and the page of one of them."""
