"""The selection policy: every constant that decides which texels are sampled, by name and with its range.

`POLICIES` are four of them, each with all that the one before has: "round-robin" takes all texels in turn,
"visibility" prefers those that are seen ([0068] to [0070], [0074]), "variability" those whose values vary ([0072] to
[0075]), "influence" those whose light changes ([0076] to [0083]).
"""

from dataclasses import dataclass, replace

import numpy as np

from lightloom.golden_model.host.errors import InputError

CLASSES = 16
"""Priority classes, 0 to 15: a texel of class c is sampled twice as often as one of class c - 1."""

SHARE = 256
"""Shares of a frame's updates are given in 1/256."""

INFLUENCES = ("off", "volumes", "footprints")
"""How changes reach the maps: not, by volumes of influence ([0079] to [0082]), by rays that spread ([0083])."""


@dataclass(frozen=True, kw_only=True)
class Policy:
    """What selection does. Numbers outside their range are refused with InputError. docs/selection.md explains all."""

    # --- visibility: which texels can be seen ([0068] to [0070], FIG. 8 and 9, claim 15) ---
    visibility: bool = True
    """Whether it counts at all; without it every texel counts as seen."""
    normal_test: bool = True
    """The normal at the pixel must match the texel's."""
    depth_test: bool = True
    """The depth at the pixel must match the texel's."""
    ray_test: bool = True
    """What the tests above leave in doubt is decided by a ray from the texel to the eye."""
    normal_cosine: float = 0.875
    """Least cosine between two normals that match, -1 to 1."""
    facing_slack: float = 0.0625
    """A texel faces the eye down to this sine below its horizon, 0 to 1: shading normals lean away from their face."""
    depth_slopes: float = 1.0
    """Depths match within the surface's slope over so many pixels, 0 to 16."""
    depth_limit: float = 0.03125
    """What the slope may account for, at most, as a part of the depth, 0 to 1: surfaces seen edge-on."""
    depth_texels: float = 0.25
    """Depths match within so many sides of a texel, 0 to 16: curvature."""
    depth_relative: float = 0.0009765625
    """Depths match within this part of the depth, 0 to 1: rounding."""
    depth_doubt: float = 4.0
    """Depths that differ by less than so many times the above are in doubt, 1 to 64."""
    visibility_rays: int = 256
    """Rays a frame for what is in doubt, at most, 0 to 65535; the rest of it counts as likely."""
    near_seen: int = 1
    """Texels at most so far from a seen one count as likely to be read, 0 to 7: reads between texels touch them."""
    prediction: int = 8
    """Frames ahead for which the viewpoint is predicted, 0 (not) to 64 ([0074])."""
    prediction_known: bool = True
    """The coming viewpoint is taken from the camera's path; else from where the last two viewpoints lead."""
    prediction_scale: int = 4
    """The predicted view has so many times fewer pixels along each side, 1 to 16."""
    lod_levels: int = 3
    """Levels of detail told apart, 0 (not) to 3: seen from far, a surface needs fewer of its texels (claim 17)."""

    # --- variability: where light varies ([0058], [0072], [0073], [0075], FIG. 13 and 14) ---
    variability_bits: int = 2
    """Of the variability map: 0 (there is none), 1 (low or high) or 2 (bins 0 to 3)."""
    across_frames: bool = True
    """Varies with the deviation between updates."""
    within_frame: bool = True
    """Varies with the spread of the rays of one update."""
    within_map: bool = True
    """Varies with the contrast to the neighbouring texels."""
    deviation_bins: tuple[int, int, int] = (32, 64, 128)
    """Deviations from which bins 1, 2, 3 begin, in 1/256, 1 to 4095, rising; one bit takes the middle one alone."""
    spread_bins: tuple[int, int, int] = (32, 64, 128)
    """The same for the spread."""
    contrast_bins: tuple[int, int, int] = (32, 64, 128)
    """The same for the contrast, at most 256."""
    variability_share: int = 64
    """All thresholds rise and fall so that this part of the sampled texels, in 1/256, lies in the highest bin after
    widening, 1 to 256; 0: they stay."""
    by_region: bool = False
    """A region of 8 x 8 texels has one bin, the highest of its texels'; else every texel has its own."""
    dilation: int = 1
    """High bins reach so many texels further, 0 to 7: a map that is wrong is wrong towards more sampling."""
    guard: int = 2
    """They reach so many texels further still where the map has changed since the last frame, 0 to 7 …"""
    guard_change: int = 2
    """… by so many bins or more, 1 to 3."""
    rings: int = 2
    """Texels around high bins over which the bins fall by one each, 0 to 7: outward from high variability."""

    # --- change: where light becomes different ([0076] to [0083], FIG. 16 to 19, claim 14) ---
    notice: bool = True
    """Sampling spreads around texels whose last sample was unusual ([0078])."""
    notice_radius: int = 2
    """A change that is believed has level 2 to so many texels around, and level 1 to as many again; else level 1, 1 to
    15."""
    notice_votes: int = 2
    """A change is believed where so many of 3 x 3 texels noticed one, 1 to 9: a single one may be noise."""
    influence: str = "volumes"
    """One of INFLUENCES."""
    influence_least: float = 0.015625
    """Changes of light by a smaller part do not matter, 2**-12 to 0.25; levels 2 and 3 are for 4 and 16 times it."""
    influence_shiny: float = 2.0
    """Influence reaches so many times farther from mirrors and glass, 1 to 16."""
    influence_hiding: float = 0.5
    """What an object hides counts as much as what a surface of this reflectance reflects, 0 to 1."""
    influence_ahead: float = 4.0
    """It reaches so many frames of motion ahead of what moves, 0 to 64."""
    influence_slack: float = 4.0
    """Bounds of lightmaps are looser than their objects by so many texels, 0 to 1024."""
    influence_records: int = 16
    """Volumes and shadows of a frame, at most, 2 to 64; further changes are joined to the last ones."""
    influence_memory: float = 8.0
    """Frames over which motion adds up, 1 to 64: as many as the averages remember."""
    shadows: bool = True
    """Texels between which and a light something has moved are influenced too."""
    footprint_spread: float = 0.5
    """Radius of a ray's footprint over its length, 0.015625 to 4."""
    footprint_rays: int = 64
    """Rays for footprints a frame, at most, 0 to 1024."""
    heavy_level: int = 2
    """Change levels from this one on make new samples weigh more, 1 to 4 (none)."""
    heavy_updates: int = 6
    """The number of updates that do, 0 to 7."""
    drop_level: int = 3
    """Texels that influence reaches at such levels drop their values at once, 1 to 4 (none): until they are sampled
    they show what the texels around them have found since (claim 14)."""
    drift: bool = True
    """Samples of a map whose light as a whole is on its way to somewhere else weigh more, until it is there."""
    drift_least: int = 3
    """Part of its light by which a map's samples of a frame must depart from its averages, in 1/256, 1 to 256 …"""
    drift_certainty: int = 2
    """… and how many times more than by chance, 1 to 15."""
    invalidate: bool = False
    """The first of these updates drops the old value instead (claim 14)."""

    # --- how a frame's updates are shared out ---
    sweep: int = 48
    """Share of the updates, in 1/256, that goes round all visible texels whatever their class, 0 to 256."""
    probe: int = 16
    """Share that goes round all texels, 0 to 256 ([0078]); with `sweep` at most 256."""
    rays_share: int = 16
    """Share of the budget, in 1/256, that visibility and footprint rays may take together, 0 to 128."""
    spare: int = 256
    """Texels named for budget that is left over, in 1/256 of the updates, 0 to 1024."""

    # --- the class of a texel: each point doubles its rate ---
    degree_points: tuple[int, int, int, int] = (1, 3, 6, 7)
    """For degrees 0 to 3, -15 to 15 like all points; the sum is clipped to 0 to 15."""
    change_points: tuple[int, int, int, int] = (0, 2, 3, 4)
    """For change levels 0 to 3 of texels of degree 2 and 3."""
    hidden_change_points: tuple[int, int, int, int] = (0, 3, 5, 6)
    """For change levels 0 to 3 of the others: their light reaches the seen ones."""
    variability_points: tuple[int, int, int, int] = (0, 1, 2, 3)
    """For bins 0 to 3."""
    need_points: tuple[int, int, int, int] = (0, 1, 4, 2)
    """For texels in order, not sampled for `old` frames, with fewer than `few` samples, never sampled: those show what
    lies around them, with less noise than one sample of their own has."""
    lod_points: tuple[int, int, int, int] = (0, -2, -4, -6)
    """For levels of detail 0 to 3: -2 a level is a quarter of the samples a texel, the same number a pixel."""
    few: int = 8
    """Samples in the running average, 1 to 255."""
    old: int = 64
    """Frames since the last update, 1 to 32768."""

    def __post_init__(self) -> None:
        """Raises InputError, one line, for the first number out of its range."""
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            whole = isinstance(low, int)
            values = value if isinstance(value, tuple) else (value,)
            for number in values:
                kind = (int, np.integer) if whole else (int, float, np.integer, np.floating)
                if isinstance(number, bool) or not isinstance(number, kind) or not low <= number <= high:
                    raise InputError(f"policy {name} {value}: must be {'whole, ' if whole else ''}{low} to {high}")
        for name in ("deviation_bins", "spread_bins", "contrast_bins"):
            first, second, third = getattr(self, name)
            if not first < second < third:
                raise InputError(f"policy {name} {getattr(self, name)}: the thresholds must rise")
        if self.influence not in INFLUENCES:
            raise InputError(f"policy influence {self.influence}: must be one of {', '.join(INFLUENCES)}")
        if self.invalidate and not self.heavy_updates:
            raise InputError("policy invalidate: heavy_updates must be 1 or more, the first one drops the old value")
        if self.sweep + self.probe > SHARE:
            raise InputError(f"policy sweep {self.sweep} and probe {self.probe}: together at most {SHARE}")


