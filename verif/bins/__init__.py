"""What the vectors and benches are to reach."""
