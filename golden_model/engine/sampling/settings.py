"""What texel updates are made of."""

from dataclasses import dataclass, field
from typing import Literal

from lightloom.golden_model.contract.formats import COUNT_MAX, ONE_SAMPLE
from lightloom.golden_model.engine.sampling.running_average import Blending
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, choice, flag, number
from lightloom.golden_model.numerics.directions import COUNT

MOST_LIGHTS = 1024
"""Whose sums of weights the largest preset holds; 256 are what others do."""


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """What one texel update is made of."""

    directions: int = number(16, 1, COUNT, "Rays for indirect light, a power of two.")
    light_samples: int = number(4, 1, COUNT, "Shadow rays at most.")
    balanced: bool = flag(
        True,
        "Rays for indirect light count the area lights that they meet, shadow rays leave them their share (see "
        "`golden_model.engine.sampling.texel_rays`): right beside a light too, for a division more a ray that "
        "meets one.",
    )
    direct: Literal["maps", "rays"] = choice(
        "maps",
        ("maps", "rays"),
        "Whether the maps hold direct and indirect light, or indirect light alone: then texels need no shadow rays, "
        "but the hits of their rays do, one each.",
    )
    bounces: int = number(4, 0, 16, "Mirrors and panes of glass that a ray may meet on its way to a diffuse surface.")
    lights: int = number(
        MOST_LIGHTS, 1, MOST_LIGHTS, "Lights of a scene at most: triangles that shine, point lights, sun and sky."
    )
    blending: Blending = field(default_factory=Blending)
    """How it weighs against the old value."""
    priming: int = number(
        256, 0, None, "Rounds before the first frame at most, each within one frame's budget; see `Renderer`."
    )
    primed: int = number(6, 1, COUNT_MAX // ONE_SAMPLE, "Samples of each texel that they average at most.")

    def __post_init__(self) -> None:
        check(self, "sampling")
        if self.directions & (self.directions - 1):
            raise InputError(f"sampling directions {self.directions}: must be a power of two, 1 to {COUNT}")

    def reserve(self, specular: bool) -> int:
        """The most rays that an update can take, in a scene with or without mirrors and glass.

        The budget reserves as many. Rays that need not be traced are given back: shadow rays that cannot carry light,
        and those that would follow from mirrors that are not met.
        """
        paths = self.directions * (1 + self.bounces * specular)
        return 2 * paths if self.direct == "rays" else paths + self.light_samples
