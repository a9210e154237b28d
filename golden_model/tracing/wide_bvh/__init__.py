"""The 8-wide quantized tree in memory and its traversal: the model of `rtl.traversal`."""
