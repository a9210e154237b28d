"""Seeded adversarial rays and boxes, for tests, benches and measurements."""
