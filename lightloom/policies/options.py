"""What a comparison of policies compares, and how."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import POLICIES
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.oracle.converged_maps import require_rays
from lightloom.golden_model.structures.structure import require_threads

BASELINE = "round-robin"
"""What the others are compared with, where it takes part; else the first one."""
KEY_FRAMES = 4
"""Frames that are shown as pictures, unless chosen."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What is compared, and how."""

    scene: str = "cornell-box"
    """As `load_scene` takes it."""
    policies: tuple[str, ...] = tuple(POLICIES)
    """Names in `POLICIES`, in the order of the page."""
    frames: int = 48
    width: int = 320
    height: int = 214
    budget: int = 20_000
    """Rays a frame."""
    directions: int = 16
    """Rays for indirect light in a texel update."""
    light_samples: int = 4
    """Shadow rays in a texel update."""
    reference_rays: int = 512
    """Rays for indirect light a texel of the reference."""
    reference_every: int = 2
    """Every so many frames are compared, from frame 0."""
    true_samples: int = 0
    """Paths a pixel of the path-traced picture that the frame at rest is compared with; 0: it is not."""
    key_frames: tuple[int, ...] = ()
    """Frames shown as pictures, rising; none: `KEY_FRAMES` of the compared ones, evenly spread."""
    exposure: float | None = None
    """Factor from radiance to display; None: taken from the first frame's reference."""
    seed: int = 0
    backend: str = "auto"
    threads: int = 1

    def __post_init__(self) -> None:
        if not self.policies or len(set(self.policies)) < len(self.policies):
            raise InputError(f"--policies {','.join(self.policies)}: give one or more, each once")
        for name, value in (("frames", self.frames), ("reference-every", self.reference_every)):
            if value < 1:
                raise InputError(f"--{name} {value}: must be at least 1")
        require_rays(self.reference_rays, "--reference-rays")
        require_threads(self.threads, "--threads")
        if self.true_samples < 0 or self.true_samples % 2:
            raise InputError(f"--true-samples {self.true_samples}: must be even, half for each of two pictures")
        if any(not 0 <= frame < self.frames for frame in self.key_frames):
            shown = ",".join(str(frame) for frame in self.key_frames)
            raise InputError(f"--key-frames {shown}: must be 0 to {self.frames - 1}")

    @property
    def sampling(self) -> Sampling:
        """What a texel update is made of, under all policies."""
        return Sampling(directions=self.directions, light_samples=self.light_samples)

    @property
    def shown(self) -> list[int]:
        """The frames shown as pictures, rising."""
        if self.key_frames:
            return sorted(set(self.key_frames))
        places = np.linspace(0, len(self._regular) - 1, min(KEY_FRAMES + 1, len(self._regular)))
        return sorted({self._regular[round(place)] for place in places[-KEY_FRAMES:]})

    @property
    def compared(self) -> list[int]:
        """The frames compared with the reference, rising; those shown are among them."""
        return sorted({*self._regular, *self.shown})

    @property
    def _regular(self) -> Sequence[int]:
        """Every K-th frame, without frame 0: what that one shows was there before any policy had its say."""
        return range(max(self.reference_every - 1, 1), self.frames, self.reference_every) or [self.frames - 1]

    @property
    def command(self) -> str:
        """The command line that does the same again."""
        options: dict[str, object] = {
            "policies": ",".join(self.policies),
            "frames": self.frames,
            "budget": self.budget,
            "size": f"{self.width}x{self.height}",
            "directions": self.directions,
            "light-samples": self.light_samples,
            "reference-rays": self.reference_rays,
            "reference-every": self.reference_every,
            "key-frames": ",".join(str(frame) for frame in self.shown),
            "seed": self.seed,
        }
        if self.true_samples:
            options["true-samples"] = self.true_samples
        if self.exposure is not None:
            options["exposure"] = self.exposure
        given = [f"--{name} {value}" for name, value in options.items()]
        return " ".join(["lightloom policies", self.scene, *given, *(["--true"] if self.true_samples else [])])

    @property
    def baseline(self) -> str:
        return BASELINE if BASELINE in self.policies else self.policies[0]

    @property
    def full(self) -> str:
        """The policy whose maps are shown: the last."""
        return self.policies[-1]
