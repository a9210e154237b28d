"""Layouts under the open sky."""

import numpy as np

from lightloom.golden_model.stimuli.layouts.description import GREY, WOOD, Description, colour, key, rotation


def village(rng: np.random.Generator) -> Description:
    """Houses on a ground under sun and sky; a cart goes between them."""
    out = Description(0.45)
    out.quad("ground", (-12, 0, -12), (0, 0, 24), (24, 0, 0), GREY)
    for number in range(6):
        x, z = (number % 3 - 1) * 6 + rng.uniform(-1, 1), (number // 3 - 1) * 6 + rng.uniform(-1, 1)
        size = rng.uniform([2, 2, 2], [3.5, 5, 3.5])
        out.box(f"house {number}", (x, size[1] / 2 + 0.001, z), size, colour(rng), rotate=rotation(rng))
    path = [key(8, translate=(0, 0, 0)), key(40, translate=(-11, 0, 0))]
    out.box("cart", (6, 0.501, 3.4), (1.6, 1, 0.9), WOOD, path=path)
    out.tables["sky"] = {"radiance": [0.35, 0.5, 0.8]}
    towards = [round(float(each), 4) for each in rng.uniform([-1, 0.5, -1], [1, 1, 1])]
    out.tables["sun"] = {"towards": towards, "irradiance": [3.0, 2.7, 2.2], "angle": 0.53}
    out.camera((1, 2.6, 11), (0, 1.5, 0), 0.55)
    return out
