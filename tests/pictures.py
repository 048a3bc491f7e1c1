"""The documents' pictures: drawn by what the documents themselves say, and kept in docs/pictures.

`make pictures` draws all afresh; tests compare what is kept with what the code draws now.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from documents import ROOT, blocks, save

COMMAND = "make pictures"
WIDTH = 960  # pixels
COLOURS = 64


def first_sine(folder: Path) -> Path:
    """The README's files and its command."""
    save(blocks("README.md"), folder)
    _rds(folder, "run", "first.toml", "--out", "first")
    return folder / "first" / "X.png"


def plate_path(folder: Path) -> Path:
    """The path of the plate in docs/from-drawing-to-part.md."""
    _plate(folder)
    _rds(folder, "nc", "plot", "plate.ngc", "--tools", "cutters.toml")
    return folder / "plate-path.png"


def plate_cut(folder: Path) -> Path:
    """The plate, cut."""
    _plate(folder)
    _rds(folder, "nc", "cut", "plate.ngc", "--tools", "cutters.toml", "--cell", "0.05", "--save", "plate.npz")
    return folder / "plate-cut.png"


def plate_left(folder: Path) -> Path:
    """The plate as measured, and what differs from the one that was meant."""
    plate_cut(folder)
    _rds(folder, "nc", "run", "plate.ngc", "--tools", "cutters.toml", "--out", "measured")
    measured = ("--part", "plate.npz", "--measured", "measured")
    _rds(
        folder, "nc", "cut", "plate.ngc", "--tools", "cutters.toml", "--cell", "0.05", *measured, code=1
    )  # not to 0.02 mm
    return folder / "plate-cut.png"


def circular_test(folder: Path) -> Path:
    """The circular test in docs/part-programs.md."""
    _rds(folder, "nc", "bundled", "circular_test")
    _rds(folder, "nc", "run", "circular_test.ngc", "--controller", "pid", "--out", "pid")
    _rds(folder, "report", "circular", "pid", "--out", "circles")
    return folder / "circles" / "circular-circle-pid.png"


def _plate(folder: Path) -> None:
    save(blocks("docs/from-drawing-to-part.md"), folder)
    _rds(folder, "nc", "make", "job", "plate.toml", "--out", "plate.ngc")


PICTURES: dict[str, Callable[[Path], Path]] = {
    "first-sine": first_sine,
    "plate-path": plate_path,
    "plate-cut": plate_cut,
    "plate-left": plate_left,
    "circular-test": circular_test,
}


def path(name: str) -> Path:
    """Where a picture is kept."""
    return ROOT / "docs" / "pictures" / f"{name}.png"


def drawn(name: str) -> Any:
    """A picture as the code draws it now, small: its width, and a palette of a few colours."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        full = Image.open(PICTURES[name](Path(folder))).convert("RGB")
    small = full.resize((WIDTH, round(full.height * WIDTH / full.width)), Image.Resampling.LANCZOS)
    return small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


def kept_and_drawn(name: str) -> tuple[Any, Any]:
    """A picture as it is kept, and as the code draws it now."""
    from PIL import Image

    return Image.open(path(name)), drawn(name)


def _rds(folder: Path, *words: str, code: int = 0) -> None:
    done = subprocess.run([sys.executable, "-m", "rds", *words], cwd=folder, stdout=subprocess.DEVNULL)
    assert done.returncode == code, words


if __name__ == "__main__":
    for name in PICTURES:
        drawn(name).save(path(name), optimize=True)
        print(os.path.relpath(path(name)))
