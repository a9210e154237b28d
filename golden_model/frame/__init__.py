"""Visible surfaces, and the rays of pixels."""
