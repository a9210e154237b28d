"""One ray against one triangle, all triangles by force, and what every tracer shares."""
