"""What leaves the house: Verilog, manifests, lint, reports."""
