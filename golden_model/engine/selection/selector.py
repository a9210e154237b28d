"""Which texels are sampled in a frame, in which order, and how much ([0066] to [0083]).

`Selector` looks at visibility, variability, change, age and level of detail, gives every texel a class, and shares the
updates that the budget pays for among the classes, with a part for a round of all visible texels and one for a round of
all. It reads every texel once a frame, in a fixed order, and has counters and cursors; nothing is sorted.
docs/selection.md describes it, with all that is read and written.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_MAX, LIKELY, SEEN
from lightloom.golden_model.engine.sampling.running_average import drop
from lightloom.golden_model.engine.selection.classes import Share, class_table, classes_of, needs, quotas
from lightloom.golden_model.engine.selection.culling import RegionBoxes, region_boxes
from lightloom.golden_model.engine.selection.influence.reach import texel_changes, touched
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.policy import CLASSES, SHARE, Policy
from lightloom.golden_model.engine.selection.round_robin import RoundRobin
from lightloom.golden_model.engine.selection.screen_test import ScreenTest, Sight, screen_test
from lightloom.golden_model.engine.selection.tracking import most_worth
from lightloom.golden_model.engine.selection.variability import Variability
from lightloom.golden_model.engine.selection.visibility import Visibility
from lightloom.golden_model.tables.lightmap import SIDE_LEVELS, VALID, Lightmaps, row_and_column
from lightloom.golden_model.tables.pinhole import View
from lightloom.golden_model.tracing.trace_protocol import Trace


def coarse_to_fine(lightmaps: Lightmaps, together: int = 1) -> np.ndarray:
    """The valid texels, (V,) int64, ordered so that every beginning of the list is spread evenly over all maps.

    Texels are ordered by the reversed bits of their Morton code: first those of a wide lattice, then the ones that
    halve its spacing, and so on. So a map that starts empty appears as a whole and becomes finer, and what is sampled
    in one frame lies far apart. Texels of several maps that share a place go by their number.

    So many `together`, a power of two up to 64, of a region of 8 x 8 follow each other, spread over it: the first ones
    of each region, then the next of each. A frame then rewrites fewer regions.
    """
    texel = np.flatnonzero(lightmaps.texels["state"] == VALID)
    map_of = lightmaps.texels["object"][texel]
    row, column = row_and_column(lightmaps, texel)
    levels = int(max(row.max(initial=0), column.max(initial=0))).bit_length()
    place, region = np.zeros((2, len(texel)), dtype=np.int64)
    for level in range(max(levels, SIDE_LEVELS)):
        key = place if level < SIDE_LEVELS else region
        key[:] = (key << 2) | (((row >> level) & 1) << 1) | ((column >> level) & 1)
    return texel[np.lexsort((place % together, map_of, region, place // together))]


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the host tells of a frame's scene, with O objects and so many maps."""

    records: np.ndarray
    """INFLUENCE (K,): what became different since the frame before."""
    rays: int
    """Rays of the frame's budget that were traced to find the records."""
    boxes: np.ndarray
    """Loose bounds of the maps, (O, 2, 3) float32; low is above high for an object that is not there."""
    rotation: np.ndarray
    """Poses of the maps' objects, (O, 3, 3) float32."""
    translation: np.ndarray
    """(O, 3) float32."""
    texel_size: float
    """Side of a texel at rest, in the scene's unit."""


