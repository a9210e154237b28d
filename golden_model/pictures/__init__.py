"""Pictures for the eye, outside the numeric contract."""
