"""When the light of a scene has come to rest, by what the engine says of each round of priming: for `Renderer`."""

SETTLED_BITS = 10
"""Light is settled if less than 2**-SETTLED_BITS of it is still to come."""
REST_BITS = 6
"""All light is at rest if sampling every texel anew changes it by less than 2**-REST_BITS half octaves on average."""


def settled(totals: list[int]) -> bool:
    """Whether light that comes to rest, a bounce a round, lacks less than 2**-SETTLED_BITS of what it will come to.

    `totals` is all light after each round so far, from darkness on. Late rounds rise in geometric progression; the rest
    is the sum of its further terms, d * d / (c - d) for rises of c and then d. Three rounds are needed for that.
    """
    if len(totals) < 3 or not totals[-1]:
        return False
    before, last = totals[-2] - totals[-3], totals[-1] - totals[-2]
    return last <= 0 or (last < before and (last * last << SETTLED_BITS) < totals[-1] * (before - last))


def dark(totals: list[int]) -> bool:
    """Whether no light has come in three rounds: there is none where they look, and none will come from there."""
    return len(totals) >= 3 and not totals[-1]


def at_rest(sweeps: list[int], texels: int) -> bool:
    """Whether so many texels, after each time that all were sampled anew, changed little the last two times.

    `sweeps` has their brightness (`brightness_of`) each time. By less than 2**-REST_BITS half octaves on average, half
    a per cent, and what noise may come to in the sum: the root of twice their number. Logarithms, because a dark corner
    that light comes to after many bounces says nothing in a sum beside the lamp.
    """
    last = sweeps[-3:]
    if len(last) < 3:
        return False
    excess = (max(last) - min(last) << REST_BITS) - texels
    return excess < 0 or excess * excess < texels << 2 * REST_BITS + 1
