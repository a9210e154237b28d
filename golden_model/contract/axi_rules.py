"""The rules of AXI4 that are watched at memory ports, by name, each with what is wrong where it is broken.

A rule's name begins with its channel, which says whose rule it is. The RTL that watches (`rtl.memory.axi_checker`)
tells a broken rule by its number, from 1 in the order of this table; 0 is none.
"""

MASTERS, SLAVES = ("ar", "aw", "w"), ("r", "b")
"""The channels on which each of them offers something."""
RULE_PORTS = ("axi_master_rule", "axi_slave_rule")
"""Outputs of a top in which a port is watched: the numbers of the first rules that the master and the slave broke."""


def _channel(channel: str) -> dict[str, str]:
    return {
        f"{channel}_in_reset": f"{channel}valid is high in a reset, after its first cycle",
        f"{channel}_withdrawn": f"{channel}valid falls before what it offers was taken",
        f"{channel}_changed": "what waits to be taken changes",
    }


def _addresses(channel: str) -> dict[str, str]:
    return {
        f"{channel}_burst": f"a reserved {channel}burst; of blocks, another one than INCR",
        f"{channel}_size": "beats wider than the bus; of blocks, other ones than as wide as the bus",
        f"{channel}_length": "more than 16 beats that do not go up, or a WRAP of another number than 2, 4, 8 or 16; "
        "of blocks, another length than a block's",
        f"{channel}_alignment": "a WRAP that begins within a beat; of blocks, an address within a block",
        f"{channel}_boundary": "a burst crosses a boundary of 4 KB",
        f"{channel}_too_many": "an address is taken while as many bursts as may be are under way; of reads, of its id",
    }


AXI_RULES: dict[str, str] = {
    **{name: says for channel in (*MASTERS, *SLAVES) for name, says in _channel(channel).items()},
    **{name: says for channel in ("ar", "aw") for name, says in _addresses(channel).items()},
    "r_unasked": "a beat of an id of which no burst is under way",
    "r_last_early": "RLAST on another beat than the last of the id's oldest burst",
    "r_last_missing": "the last beat of the id's oldest burst has no RLAST",
    "r_exclusive": "EXOKAY, though nothing was asked for exclusively",
    "w_last_early": "WLAST on another beat than the last of the burst",
    "w_last_missing": "the last beat of a burst has no WLAST",
    "w_strobe": "a strobe of a byte that is not the beat's",
    "w_too_far": "data is taken while as much is ahead of its addresses as may be",
    "b_unasked": "an answer of an id of which no burst is under way",
    "b_early": "an answer before the last beat of the id's oldest burst was taken",
    "b_exclusive": "EXOKAY, though nothing was written exclusively",
}
"""Name to what is wrong."""


def rule_of(number: int) -> str:
    """The rule of a number, with what is wrong; "" for 0."""
    name, says = [("", ""), *AXI_RULES.items()][number]
    return f"{name}: {says}" if name else ""


def is_masters(name: str) -> bool:
    """Whether it is for the master to keep a rule."""
    return name.split("_")[0] in MASTERS
