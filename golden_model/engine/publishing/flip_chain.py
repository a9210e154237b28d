"""The flip chain ([0057], [0085], claims 13 and 16): a version of the published maps for each frame in flight.

Version k is what frame k's shading reads. One version is kept whole, the baseline; each later one is stored as the
regions in which it differs from the version before it, with their new texels. Updates for a later frame are written to
a version that nobody can read yet, so the maps can be read while they are updated and what is read never changes. When
a frame is done, the difference that follows is folded into the baseline.

    begin(k) ── write(k, …) ── commit(k) ── read(k), as often as wanted ── release(k)
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import PUBLISHED_TEXEL
from lightloom.golden_model.engine.publishing.publisher import Difference, apply

LONGEST = 8
"""Versions at most."""

TEXEL_BYTES = PUBLISHED_TEXEL.itemsize
REGION_BYTES = 4
"""What the table of a difference takes for a region beside its texels: where they are stored."""


@dataclass(frozen=True, kw_only=True)
class ChainFigures:
    """What the chain holds in memory."""

    versions: int
    """Versions not released, the one being written included."""
    baseline_bytes: int
    difference_bytes: int
    """All differences together: 8 bytes a texel and 4 a region."""
    regions: dict[int, int]
    """Regions in each difference, by version."""
    texels: dict[int, int]
    """Texels in each difference, all levels, by version."""


class FlipChain:
    """Versions of one scene's published maps. They are numbered on from the first and released in that order."""

    def __init__(self, published: np.ndarray, length: int, first: int = 0):
        """`published`, PUBLISHED_TEXEL (texels,), is version `first`; at most `length` (1 to 8) exist at a time.

        With length 1 a version can only be begun when the one before is released: reading and updating take turns. With
        2 one is read while the next is written, and every further one lets updates run a frame further ahead.
        """
        if not 1 <= length <= LONGEST:
            raise ValueError(f"flip chain of {length} versions: must be 1 to {LONGEST}")
        self.length = length
        self._baseline = published.copy()
        self._oldest = first
        """The lowest version not released; with all released, the last one released, which the baseline still holds."""
        self._newest = first
        """The last version committed."""
        self._released = False
        """Whether `_oldest` is released."""
        self._open: list[Difference] | None = None
        """What is written to version `_newest` + 1, None if it has not been begun."""
        self._differences: dict[int, list[Difference]] = {}
        """By version k: what turns version k - 1 into version k."""
        self._whole: dict[int, np.ndarray] = {}
        """Versions as they were read: read-only."""

    @property
    def newest(self) -> int:
        """The last version that can be read."""
        return self._newest

    def begin(self, version: int) -> None:
        """Opens the next version for writing. ValueError where that is not the next one or the chain is full."""
        if self._open is not None or version != self._newest + 1:
            raise ValueError(f"version {version} cannot begin: {self._newest} is the last one committed")
        if self._in_flight() == self.length:
            raise ValueError(f"version {version} cannot begin: {self.length} versions are in flight")
        self._open = []

    def write(self, version: int, difference: Difference) -> None:
        """Adds regions to the version being written; later texels replace earlier ones."""
        self._require_open(version)
        assert self._open is not None
        self._open.append(difference)

    def commit(self, version: int) -> None:
        """Completes the version being written: from now on it can be read and no longer written."""
        self._require_open(version)
        assert self._open is not None
        self._differences[version] = self._open
        self._open = None
        self._newest = version
        if self._released:
            self._fold()

    def read(self, version: int) -> np.ndarray:
        """PUBLISHED_TEXEL (texels,), read-only and for ever the same. ValueError unless committed and not released."""
        if not self._readable(version):
            raise ValueError(f"version {version} cannot be read: {self._oldest} to {self._newest} can")
        if version not in self._whole:
            earlier = max((k for k in self._whole if k < version), default=None)
            whole = (self._baseline if earlier is None else self._whole[earlier]).copy()
            for k in range((self._oldest if earlier is None else earlier) + 1, version + 1):
                _apply_all(self._differences[k], whole)
            whole.flags.writeable = False
            self._whole[version] = whole
        return self._whole[version]

    def release(self, version: int) -> None:
        """Frame `version` is done: no more reads. Versions are released in order, ValueError otherwise."""
        if not self._readable(version) or version != self._oldest:
            raise ValueError(f"version {version} cannot be released: the oldest is {self._oldest}")
        self._whole.pop(version, None)
        self._released = True
        if self._newest > version:
            self._fold()

    def figures(self) -> ChainFigures:
        """What is in memory now."""
        parts = dict(self._differences)
        if self._open is not None:
            parts[self._newest + 1] = self._open
        regions = {k: sum(len(part.region) for part in written) for k, written in parts.items()}
        texels = {k: sum(len(part.texel) for part in written) for k, written in parts.items()}
        return ChainFigures(
            versions=self._in_flight(),
            baseline_bytes=len(self._baseline) * TEXEL_BYTES,
            difference_bytes=sum(texels.values()) * TEXEL_BYTES + sum(regions.values()) * REGION_BYTES,
            regions=regions,
            texels=texels,
        )

    def _in_flight(self) -> int:
        return self._newest - self._oldest + (not self._released) + (self._open is not None)

    def _readable(self, version: int) -> bool:
        return self._oldest + self._released <= version <= self._newest

    def _require_open(self, version: int) -> None:
        if self._open is None or version != self._newest + 1:
            raise ValueError(f"version {version} is not being written")

    def _fold(self) -> None:
        """The oldest version is released and another one is there: the baseline becomes that one."""
        self._oldest += 1
        self._released = False
        _apply_all(self._differences.pop(self._oldest), self._baseline)


def _apply_all(differences: list[Difference], published: np.ndarray) -> None:
    for difference in differences:
        apply(difference, published)
