"""How Verilog becomes a running simulation: toolchain, cocotb runner, bulk vector harness."""