RANGES: dict[str, tuple[float, float]] = {
    "normal_cosine": (-1.0, 1.0),
    "facing_slack": (0.0, 1.0),
    "depth_slopes": (0.0, 16.0),
    "depth_limit": (0.0, 1.0),
    "depth_texels": (0.0, 16.0),
    "depth_relative": (0.0, 1.0),
    "depth_doubt": (1.0, 64.0),
    "visibility_rays": (0, 65535),
    "near_seen": (0, 7),
    "prediction": (0, 64),
    "prediction_scale": (1, 16),
    "lod_levels": (0, 3),
    "variability_bits": (0, 2),
    "deviation_bins": (1, 4095),
    "spread_bins": (1, 4095),
    "contrast_bins": (1, 256),
    "dilation": (0, 7),
    "guard": (0, 7),
    "guard_change": (1, 3),
    "variability_share": (0, 256),
    "rings": (0, 7),
    "notice_radius": (1, 15),
    "notice_votes": (1, 9),
    "influence_least": (2.0**-12, 0.25),
    "influence_shiny": (1.0, 16.0),
    "influence_hiding": (0.0, 1.0),
    "influence_ahead": (0.0, 64.0),
    "influence_slack": (0.0, 1024.0),
    "influence_records": (2, 64),
    "influence_memory": (1.0, 64.0),
    "footprint_spread": (2.0**-6, 4.0),
    "footprint_rays": (0, 1024),
    "heavy_level": (1, 4),
    "heavy_updates": (0, 7),
    "drop_level": (1, 4),
    "drift_least": (1, 256),
    "drift_certainty": (1, 15),
    "sweep": (0, SHARE),
    "probe": (0, SHARE),
    "rays_share": (0, SHARE // 2),
    "spare": (0, 4 * SHARE),
    "degree_points": (-15, 15),
    "change_points": (-15, 15),
    "hidden_change_points": (-15, 15),
    "variability_points": (-15, 15),
    "need_points": (-15, 15),
    "lod_points": (-15, 15),
    "few": (1, 255),
    "old": (1, 32768),
}
"""Lowest and highest value of every number; whole where they are."""

_VISIBILITY = Policy(variability_bits=0, notice=False, influence="off", drift=False)
_VARIABILITY = replace(_VISIBILITY, variability_bits=2)

POLICIES = {
    # Probing with all updates is a round of all texels.
    "round-robin": replace(_VISIBILITY, visibility=False, sweep=0, probe=SHARE, rays_share=0),
    "visibility": _VISIBILITY,
    "variability": _VARIABILITY,
    "influence": Policy(),
}
"""Policies by name, each with all that the one before has."""


def policy_of(name: str) -> Policy:
    """The policy of a name. Raises InputError for an unknown one."""
    if name not in POLICIES:
        raise InputError(f"--policy {name}: unknown; choose one of {', '.join(POLICIES)}")
    return POLICIES[name]