@dataclass(frozen=True, kw_only=True)
class FrameContext:
    """What a frame's selection looks at."""

    frame: int
    """Its number, 0 or more."""
    report: Report
    """What the host tells of it."""
    lightmaps: Lightmaps
    """With the records of this frame's pose (`pose.moved_records`)."""
    state: np.ndarray
    """TEXEL_STATE (N,) before the frame's updates."""
    values: np.ndarray | None = None
    """The irradiance that is shown, level 0, (N, 3) float32; None: contrast within the map is not looked at."""
    view: View
    gbuffer: np.ndarray
    """GBUFFER (H, W) of the view."""
    predicted: tuple[View, np.ndarray] | None = None
    """A view to come (`predicted_view.predicted_view`) and its GBUFFER; None: nothing is predicted."""
    trace: Trace | None = None
    """Traces this frame's scene; None: no ray decides on visibility."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The selection of a frame, of N texels."""

    texel: np.ndarray
    """The texels to update, each once, (M,) int64: those of probing and of the sweep, then by class from the top."""
    spare: np.ndarray
    """Further ones, in this order, for budget that is left over, (S,) int64; none of them in `texel`."""
    spare_class: np.ndarray
    """Their classes, (S,) int64."""
    rays: dict[str, int]
    """Rays already traced for the selection: "visibility", "footprints"."""
    priority: np.ndarray
    """Class of each texel, 0 to 15, (N,) uint8; 0 for those that are not valid. So with all that follows."""
    degree: np.ndarray
    """Likelihood to be seen, `visibility.UNSEEN` to SEEN, (N,) uint8."""
    lod: np.ndarray
    """Level of detail at which it is seen, 0 to 3, (N,) uint8."""
    bins: np.ndarray
    """Variability after widening, 0 to 3, (N,) uint8."""
    influence: np.ndarray
    """Change level by influence records, 0 to 3, (N,) uint8."""
    expected: np.ndarray
    """Change that is expected in this frame by influence records, 0 to WHOLE_CHANGE, (N,) uint8; 0 without `lower`."""
    most: np.ndarray
    """Samples in 16ths that averages are worth at most, by how theirs departed, (N,) uint16; COUNT_MAX: no limit."""
    change: np.ndarray
    """Change level by influence, by what texels noticed, and by updates still to come after a change, (N,) uint8."""
    heavy: np.ndarray
    """Texels whose next samples are to weigh more, (N,) bool."""
    forget: np.ndarray
    """Texels that drop their old value when they are sampled in this frame, (N,) bool; none unless `invalidate`."""
    records: np.ndarray
    """INFLUENCE (K,) of this frame."""
    touched: np.ndarray
    """Lightmaps that any of them may reach, (O,) bool."""

    def mark(self, state: np.ndarray, updates: int) -> None:
        """Gives heavy weights to the next `updates` samples of TEXEL_STATE (N,) where light has changed, in place."""
        state["heavy"][self.heavy] = updates

    def forget_old(self, state: np.ndarray, texel: np.ndarray) -> None:
        """Drops the values of those of `texel` (M,), about to be updated, whose light has changed, in place."""
        drop(state, texel[self.forget[texel]])


