"""The front door: the `lightloom` command."""
