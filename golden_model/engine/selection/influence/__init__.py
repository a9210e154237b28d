"""Where changes of the scene matter."""
