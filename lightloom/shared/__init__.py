"""What commands share: the console, inputs, kept steps, provenance, pictures."""
