"""What rays and texels read, as arrays: lightmaps, textures, triangles, lights, a sky. Sections of the memory image."""
