"""The selection policy: every constant that decides which texels are sampled, by name and with its range.

`POLICIES` are four of them: "round-robin" takes all texels in turn, "visibility" prefers those that are seen ([0068] to
[0070], [0074]); beside that "variability" prefers those whose values vary ([0072] to [0075]), and "influence", the
default, those whose light changes ([0076] to [0083]).
"""

import re
from dataclasses import dataclass, replace
from typing import Any

from lightloom.golden_model.contract.formats import FRAMES
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, choice, flag, number, powers_of_two, whole

CLASSES = 16
"""Priority classes, 0 to 15: a texel of class c is sampled twice as often as one of class c - 1."""

SHARE = 256
"""Shares of a frame's updates are given in 1/256."""

REACH = 8
"""Texels at most from one whose values decide on another's class: the regions around a texel's own hold all of them."""

MOST_RECORDS = 80
"""Influence records of a frame, with those that footprints make: at most one a ray."""

INFLUENCES = ("off", "volumes", "footprints")
"""How changes reach the maps: not, by volumes of influence ([0079] to [0082]), by rays that spread ([0083])."""


@dataclass(frozen=True, kw_only=True)
class Policy:
    """What selection does. Numbers outside their range are refused with InputError. docs/selection.md explains all."""

    # --- visibility: which texels can be seen ([0068] to [0070], FIG. 8 and 9, claim 15) ---
    visibility: bool = flag(True, "Whether it counts at all; without it every texel counts as seen.")
    normal_test: bool = flag(True, "The normal at the pixel must match the texel's.")
    depth_test: bool = flag(True, "The depth at the pixel must match the texel's.")
    ray_test: bool = flag(True, "What the tests above leave in doubt is decided by a ray from the texel to the eye.")
    normal_cosine: float = number(0.875, -1.0, 1.0, "Least cosine between two normals that match.")
    facing_slack: float = number(
        0.0625,
        0.0,
        1.0,
        "A texel faces the eye down to this sine below its horizon: shading normals lean away from their face. "
        "It counts as the greatest power of two that is not more, and at least 2**-31.",
    )
    depth_slopes: float = number(1.0, 0.0, 16.0, "Depths match within the surface's slope over so many pixels.")
    depth_limit: float = number(
        0.03125, 0.0, 1.0, "What the slope may account for, at most, as a part of the depth: surfaces seen edge-on."
    )
    depth_texels: float = number(0.25, 0.0, 16.0, "Depths match within so many sides of a texel: curvature.")
    depth_relative: float = number(0.0009765625, 0.0, 1.0, "Depths match within this part of the depth: rounding.")
    depth_doubt: float = number(4.0, 1.0, 64.0, "Depths that differ by less than so many times the above are in doubt.")
    visibility_rays: int = number(
        256, 0, 65535, "Rays a frame for what is in doubt, at most; the rest of it counts as likely."
    )
    near_seen: int = number(
        1, 0, 7, "Texels at most so far from a seen one count as likely to be read: reads between texels touch them."
    )
    prediction: int = number(8, 0, 64, "Frames ahead for which the viewpoint is predicted ([0074]).")
    prediction_known: bool = flag(
        True, "The coming viewpoint is taken from the camera's path; else from where the last two viewpoints lead."
    )
    prediction_scale: int = number(4, 1, 16, "The predicted view has so many times fewer pixels along each side.")
    lod_levels: int = number(
        3, 0, 3, "Levels of detail told apart: seen from far, a surface needs fewer of its texels (claim 17)."
    )

    # --- variability: where light varies ([0058], [0072], [0073], [0075], FIG. 13 and 14) ---
    variability_bits: int = number(
        0, 0, 2, "Of the variability map: 0 (there is none), 1 (low or high) or 2 (bins 0 to 3)."
    )
    across_frames: bool = flag(True, "Varies with the deviation between updates.")
    within_frame: bool = flag(True, "Varies with the spread of the rays of one update.")
    within_map: bool = flag(True, "Varies with the contrast to the neighbouring texels.")
    deviation_bins: tuple[int, int, int] = number(
        (32, 64, 128),
        1,
        4095,
        "Deviations from which bins 1, 2, 3 begin, in 1/256, rising; one bit takes the middle one alone.",
    )
    spread_bins: tuple[int, int, int] = number((32, 64, 128), 1, 4095, "The same for the spread.")
    contrast_bins: tuple[int, int, int] = number((32, 64, 128), 1, 256, "The same for the contrast.")
    variability_share: int = number(
        64,
        0,
        256,
        "All thresholds rise and fall so that this part of the sampled texels, in 1/256, lies in the highest "
        "bin after widening; 0: they stay.",
    )
    by_region: bool = flag(
        False,
        "A region of 8 x 8 texels has one bin, the highest of its texels', and contrast is that within it; else every "
        "texel has its own.",
    )
    dilation: int = number(
        1, 0, 7, "High bins reach so many texels further: a map that is wrong is wrong towards more sampling."
    )
    guard: int = number(
        2, 0, 7, "They reach so many texels further still where the map has changed since the last frame …"
    )
    guard_change: int = number(2, 1, 3, "… by so many bins or more.")
    rings: int = number(
        2, 0, 7, "Texels around high bins over which the bins fall by one each: outward from high variability."
    )

    # --- change: where light becomes different ([0076] to [0083], FIG. 16 to 19, claim 14) ---
    notice: bool = flag(True, "Sampling spreads around texels whose last sample was unusual ([0078]).")
    notice_radius: int = number(
        2,
        1,
        (REACH - 1) // 2,
        "A change that is believed has level 2 to so many texels around, and level 1 to as many again; else level 1.",
    )
    notice_votes: int = number(
        4, 1, 9, "A change is believed where so many of 3 x 3 texels noticed one: a single one may be noise."
    )
    influence: str = choice("volumes", INFLUENCES, "How changes reach the maps.")
    influence_least: float = number(
        0.015625,
        2.0**-12,
        0.25,
        "Changes of light by a smaller part do not matter; levels 2 and 3 are for 4 and 16 times it.",
    )
    influence_shiny: float = number(2.0, 1.0, 16.0, "Influence reaches so many times farther from mirrors and glass.")
    influence_hiding: float = number(
        0.5, 0.0, 1.0, "What an object hides counts as much as what a surface of this reflectance reflects."
    )
    influence_ahead: float = number(4.0, 0.0, 64.0, "It reaches so many frames of motion ahead of what moves.")
    influence_slack: float = number(
        4.0, 0.0, 1024.0, "Bounds of lightmaps are looser than their objects by so many texels."
    )
    influence_records: int = number(
        16, 2, 64, "Volumes and shadows of a frame, at most; further changes are joined to the last ones."
    )
    influence_memory: float = number(
        8.0, 1.0, 64.0, "Frames over which motion adds up: as many as the averages remember."
    )
    shadows: bool = flag(True, "Texels between which and a light something has moved are influenced too.")
    footprint_spread: float = number(0.5, 2.0**-6, 4.0, "Radius of a ray's footprint over its length.")
    footprint_rays: int = number(
        64, 0, MOST_RECORDS, f"Rays for footprints a frame, at most; with `influence_records` at most {MOST_RECORDS}."
    )
    heavy_level: int = number(3, 1, 4, "Change levels from this one on make new samples weigh more, 4: none.")
    heavy_updates: int = number(6, 0, 7, "The number of updates that do.")
    lower: bool = flag(
        True,
        "What texels know that influence reaches is worth less by the change to be expected, and nothing where all of "
        "their light changes; until they are sampled they show what fresh ones around them have found (claim 14).",
    )
    track: bool = flag(
        True, "Averages whose samples keep departing to one side, with those of 3 x 3 texels, are worth less."
    )
    drift: bool = flag(
        True, "Samples of a map whose light as a whole is on its way to somewhere else weigh more, until it is there."
    )
    drift_least: int = number(
        3, 1, 256, "Part of its light by which a map's samples of a frame must depart from its averages, in 1/256 …"
    )
    drift_certainty: int = number(3, 1, 15, "… and how many times more than by chance.")
    invalidate: bool = flag(False, "The first of these updates drops the old value instead (claim 14).")

    # --- what is looked at ---
    cull: bool = flag(
        True, "Regions of which no texel can be on the screen, or be reached by a change, are left out; the same bits."
    )

    # --- how a frame's updates are shared out ---
    together: int = whole(
        4, powers_of_two(1, 64), "Texels of a region that follow each other in the order of turns, spread over it."
    )
    sweep: int = number(
        48, 0, SHARE, "Share of the updates, in 1/256, that goes round all visible texels whatever their class."
    )
    probe: int = number(16, 0, SHARE, "Share that goes round all texels ([0078]); with `sweep` at most 256.")
    rays_share: int = number(
        16, 0, SHARE // 2, "Share of the budget, in 1/256, that visibility and footprint rays may take together."
    )

    # --- the class of a texel: each point doubles its rate ---
    degree_points: tuple[int, int, int, int] = number(
        (1, 3, 6, 7), -15, 15, "For degrees 0 to 3; the sum is clipped to 0 to 15."
    )
    change_points: tuple[int, int, int, int] = number(
        (0, 0, 1, 2), -15, 15, "For change levels 0 to 3 of texels of degree 2 and 3."
    )
    hidden_change_points: tuple[int, int, int, int] = number(
        (0, 1, 2, 3), -15, 15, "For change levels 0 to 3 of the others: their light reaches the seen ones."
    )
    variability_points: tuple[int, int, int, int] = number((0, 1, 2, 3), -15, 15, "For bins 0 to 3.")
    need_points: tuple[int, int, int, int] = number(
        (0, 1, 4, 4),
        -15,
        15,
        "For texels in order, not sampled for `old` frames, worth fewer than `few` samples, of which nothing is known.",
    )
    hidden_need_points: tuple[int, int, int, int] = number(
        (0, 1, 1, 1), -15, 15, "The same for texels of degree 0 and 1."
    )
    lod_points: tuple[int, int, int, int] = number(
        (0, -2, -4, -6),
        -15,
        15,
        "For levels of detail 0 to 3: -2 a level is a quarter of the samples a texel, the same number a pixel.",
    )
    few: int = number(3, 1, 255, "Samples that an average is worth.")
    old: int = number(64, 1, FRAMES // 2, "Frames since the last update, which are counted modulo 4096.")

    def __post_init__(self) -> None:
        """Raises InputError, one line, for the first parameter that is not what it may be."""
        check(self, "policy")
        for name in ("deviation_bins", "spread_bins", "contrast_bins"):
            first, second, third = getattr(self, name)
            if not first < second < third:
                raise InputError(f"policy {name} {getattr(self, name)}: the thresholds must rise")
        if self.invalidate and not self.heavy_updates:
            raise InputError("policy invalidate: heavy_updates must be 1 or more, the first one drops the old value")
        # Contrast looks one texel further, but not out of a region that has one bin.
        most = REACH - (self.within_map and not self.by_region)
        if self.dilation + self.guard + self.rings > most:
            raise InputError(
                f"policy dilation {self.dilation}, guard {self.guard} and rings {self.rings}: together at most {most}"
            )
        if self.influence == "footprints" and self.influence_records + self.footprint_rays > MOST_RECORDS:
            raise InputError(
                f"policy influence_records {self.influence_records} and footprint_rays {self.footprint_rays}: "
                f"together at most {MOST_RECORDS}"
            )
        if self.sweep + self.probe > SHARE:
            raise InputError(f"policy sweep {self.sweep} and probe {self.probe}: together at most {SHARE}")

    def selection_rays(self, budget: int, cost: int) -> int:
        """Rays that visibility and footprints may take together of a frame's `budget`, where a texel takes `cost`.

        A share of it, and never the price of the last update.
        """
        return max(min(budget * self.rays_share // SHARE, budget - cost), 0)


_VISIBILITY = Policy(notice=False, influence="off", drift=False)
_VARIABILITY = replace(_VISIBILITY, variability_bits=2)

POLICIES = {
    # Probing with all updates is a round of all texels.
    "round-robin": replace(_VISIBILITY, visibility=False, sweep=0, probe=SHARE, rays_share=0),
    "visibility": _VISIBILITY,
    "variability": _VARIABILITY,
    "influence": Policy(),
}
"""Policies by name: each has all that the one before has, but the map of variability is that of "variability" alone."""


MECHANISMS: dict[str, dict[str, Any]] = {
    "prediction": {"prediction": 0},
    "doubts": {"visibility_rays": 0},
    "rim": {"near_seen": 0},
    "lod": {"lod_levels": 0},
    "variability": {"variability_bits": 0},
    "dilation": {"dilation": 0},
    "guard": {"guard": 0},
    "rings": {"rings": 0},
    "notice": {"notice": False},
    "influence": {"influence": "off"},
    "shadows": {"shadows": False},
    "heavy": {"heavy_updates": 0},
    "lower": {"lower": False},
    "track": {"track": False},
    "drift": {"drift": False},
    "sweep": {"sweep": 0},
    "probe": {"probe": 0},
}
"""What a policy is made of, by the name that switches it: the parameters that it hangs on, as they are without it."""
_WITH = Policy(variability_bits=2)
"""The parameters as they are with all of them."""


def policy_of(name: str) -> Policy:
    """The policy of a name: one of `POLICIES`, and behind it any number of `MECHANISMS`, "+" with and "-" without it.

    So "influence-drift" is the default without drift, "influence+variability-rings" the default with a map of
    variability that has no rings. Raises InputError for an unknown one.
    """
    parts = re.fullmatch(rf"({'|'.join(POLICIES)})((?:[+-][a-z]+)*)", name)
    if parts is None:
        raise InputError(f"policy {name}: unknown; choose one of {', '.join(POLICIES)}")
    chosen: dict[str, Any] = {}
    for sign, mechanism in re.findall(r"([+-])([a-z]+)", parts[2]):
        if mechanism not in MECHANISMS:
            raise InputError(f"policy {name}: {mechanism} is unknown; choose of {', '.join(MECHANISMS)}")
        off = MECHANISMS[mechanism]
        chosen |= off if sign == "-" else {field: getattr(_WITH, field) for field in off}
    return replace(POLICIES[parts[1]], **chosen)
