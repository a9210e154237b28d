"""Converged maps that are kept: they depend on neither budgets nor policies, and take most of a comparison's time."""

import hashlib
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.oracle import converged_maps
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.scene.pose import scene_at, state_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.sim.toolchain import locked


class KeptReference:
    """A `Reference` whose answers are kept in a folder; the same bits, whether they were made now or earlier.

    A frame's maps start from those asked for before. So each answer is kept under a key of the program, the scene, the
    maps, the reference's own options and all that was asked for up to it; where one is missing, all that was asked for
    before it is computed again.
    """

    def __init__(self, reference: Reference, folder: Path):
        self.reference, self.folder = reference, folder
        self._asked: list[tuple[int, np.ndarray | None]] = []
        self._computed = 0  # of those asked for, in order
        options = (reference.sampling, reference.coarse, reference.seed, reference.fraction)
        self._chain = _key(reference.scene, reference.lightmaps, str(options))

    def published(self, frame: int, precise: np.ndarray | None = None) -> np.ndarray:
        """As `Reference.published`."""
        self._asked.append((frame, precise))
        self._chain = self._next(frame, precise)
        file = self.folder / f"{self._chain}.npy"
        with locked(file):  # parallel cases make it once
            if not file.exists():
                made = self._compute()
                with whole_file(file) as part, part.open("wb") as opened:
                    np.save(opened, made)
            return np.asarray(np.load(file))

    def _next(self, frame: int, precise: np.ndarray | None) -> str:
        digest = hashlib.sha256(self._chain.encode())
        for part in state_of(scene_at(self.reference.scene, frame)):
            digest.update(part)
        digest.update(b"all" if precise is None else precise.astype(np.int64).tobytes())
        return digest.hexdigest()[:32]

    def _compute(self) -> np.ndarray:
        for frame, precise in self._asked[self._computed :]:
            found = self.reference.published(frame, precise)
        self._computed = len(self._asked)
        return found


def _key(scene: Scene, lightmaps: Lightmaps, options: str) -> str:
    """Of all that converged maps depend on but the frames asked for."""
    digest = hashlib.sha256(f"{fingerprint(converged_maps.__name__)} {options} {scene.texel_size}\n".encode())
    arrays = (
        *(scene.triangles, scene.normals, scene.object_id, scene.material, scene.albedo, scene.emission),
        *(scene.surface, scene.ior, scene.texture, scene.texture_uv, scene.point_lights, *scene.textures),
        *(scene.emission_texture, scene.two_sided, scene.cones, *scene.environment.arrays),
        *(lightmaps.texels, lightmaps.chart, lightmaps.fill, lightmaps.uv),
        *(lightmaps.offset, lightmaps.width, lightmaps.height),
    )
    for array in arrays:
        digest.update(f"{array.shape} {array.dtype}\n".encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
