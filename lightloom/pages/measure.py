"""Measures everything that docs/results.md shows, in parts, into build/results:

python -m lightloom.pages.measure --pdk-root DIR [PART…]
python -m lightloom.pages.results build/results/*.json

A part is one command. What the commands make is kept, so that a second run does only what is new; a part that fails is
said, and the others go on.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from lightloom.bench.traversal import DRAGON
from lightloom.bench.tree import BUNNY
from lightloom.gen.flow import tools
from lightloom.golden_model.contract.interfaces import PURE, UNITS
from lightloom.golden_model.host.outputs import whole_file

FOLDER = Path("build/results")
SCENES = [word for scene in ("cornell-box", str(BUNNY), str(DRAGON)) for word in ("--scene", scene)]
MACROS = "RM_IHPSG13_1P_*_typ_1p20V_25C.lib"
"""Memory macros of IHP SG13G2; ASAP7 has none."""


def parts(root: Path) -> dict[str, list[str]]:
    """Name of each part and the arguments of its command; what takes longest last."""
    ihp, asap7 = (["--pdk", name, "--pdk-root", str(root)] for name in ("ihp-sg13g2", "asap7"))
    presets = ["--preset", "tiny", "--preset", "base", "--preset", "full"]
    libraries = {
        "ihp-slow-base": [*ihp, "--corner", "slow", "--preset", "base"],
        "ihp-typ-full": [*ihp, "--preset", "full"],
        "asap7-full": [*asap7, "--preset", "full"],
    }
    units = list(PURE)
    macros = [word for path in sorted(root.rglob(MACROS)) for word in ("--macros", str(path))]
    named = {
        "proofs": ["prove"],
        "mutations": ["prove", "--mutations"],
        "coverage": ["coverage"],
        "cycles": ["bench", "traversal", *SCENES, "--rays", "16000", "--latency", "0,100,200,400"],
        "units": ["bench", "traversal", "--rays", "16000", "--latency", "100", "--units", "1,4"],
    }
    named |= {f"synth-{name}": ["synth", *units, *options] for name, options in libraries.items()}
    named |= {"synth-check": ["synth", *units, *libraries["ihp-slow-base"], "--check"]}
    named |= {"gates": ["synth", *units, *presets]}
    systems = [unit for unit in UNITS if unit not in PURE]
    named |= {"fpga": ["fpga", *systems, "--speed", "8"]}
    for name, options in libraries.items():
        tiled = macros if name.startswith("ihp") else []
        named |= {f"synth-{name}-{unit}": ["synth", unit, *options, *tiled] for unit in systems}
    return named | {f"gates-{unit}": ["synth", unit, "--preset", "base"] for unit in systems}


def run(name: str, arguments: Sequence[str]) -> bool:
    """Runs one part; False where it failed."""
    print(f"{name}: lightloom {' '.join(arguments)}", file=sys.stderr, flush=True)
    done = subprocess.run([tools.require("lightloom"), *arguments, "--json"], stdout=subprocess.PIPE)
    if done.returncode not in (0, 1):
        print(f"{name}: failed with code {done.returncode}", file=sys.stderr, flush=True)
        return False
    with whole_file(FOLDER / f"{name}.json") as part:
        part.write_bytes(done.stdout)
    return True


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pdk-root", type=Path, required=True, help="the folder that holds both PDKs")
    parser.add_argument("parts", nargs="*", help="all if none is given")
    arguments = parser.parse_args()
    known = parts(arguments.pdk_root)
    wrong = [name for name in arguments.parts if name not in known]
    if wrong:
        parser.error(f"no part {', '.join(wrong)}; there are {', '.join(known)}")
    failed = [name for name in arguments.parts or known if not run(name, known[name])]
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
