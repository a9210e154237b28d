"""What RTL, model and software agree on: formats of records, their packing, names of units and counters."""
