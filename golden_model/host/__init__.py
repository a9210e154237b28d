"""Errors, outputs that are written whole or not at all, stopwatches, fingerprints: nothing here decides a bit."""
