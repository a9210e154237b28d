"""Rays against triangles and boxes."""
