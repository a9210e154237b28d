"""What the HTML pages share: one file each, without scripts or links to elsewhere, pictures inside it."""

import base64
import io
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image

from lightloom.gen.pages.plots import short

TEMPLATES = Path(__file__).parent.with_name("templates")
TYPES = {".png": "image/png", ".webp": "image/webp"}


def environment() -> Environment:
    """Where pages' templates come from: escaped, nothing undefined, with filters for numbers and times."""
    found = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters.update(count=lambda value: f"{value:,}", short=short, seconds=seconds)
    return found


def seconds(value: float) -> str:
    """12.3 s, 2 min 05 s."""
    if value < 0.1:
        return f"{1000 * value:.0f} ms"
    return f"{value:.1f} s" if value < 100 else f"{int(value // 60)} min {int(value % 60):02} s"


def data_uri(path: Path) -> str:
    """A file as a data URI."""
    return f"data:{TYPES[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode()}"


def webp(path: Path) -> str:
    """A picture as a data URI, packed so that the page stays small."""
    packed = io.BytesIO()
    with Image.open(path) as image:
        image.save(packed, format="WEBP", quality=90, method=4)
    return f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"
