"""Frames into a folder."""
