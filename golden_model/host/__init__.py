"""Errors, outputs that are written whole or not at all, stopwatches: nothing here decides a bit."""
