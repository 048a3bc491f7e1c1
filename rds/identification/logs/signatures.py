"""Files that are not what their names say, known by their first bytes, and what to do with each."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

_START = 512  # bytes
_BLOCK = 1 << 20
_ANY = (  # whatever the ending
    (
        re.compile(rb"version https://git-lfs\.github\.com/spec/"),
        "it is a pointer of Git LFS, and the data are elsewhere: type `git lfs pull` in its repository, or download "
        "the file from the repository's page",
    ),
    (
        re.compile(rb"\s*<(!doctype html|html)\b", re.IGNORECASE),
        "it is a web page, and no data: download the file itself (on GitHub by Raw)",
    ),
)
_TEXT = (  # where the ending is one of text
    (re.compile(rb"\x1f\x8b"), "it is packed by gzip: unpack it, as by `gunzip -c FILE > log.csv`"),
    (
        re.compile(rb"PK\x03\x04"),
        "it is a zip, as spreadsheets (.xlsx) are, too: unpack it, or save the sheet with the samples as CSV (UTF-8)",
    ),
    (re.compile(rb"PAR1[\0-\x08\x0e-\x1f]"), "it is Parquet: let its name end in .parquet"),
    (re.compile(rb"\x89HDF"), "it is HDF5: save time, command and position as columns of CSV"),
    (
        re.compile(rb"TDSm.\0", re.DOTALL),
        "it is NI's TDMS: let its name end in .tdms, and `rds` says which export is read",
    ),
)
_OSCILLOSCOPE = re.compile(rb"(#9\d{9})?WAVEDESC")  # LeCroy's, whose files end in .trc as those of CAN tools do
_OCTAVE = b"# Created by Octave"
_OCTAVE_NAME = re.compile(rb"(?m)^# name: ")


def what_it_is(path: Path, ending: str, texts: Sequence[str]) -> str:
    """What a file of this ending is in truth, with what to do; "" where nothing speaks against its name."""
    with open(path, "rb") as stream:
        start = stream.read(_START)
    kinds = _ANY + (_TEXT if ending in texts else ())
    told = next((what for sign, what in kinds if sign.match(start)), "")
    if ending == ".trc" and _OSCILLOSCOPE.match(start):
        return "it is a waveform of an oscilloscope: save its channels as CSV there"
    if start.startswith(_OCTAVE) and (ending == ".mat" or (ending in texts and _has_names(path, 2))):
        return "it is Octave's own text, one variable after another: save it in Octave by `save -v7 log.mat t u y`"
    return told


def unpacked_start(path: Path) -> bytes:
    """The first bytes that a gzip file holds; none where it is damaged, or is no such file."""
    try:
        with gzip.open(path) as stream:
            return stream.read(_START)
    except (OSError, EOFError, zlib.error):
        return b""


def _has_names(path: Path, least: int) -> bool:
    """Whether a text of Octave's holds so many variables."""
    found, rest = 0, b""
    with open(path, "rb") as stream:
        while block := stream.read(_BLOCK):
            whole, mark, rest = (rest + block).rpartition(b"\n")
            found += len(_OCTAVE_NAME.findall(whole + mark))
            if found >= least:
                return True
    return found + len(_OCTAVE_NAME.findall(rest)) >= least
