"""The AXI4-Lite interface, as its master sees it."""

from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

DATA_BITS = 32
LANES = DATA_BITS // 8
OKAY, SLVERR = 0b00, 0b10
"""What `bresp` and `rresp` may be here."""


class AxiLite(wiring.Signature):
    """All of AXI4-Lite's channels, by AXI's names, with 32 bits of data; a slave's member of it is an `In`.

    `address_width` (from 3 up) is that of byte addresses. Where there is no protection, `awprot` and `arprot` are low.
    """

    def __init__(self, address_width: int):
        if address_width < 3:
            raise ValueError(f"address_width must be at least 3, not {address_width}")
        self.address_width = address_width
        address = {"addr": address_width, "prot": 3}
        payloads = {
            "aw": address,
            "w": {"data": DATA_BITS, "strb": LANES},
            "b": {"resp": 2},
            "ar": address,
            "r": {"data": DATA_BITS, "resp": 2},
        }
        members: dict[str, wiring.Member] = {}
        for channel, payload in payloads.items():
            # An answer comes from the slave; all else goes to it.
            forth, back = (In, Out) if channel in ("b", "r") else (Out, In)
            members |= {f"{channel}valid": forth(1), f"{channel}ready": back(1)}
            members |= {f"{channel}{name}": forth(width) for name, width in payload.items()}
        super().__init__(members)
