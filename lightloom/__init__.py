"""Lightloom. Here is its front door, the command; the other rooms are folders of the checkout, and links here.

docs/architecture.md shows them.
"""
