"""Units described, packaged, synthesised, placed, proved, covered, replayed and traced."""
