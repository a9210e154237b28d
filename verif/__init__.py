"""cocotb benches: drivers, monitors, scoreboards; one bench a unit."""
