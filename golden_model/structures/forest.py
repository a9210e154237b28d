"""Trees of the bodies of a scene, and the one tree that they are joined into under a tree over their boxes."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.bvh.build import Bvh, build, refit


@dataclass(frozen=True, kw_only=True)
class ForestOptions:
    """How trees follow a moving scene."""

    rebuild_factor: float = 1.5
    """A refitted tree is built anew when its surface area cost exceeds this many times that when built; 1 or more."""
    demand: bool = False
    """Whether the detail of an object waits for the first ray that enters its box ([0062])."""

    def __post_init__(self) -> None:
        if not self.rebuild_factor >= 1:
            raise InputError(f"rebuild_factor {self.rebuild_factor}: must be 1 or more")


@dataclass(kw_only=True)
class Figures:
    """What the trees of one frame have cost so far, in bodies unless it says otherwise."""

    kept: int = 0
    """They have not moved since their tree was made."""
    refitted: int = 0
    """Their trees got new boxes; those that were built anew after that included."""
    built: int = 0
    """Their trees were built for the first time."""
    rebuilt: int = 0
    """Their trees were built anew, because refitting had made them poor."""
    waiting: int = 0
    """They have moved or are new, and no ray has asked for their detail."""
    absent: int = 0
    """They are not there in this frame."""
    demanded: int = 0
    """Of the refitted and the built ones: because a ray asked."""
    refitted_triangles: int = 0
    """Triangles of the refitted trees."""
    built_triangles: int = 0
    """Triangles of the trees that were built, for the first time or anew."""


class _Body:
    """Objects that do not move against each other, or a single one."""

    def __init__(self, scene: Scene, objects: list[int]):
        self.objects = objects
        self.members = np.flatnonzero(np.isin(scene.object_id, objects))
        """Numbers of its triangles in the scene, (F,) int64, rising."""
        self.tree: Bvh | None = None
        """Over its triangles where they were when it was made."""
        self.place = b""
        """Where that was; the same bytes mean the same place."""
        self.cost = 0.0
        """Surface area cost of the tree when it was built."""
        self.box = np.zeros((2, 3), dtype=np.float32)
        """Least and greatest coordinates in this frame."""
        self.ready = False
        """Whether the tree is that of this frame."""

    def place_in(self, scene: Scene) -> bytes:
        """Where the body is in a frame."""
        return b"".join(scene.rotation[k].tobytes() + scene.translation[k].tobytes() for k in self.objects)


class Forest:
    """The trees of a scene's bodies, followed from frame to frame.

    A tree is that of a body (`Scene.bodies`): so all objects that never move share one, which is better than one for
    each. With `demand` it is that of an object.
    """

    def __init__(self, scene: Scene, options: ForestOptions):
        self.options = options
        self._rest = scene if scene.rest is None else scene.rest
        groups = [[k] for k in range(len(scene.object_names))] if options.demand else scene.bodies
        bodies = [_Body(scene, objects) for objects in groups]
        self._bodies = [body for body in bodies if len(body.members)]
        self._joined: list[Bvh] = []
        self.joined = join([], [], scene.triangles)
        """The tree over all bodies that have their detail."""
        self.update(scene)

    def update(self, scene: Scene) -> None:
        """Follows the scene to another of its frames: the boxes of its bodies, and without `demand` their trees."""
        if (scene if scene.rest is None else scene.rest) is not self._rest:
            raise ValueError("a structure follows the frames of one scene; make another one for another scene")
        self._scene = scene
        self.figures = Figures()
        self.waiting: list[int] = []
        """Bodies without detail yet."""
        self._here = [n for n, body in enumerate(self._bodies) if scene.present[body.objects].all()]
        self.figures.absent = len(self._bodies) - len(self._here)
        for number in self._here:
            body = self._bodies[number]
            body.ready = body.tree is not None and body.place == body.place_in(scene)
            if body.tree is not None and body.ready:
                # Its box may be that of a frame in between, in which no ray asked for it.
                body.box = np.stack([body.tree.lower[0], body.tree.upper[0]])
                self.figures.kept += 1
            else:
                triangles = scene.triangles.take(body.members)
                corners = np.stack([triangles[name] for name in TRIANGLE.names or ()])
                body.box = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
                self.waiting.append(number)
        if self.options.demand:
            self.figures.waiting = len(self.waiting)
            self._join()
        else:
            self._detail(self.waiting)

    def demand(self, numbers: Iterable[int]) -> None:
        """Makes the detail of waiting bodies because rays have entered their boxes."""
        chosen = list(numbers)
        self.figures.demanded += len(chosen)
        self.figures.waiting -= len(chosen)
        self._detail(chosen)

    def boxes(self) -> np.ndarray:
        """Least and greatest coordinates of the bodies that wait, (W, 2, 3) float32."""
        return np.array([self._bodies[number].box for number in self.waiting], dtype=np.float32).reshape(-1, 2, 3)

    def bounds(self) -> np.ndarray:
        """Least and greatest coordinates of all bodies of the frame, waiting or not, (2, 3) float32; zero without."""
        boxes = np.array([self._bodies[number].box for number in self._here], dtype=np.float32).reshape(-1, 2, 3)
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]) if len(boxes) else np.zeros((2, 3), "f4")

    def _detail(self, numbers: Iterable[int]) -> None:
        for number in list(numbers):
            self._follow(self._bodies[number])
            self.waiting.remove(number)
        self._join()

    def _follow(self, body: _Body) -> None:
        """Makes the body's tree that of this frame."""
        triangles = self._scene.triangles.take(body.members)
        if body.tree is None:
            body.tree = build(triangles)
            body.cost = body.tree.sah_cost
            self.figures.built += 1
            self.figures.built_triangles += len(triangles)
        else:
            body.tree = refit(body.tree, triangles)
            self.figures.refitted += 1
            self.figures.refitted_triangles += len(triangles)
            if body.tree.sah_cost > self.options.rebuild_factor * body.cost:
                body.tree = build(triangles)
                body.cost = body.tree.sah_cost
                self.figures.rebuilt += 1
                self.figures.built_triangles += len(triangles)
        body.place = body.place_in(self._scene)
        body.ready = True

    def _join(self) -> None:
        """Renews `joined`, unless it is over the same trees already."""
        ready = [self._bodies[number] for number in self._here if self._bodies[number].ready]
        trees = [body.tree for body in ready if body.tree is not None]
        if trees != self._joined:
            self._joined = trees
            self.joined = join(trees, [body.members for body in ready], self._scene.triangles)


