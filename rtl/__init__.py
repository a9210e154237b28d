"""Lightloom's hardware, in Amaranth. One unit a file; the unit's model is in `golden_model` under the same name."""

if __name__ != "lightloom.rtl":
    raise ImportError("rtl is a room of lightloom: import lightloom.rtl")
