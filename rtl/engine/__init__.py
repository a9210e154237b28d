"""What sees to texels: where they are seen, and what they become by a sample."""
