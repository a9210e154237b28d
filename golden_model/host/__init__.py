"""Errors, whole outputs, stopwatches, fingerprints, declared parameters: nothing here decides a bit."""
