"""Faults that `gen.formal.mutations` puts into the RTL, a file a subject: what is wrong, and what has to notice."""
