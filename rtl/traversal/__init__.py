"""The traversal unit: rays in, hits out, through a tree of boxes in memory."""