class Selector:
    """The selection of one scene's lightmaps over a sequence of frames."""

    def __init__(self, lightmaps: Lightmaps, policy: Policy | None = None, test: ScreenTest = screen_test):
        """Lightmaps at rest."""
        self.policy = policy or Policy()
        self.order = coarse_to_fine(lightmaps, self.policy.together)
        """The texels in the order in which they are read and take their turns, (V,) int64."""
        self._classes = class_table(self.policy)
        windows = Windows(lightmaps)
        self._windows = windows
        self._variability = Variability(lightmaps, windows, self.policy)
        memory = self._variability.by_region
        self._regions = region_boxes(lightmaps) if self.policy.cull else None
        self._exists = lightmaps.texels["state"] == VALID
        self._visibility = Visibility(windows, memory[self._exists[memory]], self.policy, test)
        self._sweep, self._probe = RoundRobin(), RoundRobin()
        self._sweep_share, self._probe_share = Share(self.policy.sweep), Share(self.policy.probe)
        self._turns = [RoundRobin() for _ in range(CLASSES)]
        self._place = np.zeros(len(lightmaps.texels), dtype=np.int64)
        self._place[self.order] = np.arange(len(self.order))

    def plan(self, context: FrameContext, budget: int, cost: int = 1, least: int | None = None) -> Plan:
        """The texels of a frame: `budget` rays pay for the rays that are traced here and `cost` >= 1 a texel.

        So len(texel) * cost + the rays traced <= budget. A texel takes `least` rays or more (None: as many as `cost`):
        there are as many to spare as the budget would pay for if no texel took more.
        """
        policy, maps = self.policy, context.lightmaps
        valid = self._exists & (maps.texels["state"] == VALID)
        allowed = policy.selection_rays(budget, cost)
        report = context.report
        regions = None if self._regions is None else self._regions.posed(report.rotation, report.translation)
        influence, expected = texel_changes(report.records, report.boxes, maps, valid, regions)
        sight, visibility_rays = self._look(context, valid, allowed - report.rays, regions)
        bins = self._variability.look(context.state, context.values, valid)
        noticed, believed = self._noticed(context.state, valid)
        change = np.maximum(influence, noticed)
        change = np.where(valid & (context.state["heavy"] > 0), np.uint8(3), change)
        need = needs(context.state, context.frame, policy)
        priority = classes_of(self._classes, sight.lod, need, bins, change, sight.degree) * valid
        urgent = valid & ((influence >= policy.heavy_level) | believed)

        left = budget - report.rays - visibility_rays
        updates, certain = left // cost, (budget - allowed) // cost
        chosen, spare = self._share_out(valid, sight.degree, priority, updates, left // (least or cost), certain)
        return Plan(
            texel=chosen,
            spare=spare,
            spare_class=priority[spare].astype(np.int64),
            rays={"visibility": visibility_rays, "footprints": report.rays},
            priority=priority,
            degree=sight.degree,
            lod=sight.lod,
            bins=bins,
            influence=influence,
            expected=expected if policy.lower else np.zeros_like(expected),
            most=most_worth(context.state, self._windows) if policy.track else np.full_like(need, COUNT_MAX, np.uint16),
            change=change,
            heavy=urgent & (policy.heavy_updates > 0),
            # Heavy updates of which none has come yet: the change is known and the value is from before it.
            forget=(urgent | (valid & (context.state["heavy"] == policy.heavy_updates))) & policy.invalidate,
            records=report.records,
            touched=touched(report.records, report.boxes).any(axis=0),
        )

    def longest_wait(self, budget: int, cost: int) -> int:
        """Frames in a row that a texel can count as likely to be seen, or seen, without being sampled in any of them.

        For frames of `budget` rays and `cost` a texel. The sweep goes round V texels, and takes floor(F u s / 256) - 1
        in F frames of u certain updates with a share s (`Share.of`).
        """
        certain = (budget - self.policy.selection_rays(budget, cost)) // cost
        share = self.policy.sweep or self.policy.probe
        return -(-(len(self.order) + 1) * SHARE // (certain * share)) if certain * share else 1 << 62

    def spend(self, plan: Plan, count: int) -> None:
        """Says that the first `count` of the plan's spare texels are updated too: their turns have passed."""
        for texel, rank in zip(plan.spare[:count], plan.spare_class[:count], strict=True):
            self._turns[rank].pass_over(int(self._place[texel]))

    def _look(
        self, context: FrameContext, valid: np.ndarray, rays: int, regions: RegionBoxes | None
    ) -> tuple[Sight, int]:
        if not self.policy.visibility:
            everything = np.where(valid, np.uint8(SEEN), np.uint8(0))
            return Sight(degree=everything, lod=np.zeros(len(valid), dtype=np.uint8)), 0
        return self._visibility.look(
            context.lightmaps.texels,
            valid,
            context.view,
            context.gbuffer,
            context.report.texel_size,
            predicted=context.predicted,
            trace=context.trace,
            rays=rays,
            regions=regions,
        )

    def _noticed(self, state: np.ndarray, valid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Change levels around texels that noticed one, (N,) uint8, and where the change is believed, (N,) bool.

        It is believed wherever enough of 3 x 3 noticed it, also by those that did not: of a change that is little
        larger than noise each misses it at times.
        """
        policy = self.policy
        noticed = (state["noticed"] & valid).astype(np.uint8)
        if not (policy.notice and noticed.any()):
            return np.zeros(len(valid), dtype=np.uint8), np.zeros(len(valid), dtype=bool)
        believed = valid & (self._windows.total(noticed) >= policy.notice_votes)
        centre = noticed * believed
        near = self._windows.largest(centre, policy.notice_radius)
        around = self._windows.largest(near | noticed, policy.notice_radius)
        return centre + near + around, believed

    def _share_out(
        self, valid: np.ndarray, degree: np.ndarray, priority: np.ndarray, updates: int, most: int, certain: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """The texels of `updates` updates, and those to spare, `most` together.

        Shares are reckoned from `certain` <= `updates`.
        """
        order = self.order
        free = valid[order]
        parts = []

        def take(places: np.ndarray) -> None:
            free[places] = False
            parts.append(order[places])

        take(self._probe.take(free, self._probe_share.of(certain, updates)))
        left = updates - len(parts[0])
        take(self._sweep.take(free & (degree[order] >= LIKELY), self._sweep_share.of(certain, left)))
        left -= len(parts[1])

        rank = priority[order]
        members = np.bincount(rank[free], minlength=CLASSES).tolist()
        quota = quotas(members, left)
        more = quotas([n - q for n, q in zip(members, quota, strict=True)], most - updates)
        spares = []
        for c in reversed(range(CLASSES)):
            if quota[c] + more[c]:
                places = self._turns[c].upcoming(free & (rank == c), quota[c] + more[c])
                if quota[c]:
                    self._turns[c].pass_over(int(places[quota[c] - 1]))
                parts.append(order[places[: quota[c]]])
                spares.append(order[places[quota[c] :]])
        return np.concatenate(parts), np.concatenate([order[:0], *spares])
