"""The model of the engine that keeps lightmaps alive."""
