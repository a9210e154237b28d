"""What the renderer needs of a ray tracer, whichever does the work: traversal, brute force, or the hardware."""

from typing import Protocol

import numpy as np


class Trace(Protocol):
    """RAY (N,) to HIT (N,): the nearest hit of each ray or, with `any_hit`, whether there is one (`primitive` >= 0)."""

    def __call__(self, rays: np.ndarray, *, any_hit: bool = False) -> np.ndarray: ...
