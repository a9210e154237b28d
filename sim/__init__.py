"""How Verilog becomes a running simulation: toolchain, cocotb runner, bulk vector harness."""

if __name__ != "lightloom.sim":
    raise ImportError("sim is a room of lightloom: import lightloom.sim")
