"""A binary tree an object, joined; its traversal for the renderer."""
