"""What the host does for the engine in every frame: it moves objects and cameras, and tells what that changes."""
