"""Formal proofs about the RTL: properties as Amaranth modules around it, proved by SymbiYosys (docs/proofs.md)."""
