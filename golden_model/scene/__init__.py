"""A scene in memory and in a frame: parts, poses, lights, textures, lightmap addresses."""
