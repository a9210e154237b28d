"""Everything that reads a scene from outside, and the built-in one."""
