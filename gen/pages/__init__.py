"""HTML pages and their drawings."""
