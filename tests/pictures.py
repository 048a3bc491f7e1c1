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


PICTURES: dict[str, Callable[[Path], Path]] = {"first-sine": first_sine}


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


def _rds(folder: Path, *words: str) -> None:
    subprocess.run([sys.executable, "-m", "rds", *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    for name in PICTURES:
        drawn(name).save(path(name), optimize=True)
        print(os.path.relpath(path(name)))
