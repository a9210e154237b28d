"""What the engine cannot do is refused before it is asked."""

from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.lights import light_count
from lightloom.golden_model.scene.scene import Scene


def require_affordable(sampling: Sampling, budget: int, scene: Scene) -> None:
    """Raises InputError for a budget of rays a frame that does not pay for one update, and for too many lights."""
    reserve = sampling.reserve(scene.specular)
    if budget < reserve:
        raise InputError(f"--budget {budget}: one texel update takes {reserve} rays; give at least as many")
    if (count := light_count(scene)) > sampling.lights:
        raise InputError(
            f"{scene.name}: {count} lights, of which each triangle that shines is one; at most {sampling.lights} are "
            "possible: make what shines of fewer triangles"
        )
