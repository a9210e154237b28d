"""The comparison of policies."""
