"""OBJ and MTL files."""
