"""What a texture comes to over a triangle: the light of a triangle that shines as its picture says."""

import numpy as np

FEWEST, MOST = 16, 256
"""Pieces that each side of a triangle is cut into."""


def mean_over(picture: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The mean of a picture (H, W, 3), read bilinearly, over a triangle of texture coordinates (3, 2): (3,) float64.

    Of the middles of pieces about half a texel of the picture wide, `MOST` squared of them at most.
    """
    height, width = picture.shape[:2]
    place = corners.astype(np.float64) * np.array([width, height]) - 0.5
    extent = float(np.abs(place - np.roll(place, 1, axis=0)).max())
    pieces = int(np.clip(np.ceil(2 * extent), FEWEST, MOST))
    i, j = np.divmod(np.arange(pieces * pieces), pieces)
    upright, turned = i + j < pieces, i + j < pieces - 1
    u = np.concatenate([(i[upright] + 1 / 3) / pieces, (i[turned] + 2 / 3) / pieces])
    v = np.concatenate([(j[upright] + 1 / 3) / pieces, (j[turned] + 2 / 3) / pieces])
    at = place[0] * (1 - u - v)[:, None] + place[1] * u[:, None] + place[2] * v[:, None]
    whole = np.floor(at)
    part, first = at - whole, whole.astype(np.int64)
    total = np.zeros(3)
    for k in (0, 1):
        for m in (0, 1):
            share = (part[:, 0] if k else 1 - part[:, 0]) * (part[:, 1] if m else 1 - part[:, 1])
            value = picture[(first[:, 1] + m) % height, (first[:, 0] + k) % width].astype(np.float64)
            total = total + np.cumsum(value * share[:, None], axis=0)[-1]
    return np.asarray(total / len(u))
