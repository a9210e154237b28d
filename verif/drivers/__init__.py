"""Both ends of streams and of the memory port."""
