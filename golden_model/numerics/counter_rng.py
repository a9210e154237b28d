"""Counter-based random numbers: a value is a hash of its counters (texel, frame, sample, ...), there is no state.

So every unit can make its numbers in any order, and the hardware the same ones as the model.
"""

import numpy as np


def hash_u32(*counters: np.ndarray | int) -> np.ndarray:
    """One or more counters (integer arrays, broadcast, taken modulo 2**32) to uint32, uniform over all 32 bits.

    The PCG hash of Jarzynski and Olano (Hash Functions for GPU Rendering, JCGT 2020), one round a counter: the state
    so far is xored with the next counter. Two 32-bit multiplications a round.
    """
    state = np.zeros((), dtype=np.uint32)
    with np.errstate(over="ignore"):  # arithmetic modulo 2**32 is meant
        for counter in counters:
            state = state ^ np.asarray(counter).astype(np.uint32)
            state = state * np.uint32(747796405) + np.uint32(2891336453)
            word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
            state = (word >> np.uint32(22)) ^ word
    return np.asarray(state)


def uniform(bits: np.ndarray) -> np.ndarray:
    """uint32 to float32 in [0, 1): the top 24 bits times 2**-24, so exact."""
    return (bits >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)
