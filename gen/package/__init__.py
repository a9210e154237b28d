"""What `lightloom package` writes."""
