"""Which texels a frame samples."""