def join(trees: list[Bvh], members: list[np.ndarray], triangles: np.ndarray) -> Bvh:
    """Trees over parts of TRIANGLE (T,) to one Bvh; `members[k]` are the numbers of tree k's triangles, (F,).

    The upper levels are a tree over the boxes of the trees; each of its leaves is replaced by the root of one. No tree
    may be empty. `depth` is that of the upper levels and the deepest tree together: no less than the true one.
    """
    top = build(_as_triangles(trees), leaf_size=1)
    leaves = np.flatnonzero(top.count)
    root = np.zeros(len(trees), dtype=np.int64)
    root[top.primitive[top.first[leaves]]] = leaves
    nodes = np.array([len(tree.count) - 1 for tree in trees], dtype=np.int64)  # without the root
    slots = np.array([len(tree.primitive) for tree in trees], dtype=np.int64)
    node_base = len(top.count) + np.cumsum(nodes) - nodes
    slot_base = np.cumsum(slots) - slots

    first, count = top.first.copy(), top.count.copy()
    shifted = [
        np.where(tree.count > 0, tree.first + np.int32(slot), tree.first + np.int32(node - 1))
        for tree, node, slot in zip(trees, node_base, slot_base, strict=True)
    ]
    for tree, at, moved in zip(trees, root, shifted, strict=True):
        first[at], count[at] = moved[0], tree.count[0]
    return Bvh(
        lower=np.concatenate([top.lower, *(tree.lower[1:] for tree in trees)]),
        upper=np.concatenate([top.upper, *(tree.upper[1:] for tree in trees)]),
        first=np.concatenate([first, *(moved[1:] for moved in shifted)]),
        count=np.concatenate([count, *(tree.count[1:] for tree in trees)]),
        primitive=np.concatenate(
            [np.zeros(0, dtype=np.int32), *(own[tree.primitive] for own, tree in zip(members, trees, strict=True))]
        ).astype(np.int32),
        triangles=triangles,
        depth=top.depth + max([tree.depth for tree in trees], default=0),
    )


def _as_triangles(trees: list[Bvh]) -> np.ndarray:
    """TRIANGLE (B,) with the boxes of the trees for their bounding boxes."""
    out = np.zeros(len(trees), dtype=TRIANGLE)
    for row, tree in zip(out, trees, strict=True):
        row["v0"], row["v1"], row["v2"] = tree.lower[0], tree.upper[0], tree.lower[0]
    return out
