"""int64 with a binary point to float32."""

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fixed_to_float import count, magnitude, normalise, round_float


class Fixed64ToFloat(StepCore):
    """Fixed point of 64 bits to float32; depth 0 to 4."""

    declared = PURE["fixed64_to_float"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(magnitude, 14), (count, 12), (normalise, 12), (round_float, 12)]
