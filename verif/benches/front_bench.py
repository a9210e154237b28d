"""What the benches of the traversal unit behind AXI4-Lite share: software, beside streams and memory.

The master (`verif.drivers.axi_lite_master`) holds every answer to what the documentation says of it, in all tests. In
the tests is what it cannot know: what the unit says, when something happens, and that rays have the golden results.
"""

from typing import Any

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import RAY_QUERY, RAY_RESULT
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.benches.traversal_bench import BASES, MEMORIES, RENDERED, Rays, TraversalBench, rays_of
from lightloom.verif.drivers.axi_lite_master import Access, LiteMaster
from lightloom.verif.drivers.register_model import OKAY
from lightloom.verif.drivers.stream import Exchange

WILLING = ["always", "half", "rare", "bursts"]
"""How willing each of the master's channels is, by itself."""
LIMIT = 4000
"""Cycles in which software sees what it waits for."""


class FrontBench(TraversalBench):
    """The unit, its memory, and software."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.registers: list[dict[str, Any]] = self.run["registers"]
        self.places = {field["name"]: (one, field) for one in self.registers for field in one["fields"]}
        self.offsets = {one["name"]: one["offset"] for one in self.registers}
        self.accesses, self.torn, self.times, self.settle = (
            self.run[name] for name in ("accesses", "torn", "times", "settle")
        )

    async def begin(self, *, willing: str = "always", memory: str = "brisk", **options: Any) -> None:
        self.lite = LiteMaster(self.dut, self.registers, self.rng, self.seed)
        self.lite.stall(willing)
        await self.start({"axi_forget": 0}, MEMORIES[memory])

    async def exchange(self, payloads: list[int], give: str = "half", take: str = "half", **options: Any) -> Exchange:
        await self.rising  # software goes on at falling edges; streams are driven behind rising ones
        return await super().exchange(payloads, give, take, **options)

    # --- what software does -------------------------------------------------------------------------------------------

    def ask(self, at: int = 0, **values: int) -> Access:
        """A write of one register by its fields; the others of its fields become 0."""
        registers = {self.places[name][0]["offset"] for name in values}
        assert len(registers) == 1
        word = sum(value << self.places[name][1]["low"] for name, value in values.items())
        return self.lite.write(registers.pop(), word, at=at)

    async def write(self, **values: int) -> Access:
        """The same, done."""
        access = await self.ask(**values)
        assert access.response == OKAY, f"seed {self.seed}: {access}: refused"
        return access

    async def field(self, name: str) -> int:
        register, field = self.places[name]
        word = await self.word(register["name"])
        return word >> field["low"] & ((1 << field["width"]) - 1)

    async def word(self, register: str) -> int:
        access = await self.lite.read(self.offsets[register])
        assert access.word is not None
        return access.word

    async def await_field(self, name: str, value: int) -> None:
        begin = self.lite.cycle
        while await self.field(name) != value:
            assert self.lite.cycle - begin < LIMIT, f"seed {self.seed}: {name} does not become {value}"

    async def await_irq(self) -> None:
        await self.until(lambda: bool(self.get("irq")), LIMIT, "no interrupt")

    async def load_tree(self, blocks: np.ndarray, base: int = BASES[0]) -> None:
        """By software: until it is loaded."""
        self.put(blocks, base)
        await self.set_base(base)
        await self.write(load=1)
        await self.await_field("loaded", 1)
        self.blocks = blocks

    async def set_base(self, base: int) -> None:
        await self.write(base_low=base & 0xFFFF_FFFF)
        await self.write(base_high=base >> 32)

    def operand(self, query: np.ndarray) -> dict[str, dict[str, int]]:
        """The registers of a ray, RAY_QUERY (1,), each by its fields."""
        payload = payloads(query, np.zeros(1))[0]
        words: dict[str, dict[str, int]] = {}
        for name, index, _, offset, width in bitpack.fields(RAY_QUERY):
            field = "_".join(["operand", name, *map(str, index)])
            words.setdefault(self.places[field][0]["name"], {})[field] = payload >> offset & ((1 << width) - 1)
        return words

    async def submit(self, query: np.ndarray, tag: int) -> None:
        for fields in self.operand(query).values():
            await self.write(**fields)
        await self.write(operand_tag=tag)
        await self.write(submit=1)

    async def result(self) -> tuple[int, np.ndarray]:
        """The tag and the result that wait, RAY_RESULT (1,), which is then given away."""
        payload = 0
        for name, _, _, offset, width in bitpack.fields(RAY_RESULT):
            payload |= (await self.field(f"result_{name}")) << offset
            assert width <= 32
        tag = await self.field("result_tag")
        await self.write(release=1)
        row = np.frombuffer(payload.to_bytes(4 * bitpack.words(RAY_RESULT), "little"), dtype="<u4").reshape(1, -1)
        return tag, bitpack.unpack(row, RAY_RESULT)

    async def trace_by_registers(self, rays: Rays, under_way: int = 3) -> np.ndarray:
        """Rays through registers, in their order: exactly one result each. Polls the status."""
        results: dict[int, np.ndarray] = {}
        sent, begin = 0, self.lite.cycle
        while len(results) < len(rays):
            status = await self.word("status")
            waits, comes = (status >> self.places[name][1]["low"] & 1 for name in ("operands_wait", "result_waits"))
            if comes:
                tag, result = await self.result()
                assert tag in set(range(sent)) - results.keys(), f"seed {self.seed}: a result with tag {tag}"
                results[tag] = result
            if sent < len(rays) and sent - len(results) < under_way and not waits:
                await self.submit(rays.queries[sent : sent + 1], sent)
                sent += 1
            assert self.lite.cycle - begin < LIMIT * (1 + len(rays)), f"seed {self.seed}: {len(results)} results"
        return np.concatenate([results[tag] for tag in range(len(rays))])

    async def check_by_registers(self, scene: str, count: int, what: str) -> None:
        """Loads a tree; a few rays through registers have the golden results, and one each."""
        tree = self.tree(scene)
        await self.load_tree(tree.blocks)
        rays = self.traced(tree.blocks, rays_of(scene, count, self.rng.getrandbits(16), RENDERED))
        await self.write(count_clear=1)
        self.assert_same(await self.trace_by_registers(rays), rays, what)
        assert await self.field("result_waits") == 0
        assert await self.word("count_rays") == count
        self.check_rules()
