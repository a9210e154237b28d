"""Watches an AXI4 port and says which rule is broken, and by whom.

It is no part of any unit: emitted, it stands beside a port in simulations, and in proofs beside the unit.
"""

from amaranth import Cat, Const, Module, ResetSignal, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.axi_rules import AXI_RULES, is_masters
from lightloom.rtl.fabric.one_hot import any_of
from lightloom.rtl.memory.axi import INCR, OFFSET_BITS, Axi, AxiPort
from lightloom.rtl.memory.axi_following import (
    FIXED,
    WRAP,
    Rules,
    any_beats,
    block_beats,
    follow_reads,
    follow_writes,
)

RESERVED, EXOKAY = 0b11, 0b01
PAGE = 4096
RULE_BITS = len(AXI_RULES).bit_length()


class AxiChecker(wiring.Component):
    """Ports: `m_axi`, all signals of the port that is watched, as inputs. `broken`, a bit for each of AXI_RULES, in
    their order, that is broken in this cycle. `master_rule` and `slave_rule`: the number of the first rule that the
    master, and the slave, broke since the reset, 0 for none; a cycle late. After that others may seem to be broken.

    A rule on what is offered is looked at while it is offered, one on what is under way by what was taken before. What
    is offered in a reset is told while that lasts, and after it if it was in its last cycle. Of bursts that are not
    blocks, beats are looked at when their address has come, a cycle late or later.
    """

    def __init__(self, axi: AxiPort | Axi, *, blocks: bool = True, reads: int = 1, writes: int = 64, ahead: int = 16):
        """`blocks`: bursts have to be whole blocks, as units of this project read and write them. There may be `reads`
        bursts of an id under way, and `writes` write bursts in all; `ahead` bursts, or beats where bursts are not
        blocks, may have come before their addresses. These numbers are powers of two, from 1 on.

        Each is compared with what was so before a cycle: an address or a beat is one too many if it is taken while the
        number is reached, also where in the same cycle a burst is answered, an id's last beat is taken, or an address
        that is waited for. Room that this makes is there from the next cycle on.
        """
        self.axi, self.blocks, self.reads, self.writes, self.ahead = axi, blocks, reads, writes, ahead
        for name in ("reads", "writes", "ahead"):
            number = getattr(self, name)
            if number < 1 or number & (number - 1):
                raise ValueError(f"{name} must be a power of two, not {number}")
        signals = {name: Out(member.shape) for port in axi.ports for name, member in port.members.items()}
        super().__init__(
            {
                "m_axi": In(wiring.Signature(signals)),
                "broken": Out(len(AXI_RULES)),
                "master_rule": Out(RULE_BITS),
                "slave_rule": Out(RULE_BITS),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        in_reset = Signal()
        was_reset = Signal(reset_less=True)
        m.d.comb += in_reset.eq(ResetSignal())
        m.d.sync += was_reset.eq(in_reset)

        rules: Rules = {}
        for axi in self.axi.ports:
            for channel in axi.CHANNELS:
                rules |= self._channel(m, axi, channel)
            rules |= self._address(axi, axi.CHANNELS[0])
            rules |= (self._reads if "r" in axi.CHANNELS else self._writes)(m, axi)
        for k, name in enumerate(AXI_RULES):
            binds = in_reset & was_reset if name.endswith("_in_reset") else ~in_reset
            m.d.comb += self.broken[k].eq(rules.get(name, Const(0)) & binds)
        self._remember(m, self.master_rule, in_reset, masters=True)
        self._remember(m, self.slave_rule, in_reset, masters=False)
        return m

    def _remember(self, m: Module, first: Signal, in_reset: Value, *, masters: bool) -> None:
        """The first rule that the one or the other side broke; in a reset, the one that is broken now."""
        now = Signal(RULE_BITS, name="masters_now" if masters else "slaves_now")
        for k, name in reversed(list(enumerate(AXI_RULES))):
            if is_masters(name) == masters:
                with m.If(self.broken[k]):
                    m.d.comb += now.eq(k + 1)
        kept = Signal(RULE_BITS, reset_less=True, name="masters_first" if masters else "slaves_first")
        m.d.comb += first.eq(kept)
        with m.If(in_reset | (kept == 0)):
            m.d.sync += kept.eq(now)

    def _channel(self, m: Module, axi: AxiPort, channel: str) -> Rules:
        """What is offered stays, and nothing is offered in a reset."""
        port = self.m_axi
        valid, ready = getattr(port, f"{channel}valid"), getattr(port, f"{channel}ready")
        payload = Cat(Value.cast(getattr(port, name)) for name, _ in axi.payload(channel))
        waits = Signal(name=f"{channel}_waits")
        before = Signal(len(payload), reset_less=True, name=f"{channel}_before")
        m.d.sync += [waits.eq(valid & ~ready), before.eq(payload)]
        return {
            f"{channel}_in_reset": valid,
            f"{channel}_withdrawn": waits & ~valid,
            f"{channel}_changed": waits & valid & (payload != before),
        }

    def _address(self, axi: AxiPort, channel: str) -> Rules:
        """What a burst may be."""
        valid, address, length, size, burst = (
            getattr(self.m_axi, f"{channel}{name}") for name in ("valid", "addr", "len", "size", "burst")
        )
        offset = address[: (PAGE - 1).bit_length()]
        within = (Const(1) << size) - 1  # of a beat
        end = (offset | within) + (length << size)  # the last byte
        if self.blocks:
            rules = {
                "burst": burst != INCR,
                "size": size != axi.beat_size,
                "length": length != axi.block_beats - 1,
                "alignment": address[:OFFSET_BITS] != 0,
            }
        else:
            wraps = any_of(length == beats - 1 for beats in (2, 4, 8, 16))
            rules = {
                "burst": burst == RESERVED,
                "size": size > axi.beat_size,
                "length": ((burst == FIXED) & (length > 15)) | ((burst == WRAP) & ~wraps),
                "alignment": (burst == WRAP) & ((offset & within) != 0),
            }
        rules["boundary"] = (burst == INCR) & (end >= PAGE)
        return {f"{channel}_{name}": valid & broken for name, broken in rules.items()}

    def _reads(self, m: Module, axi: AxiPort) -> Rules:
        port = self.m_axi
        exclusive = {"r_exclusive": port.rvalid & (port.rresp == EXOKAY)}
        return exclusive | follow_reads(m, port, axi, bursts=self.reads)

    def _writes(self, m: Module, axi: AxiPort) -> Rules:
        port = self.m_axi
        exclusive = {"b_exclusive": port.bvalid & (port.bresp == EXOKAY)}
        answers, leads = follow_writes(m, port, axi, bursts=self.writes)
        if self.blocks:
            beats = block_beats(m, port, axi, leads=leads, ahead=self.ahead)
        else:
            beats = any_beats(m, port, axi, bursts=self.writes, ahead=self.ahead)
        return exclusive | answers | beats
