"""The AXI4 read interface: the master's view of the address and the data channel."""

from amaranth import Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BLOCK_BYTES

BLOCK_BITS = 8 * BLOCK_BYTES
"""What every unit reads at a time, as one burst."""
OFFSET_BITS = (BLOCK_BYTES - 1).bit_length()
"""Of a byte address, the lowest ones: zero at the beginning of a block."""
INCR = 0b01
"""`arburst` of a burst over ascending addresses."""


class AxiRead(wiring.Signature):
    """An AXI4 read port, by AXI's names; a slave's member of it is an `In`.

    Units of this project read blocks of 64 bytes at addresses that are multiples of 64, each as one INCR burst over the
    whole width of the bus (`block_beats`, `beat_size`), and never have two bursts of one id under way. Cache,
    protection, lock, QoS and region signals have no ports: tie them as the system wants them.
    """

    def __init__(self, *, address_width: int, data_width: int, id_width: int):
        """Widths in bits: `address_width` 7 to 64, `data_width` a power of two from 32 to 512, `id_width` from 1."""
        if not 7 <= address_width <= 64:
            raise ValueError(f"address_width must be 7 to 64, not {address_width}")
        if data_width not in (32, 64, 128, 256, 512):
            raise ValueError(f"data_width must be 32, 64, 128, 256 or 512, not {data_width}")
        if id_width < 1:
            raise ValueError(f"id_width must be at least 1, not {id_width}")
        self.address_width = address_width
        self.data_width = data_width
        self.id_width = id_width
        super().__init__(
            {
                "arvalid": Out(1),
                "arready": In(1),
                "araddr": Out(address_width),
                "arid": Out(id_width),
                "arlen": Out(8),
                "arsize": Out(3),
                "arburst": Out(2),
                "rvalid": In(1),
                "rready": Out(1),
                "rdata": In(data_width),
                "rid": In(id_width),
                "rresp": In(2),
                "rlast": In(1),
            }
        )

    @property
    def block_beats(self) -> int:
        """Beats of a block."""
        return BLOCK_BITS // self.data_width

    @property
    def beat_size(self) -> int:
        """`arsize` of a beat over the whole width of the bus: the base-2 logarithm of its bytes."""
        return (self.data_width // 8).bit_length() - 1


def is_error(response: Value) -> Value:
    """Whether an `rresp` is SLVERR or DECERR."""
    return response[1]
