"""What leaves the house: Verilog, manifests, lint, reports."""

if __name__ != "lightloom.gen":
    raise ImportError("gen is a room of lightloom: import lightloom.gen")
