"""cocotb benches: drivers, monitors, scoreboards; one bench a unit."""

if __name__ != "lightloom.verif":
    raise ImportError("verif is a room of lightloom: import lightloom.verif")
