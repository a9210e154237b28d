"""glTF files: structure, arrays, materials, meshes."""
