"""The versions of the maps that shaders read."""
