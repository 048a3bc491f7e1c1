"""Drawings as arrays of darkness: images, and text with # for a filled cell."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.nc.paths.needs import needed

MOST_CELLS = 16_000_000  # a 4000 × 4000 image: traced in seconds, in some hundred MB
_FORMATS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".pgm": "PPM", ".pbm": "PPM", ".ppm": "PPM", ".pnm": "PPM"}
_TEXT = (".txt", ".text", ".grid")
FILLED, EMPTY = "#", ". "
_SIXTEEN_BITS = ("I", "I;16", "I;16B", "I;16L")


def read_drawing(file: str | PathLike[str]) -> np.ndarray:
    """The darkness of a drawing, shape (rows, columns), from 0 (white, empty) to 1 (black, filled); first row on top.

    By the ending of the file's name: PNG, JPEG, PGM (PBM, PPM) images, or a text drawing (.txt). InputError names the
    file and says what is wrong with it: not such a file, damaged, empty, or larger than 16 million cells.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if ending in _FORMATS:
        return read_image(path)
    if ending in _TEXT:
        return read_text_drawing(path).astype(float)
    known = ", ".join([*_FORMATS, _TEXT[0]])
    raise InputError(f"{ending or 'a name without an ending'} is no kind of drawing; known: {known}", str(path))


def parse_text_drawing(text: str, name: str = "drawing") -> np.ndarray:
    """The cells of a text drawing, boolean, shape (rows, columns): # is filled, . and blank are empty.

    Lines that are shorter than the longest end in empty cells. InputError names line and column of another character.
    """
    lines = [line.rstrip() for line in text.split("\n")]
    while lines and not lines[-1]:
        lines.pop()
    if not lines:
        raise InputError(f"is empty; draw with {FILLED} for filled and . for empty cells", name)
    columns = max(map(len, lines))
    if columns * len(lines) > MOST_CELLS:
        raise InputError(f"has {len(lines)} × {columns} cells; at most {MOST_CELLS} are traced", name)
    cells = np.zeros((len(lines), columns), dtype=bool)
    for row, line in enumerate(lines):
        for column, character in enumerate(line):
            if character == FILLED:
                cells[row, column] = True
            elif character not in EMPTY:
                raise InputError(
                    f"{character!r} in column {column + 1} is neither {FILLED} (filled) nor . or blank (empty)",
                    f"{name}:{row + 1}",
                )
    return cells


def read_text_drawing(path: Path) -> np.ndarray:
    """The cells of a text drawing in a file; see `parse_text_drawing`."""
    try:
        with open(path, encoding="utf-8-sig") as stream:
            text = stream.read(MOST_CELLS + 1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}; name a drawing", str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("is not text; an image's name ends in .png, .jpg or .pgm", str(path)) from error
    if len(text) > MOST_CELLS:
        raise InputError(f"has more than {MOST_CELLS} characters; that is no drawing to trace", str(path))
    return parse_text_drawing(text, str(path))


def read_image(path: Path) -> np.ndarray:
    """The darkness of a PNG, JPEG or PGM image, shape (rows, columns), 0 to 1; what is transparent is white.

    Colours count by their luma (ITU-R 601-2). The size is judged by the header, before anything is decoded.
    """
    image_module = needed("PIL.Image")
    expected = _FORMATS[path.suffix.lower()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", image_module.DecompressionBombWarning)  # our own limit is below Pillow's
        try:
            with image_module.open(path, formats=sorted(set(_FORMATS.values()))) as image:
                _check_header(image, expected, path)
                return _darkness(image, path)
        except (InputError, MemoryError):
            raise
        except image_module.DecompressionBombError as error:
            raise InputError(
                f"has far more than the {MOST_CELLS} pixels that are traced; scale it down", str(path)
            ) from error
        except image_module.UnidentifiedImageError as error:
            raise InputError(f"is no image that can be read ({', '.join(sorted(_FORMATS))})", str(path)) from error
        except (FileNotFoundError, PermissionError, IsADirectoryError) as error:
            raise InputError(f"cannot be read: {error.strerror or error}; name a drawing", str(path)) from error
        except Exception as error:  # whatever a decoder says of a damaged or hostile file
            raise InputError(f"is damaged: {error or type(error).__name__}; save it again", str(path)) from error


def _check_header(image: Any, expected: str, path: Path) -> None:
    width, height = image.size
    if width * height > MOST_CELLS:
        raise InputError(
            f"has {width} × {height} pixels; at most {MOST_CELLS} are traced: scale it down (a pixel of a tenth of "
            "the tool's diameter is plenty)",
            str(path),
        )
    if image.format != expected:
        raise InputError(f"is {image.format} by its contents, not {expected}; give it the right ending", str(path))
    if getattr(image, "n_frames", 1) > 1:
        raise InputError(f"is an animation of {image.n_frames} images; save the one to trace", str(path))


def _darkness(image: Any, path: Path) -> np.ndarray:
    if image.mode == "F":
        raise InputError("holds floating-point numbers without a white; save it with 8 or 16 bits", str(path))
    image.load()
    upright = needed("PIL.ImageOps").exif_transpose(image)
    if upright.mode in _SIXTEEN_BITS:
        return 1.0 - np.asarray(upright, dtype=float) / 65535.0
    opacity: np.ndarray | float = 1.0
    if upright.has_transparency_data:
        upright = upright.convert("RGBA")
        opacity = np.asarray(upright.getchannel("A"), dtype=float) / 255.0
    elif upright.mode not in ("1", "L"):
        upright = upright.convert("RGB")  # not all modes have a way to grey of their own
    return opacity * (1.0 - np.asarray(upright.convert("L"), dtype=float) / 255.0)
