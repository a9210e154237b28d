"""The AXI4 interfaces, as their masters see them: a port to read, one to write, and both as one."""

from typing import ClassVar

from amaranth import Value
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BLOCK_BYTES

BLOCK_BITS = 8 * BLOCK_BYTES
"""What every unit reads or writes at a time, as one burst."""
OFFSET_BITS = (BLOCK_BYTES - 1).bit_length()
"""Of a byte address, the lowest ones: zero at the beginning of a block."""
INCR = 0b01
"""`arburst` or `awburst` of a burst over ascending addresses."""


class AxiPort(wiring.Signature):
    """Some of AXI4's channels, by AXI's names; a slave's member of it is an `In`.

    Units of this project read and write blocks of 64 bytes at addresses that are multiples of 64, each as one INCR
    burst over the whole width of the bus (`block_beats`, `beat_size`). Cache, protection, lock, QoS and region signals
    have no ports: tie them as the system wants them.
    """

    CHANNELS: ClassVar[tuple[str, ...]]
    """Their prefixes, in the order in which a burst passes them."""

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
        members: dict[str, wiring.Member] = {}
        for channel in self.CHANNELS:
            # An answer comes from the slave; all else goes to it.
            forth, back = (In, Out) if channel in ("r", "b") else (Out, In)
            members |= {f"{channel}valid": forth(1), f"{channel}ready": back(1)}
            members |= {name: forth(field.shape) for name, field in self.payload(channel)}
        super().__init__(members)

    def payload(self, channel: str) -> data.StructLayout:
        """What is on a channel beside `valid` and `ready`, by the names of the ports."""
        address = {"addr": self.address_width, "id": self.id_width, "len": 8, "size": 3, "burst": 2}
        fields = {
            "ar": address,
            "r": {"data": self.data_width, "id": self.id_width, "resp": 2, "last": 1},
            "aw": address,
            "w": {"data": self.data_width, "strb": self.data_width // 8, "last": 1},
            "b": {"id": self.id_width, "resp": 2},
        }
        return data.StructLayout({f"{channel}{name}": width for name, width in fields[channel].items()})

    @property
    def ports(self) -> "tuple[AxiPort, ...]":
        """The one port that it is."""
        return (self,)

    @property
    def block_beats(self) -> int:
        """Beats of a block."""
        return BLOCK_BITS // self.data_width

    @property
    def beat_size(self) -> int:
        """`arsize` or `awsize` of a beat over the whole width of the bus: the base-2 logarithm of its bytes."""
        return (self.data_width // 8).bit_length() - 1


class AxiRead(AxiPort):
    """An AXI4 read port. Units of this project never have two bursts of one id under way."""

    CHANNELS = ("ar", "r")


class AxiWrite(AxiPort):
    """An AXI4 write port. Data may be ahead of its address, and answers come when both have been taken."""

    CHANNELS = ("aw", "w", "b")


class Axi(wiring.Signature):
    """A whole AXI4 port: `read` and `write`, each by itself. As member `m_axi` of a unit it has AXI's names in Verilog.

    Nothing orders reads and writes: who reads what was written waits for the write's answer first.
    """

    def __init__(self, *, address_width: int, data_width: int, id_width: int):
        """Widths as those of `AxiPort`; reads and writes have ids of their own."""
        widths = {"address_width": address_width, "data_width": data_width, "id_width": id_width}
        self.ports: tuple[AxiPort, ...] = (AxiRead(**widths), AxiWrite(**widths))
        read, write = self.ports
        super().__init__({"read": Out(read), "write": Out(write)})


def is_error(response: Value) -> Value:
    """Whether an `rresp` or `bresp` is SLVERR or DECERR."""
    return response[1]
