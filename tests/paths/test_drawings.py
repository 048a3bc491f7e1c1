"""Drawings read from images and text; what is hostile or damaged is refused in a sentence."""

from __future__ import annotations

import builtins
import struct
import sys
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from rds.core.errors import InputError
from rds.nc.paths.drawing import MOST_CELLS, parse_text_drawing, read_drawing

BLOB = np.zeros((12, 15))
BLOB[3:9, 4:11] = 1.0  # dark
BYTES = (255 * (1 - BLOB)).astype(np.uint8)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, data: bytes, extra: bytes = b"") -> bytes:
    """A grey PNG that claims to be that large."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + extra + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def saved(image: Image.Image, **options: Any) -> bytes:
    stream = BytesIO()
    image.save(stream, **options)
    return stream.getvalue()


GREY = Image.fromarray(BYTES)
CLEAR = Image.new("RGBA", (15, 12), (0, 0, 0, 0))
CLEAR.paste((0, 0, 0, 255), (4, 3, 11, 9))
PALETTE = Image.fromarray(BLOB.astype(np.uint8), mode="P")
PALETTE.putpalette([255, 255, 255, 0, 0, 0])


@pytest.mark.parametrize(
    "name, content",
    [
        ("grey.png", saved(GREY, format="PNG")),
        ("colour.png", saved(GREY.convert("RGB"), format="PNG")),
        ("one-bit.png", saved(GREY.convert("1"), format="PNG")),
        ("16-bit.png", saved(Image.fromarray(BYTES.astype(np.uint16) * 257), format="PNG")),
        ("16-bit.pgm", saved(Image.fromarray(BYTES.astype(np.uint16) * 257), format="PPM")),
        ("transparent.png", saved(CLEAR, format="PNG")),
        ("palette.png", saved(PALETTE, format="PNG")),
        ("palette with a colour that is clear.png", saved(PALETTE, format="PNG", transparency=0)),
        ("grey.pgm", saved(GREY, format="PPM")),
        ("plain.pgm", f"P2 15 12 255 {' '.join(map(str, BYTES.ravel()))}".encode()),
        ("bits.pbm", saved(GREY.convert("1"), format="PPM")),
        ("colour.ppm", saved(GREY.convert("RGB"), format="PPM")),
        ("UPPER.PNG", saved(GREY, format="PNG")),
        ("text.txt", "\n".join("".join(".#"[int(v)] for v in row) for row in BLOB).encode()),
        ("blanks at the ends.txt", b"\n\n\n" + b"    #######\r\n" * 6 + b"..............." + b"\n.." * 2 + b"\n \n"),
    ],
)
def test_a_drawing_is_the_same_from_any_file(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    darkness = read_drawing(tmp_path / name)
    rows, columns = darkness.shape
    assert np.allclose(darkness, BLOB[:rows, :columns], atol=1e-4)
    assert rows >= 10 and columns == 15


def test_greys_and_photographs(tmp_path: Path) -> None:
    (tmp_path / "ramp.png").write_bytes(saved(Image.fromarray(np.arange(256, dtype=np.uint8)[None, :]), format="PNG"))
    assert np.array_equal(read_drawing(tmp_path / "ramp.png"), 1 - np.arange(256)[None, :] / 255)
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was held upright: turn it by 90°
    (tmp_path / "photo.jpg").write_bytes(saved(GREY, format="JPEG", quality=100, exif=exif))
    assert np.allclose(read_drawing(tmp_path / "photo.jpg"), np.rot90(BLOB, -1), atol=0.02)
    (tmp_path / "print.jpg").write_bytes(saved(GREY.convert("CMYK"), format="JPEG", quality=100))
    assert np.allclose(read_drawing(tmp_path / "print.jpg"), BLOB, atol=0.1)


WHOLE = {kind: saved(GREY, format=kind) for kind in ("PNG", "JPEG", "PPM")}
ANIMATION = saved(GREY, format="PNG", save_all=True, append_images=[Image.fromarray(255 - BYTES)])


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("huge.png", png(60000, 60000, bytes(1000)), f"has far more than the {MOST_CELLS} pixels"),
        ("large.png", png(5000, 4000, bytes(1000)), "has 5000 × 4000 pixels; at most"),
        ("huge.pgm", b"P5 99999999 99999999 255\n", "pixels"),
        ("empty of pixels.png", png(4000, 4000, bytes(100)), "is damaged"),
        ("text bomb.png", png(15, 12, b"", chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(50_000_000)))), "is damaged"),
        ("no width.png", png(0, 12, b""), "no image"),
        ("half.png", WHOLE["PNG"][: len(WHOLE["PNG"]) * 2 // 3], "is damaged"),
        ("half.jpg", WHOLE["JPEG"][: len(WHOLE["JPEG"]) // 2], "is damaged"),
        ("half.pgm", WHOLE["PPM"][:60], "is damaged"),
        ("empty.png", b"", "is no image that can be read"),
        ("noise.jpg", bytes(range(256)) * 20, "is no image that can be read"),
        ("other.jpg", WHOLE["PNG"], "is PNG by its contents, not JPEG"),
        ("bitmap.png", saved(GREY, format="BMP"), "is no image that can be read"),
        ("film.png", ANIMATION, "is an animation of 2 images"),
        ("float.pnm", b"Pf\n15 12\n-1.0\n" + bytes(15 * 12 * 4), "floating-point numbers without a white"),
        ("drawing.gif", b"", ".gif is no kind of drawing; known: .png"),
        ("drawing", b"", "a name without an ending is no kind of drawing"),
        ("empty.txt", b"", "is empty; draw with # for filled"),
        ("blank.txt", b"\n \n", "is empty"),
        ("letters.txt", b"...\n.X.\n", ":2: 'X' in column 2 is neither # (filled) nor . or blank (empty)"),
        ("tabs.txt", b"...\n\t#\n", ":2: '\\t' in column 1"),
        ("image.txt", WHOLE["JPEG"], "is not text"),
        ("long.txt", b"#" * 5000 + b"\n" * 4000 + b"#", "has 4001 × 5000 cells; at most"),
    ],
)
def test_hostile_and_damaged_drawings_are_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_drawing(tmp_path / name)
    assert words in str(refusal.value), str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / name))


def test_places_that_cannot_be_read_are_told(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "folder.txt").mkdir()
    for name in ("none.png", "none.txt", "folder.png", "folder.txt"):
        with pytest.raises(InputError, match="cannot be read"):
            read_drawing(tmp_path / name)


@settings(max_examples=150)
@given(
    st.sampled_from(sorted(WHOLE)),
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), max_size=8),
    st.none() | st.integers(0, 2000),
)
def test_no_damage_crashes_the_reader(
    tmp_path_factory: pytest.TempPathFactory, kind: str, damage: list[tuple[int, int]], end: int | None
) -> None:
    content = bytearray(WHOLE[kind])
    for at, value in damage:
        content[at % len(content)] = value
    file = tmp_path_factory.getbasetemp() / {"PNG": "any.png", "JPEG": "any.jpg", "PPM": "any.pgm"}[kind]
    file.write_bytes(content[:end])
    try:
        darkness = read_drawing(file)
    except InputError as error:
        assert str(file) in str(error)
    else:
        assert darkness.ndim == 2 and 0 <= darkness.min() <= darkness.max() <= 1


def test_without_the_extra_the_command_that_installs_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.png").write_bytes(WHOLE["PNG"])
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] in ("PIL", "shapely", "skimage"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *rest)

    from rds.nc.paths import needs, outline

    monkeypatch.setattr(needs, "import_module", missing)
    with pytest.raises(InputError, match=r"needs pillow, which is not installed; install it with: "):
        read_drawing(tmp_path / "a.png")
    with pytest.raises(InputError, match="needs scikit-image"):
        outline(parse_text_drawing("....\n.##.\n.##.\n...."), 1.0, 5.0)
    assert "PIL" in sys.modules  # the test's own
