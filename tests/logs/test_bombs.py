"""Small files that unpack to much: refused with what, value, limit and how it is lifted, in little memory."""

from __future__ import annotations

import gzip
import json
import sqlite3
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from rds.bus.tools import log_lines
from rds.bus.tools.logs import LogFile
from rds.core import limits
from rds.core.errors import InputError
from rds.identification.logs.tables import read_table
from rds.nc.language.parameters import read_parameters
from rds.nc.language.tools import read_tools
from rds.results import open_result

MOST_MEMORY = 1200  # MB of a process that refuses, of which libraries take a third


def mat_element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def mat_head() -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def zlib_of(head: bytes, megabytes: int) -> bytes:
    """A stream of `head` and so many zeros. It has no end, which nobody who stops at a limit comes to."""
    pack = zlib.compressobj(9)
    first = pack.compress(head) + pack.flush(zlib.Z_FULL_FLUSH)
    block = pack.compress(bytes(16 << 20)) + pack.flush(zlib.Z_FULL_FLUSH)  # it refers to nothing before it
    return first + block * (megabytes // 16)


def mat_zlib(path: Path) -> None:
    """A vector of 3 GB of zeros, packed a thousand times."""
    size = 3 << 30
    parts = [mat_element(6, struct.pack("<II", 6, 0)), mat_element(5, struct.pack("<ii", size // 8, 1))]
    parts.append(mat_element(1, b"x" * 8))
    inner = b"".join(parts) + struct.pack("<II", 9, size)
    data = zlib_of(struct.pack("<II", 14, len(inner) + size) + inner, 3072)
    path.write_bytes(mat_head() + mat_element(15, data))


def mat_cell(path: Path) -> None:
    """A struct with a cell that claims two thousand million entries."""
    flags = lambda of: mat_element(6, struct.pack("<II", of, 0))  # noqa: E731
    cell = mat_element(14, flags(1) + mat_element(5, struct.pack("<ii", 2_000_000_000, 1)) + mat_element(1, b""))
    outer = flags(1) + mat_element(5, struct.pack("<ii", 1, 1)) + mat_element(1, b"x") + cell
    path.write_bytes(mat_head() + mat_element(14, outer))


def parquet_rows(path: Path) -> None:
    """Fifty million equal numbers, as one in a dictionary."""
    block = pa.table({name: np.zeros(1 << 22) for name in ("time", "u", "y")})
    with parquet.ParquetWriter(path, block.schema, compression="zstd") as writer:
        for _ in range(4):
            writer.write_table(block)


def line(path: Path) -> None:
    path.write_bytes(b"time,u\n0.0,1.0\n0.1,2.0\n" * 4000)
    with open(path, "r+b") as stream:  # sparse: it takes no place on the disk
        stream.seek(600 << 20)
        stream.write(b"\n")


def bus_line(path: Path) -> None:
    path.write_bytes(gzip.compress(b" " * (16 << 20)) * 40)


def blf(path: Path) -> None:
    packed = zlib_of(b"", 640)
    body = struct.pack("<H6xL4x", 2, 131072) + packed
    head = b"LOGG" + struct.pack("<L", 144) + bytes(136)
    path.write_bytes(head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body)


def mf4(path: Path) -> None:
    packed = zlib_of(b"", 640)
    head = b"MDF     4.10    " + bytes(48) + b"CAN_DataFrame"
    block = struct.pack("<4s4xQQ2sBxIQQ", b"##DZ", 48 + len(packed), 0, b"DT", 0, 0, 600 << 20, len(packed))
    path.write_bytes(head + block + packed)


def view(path: Path) -> None:
    with sqlite3.connect(path) as file:
        file.execute(
            "CREATE VIEW messages AS WITH RECURSIVE c(ts) AS (SELECT 1.0 UNION ALL SELECT ts + 1.0 FROM c) "
            "SELECT ts, 1, 0, 0, 0, 8, x'0000000000000000' FROM c"
        )


BOMBS: dict[str, tuple[Callable[[Path], None], str]] = {
    "zlib.mat": (mat_zlib, "bytes unpack to .* times as many, as files made to do harm do; the limit is 200"),
    "cell.mat": (mat_cell, "takes more memory than it is given|not a MAT file, or is truncated"),
    "rows.parquet": (parquet_rows, "bytes unpack to 402653184, .* as files made to do harm do"),
    "line.csv": (line, "line 12001: it has a line of more than 1048576 bytes; the limit is 1048576"),
    "line.asc.gz": (bus_line, "gz:1: it has a line of more than 65536 characters; the limit is 65536"),
    "container.blf": (blf, "the container holds more than 131072 bytes"),
    "block.mf4": (mf4, "bytes unpack to .* times as many"),
    "view.db": (view, "its frames are computed, by a view or in a column"),
}
READ = """
import re, resource, sys
from pathlib import Path
from rds.core.errors import InputError
from rds.identification.logs.tables import read_table
from rds.results import open_result
read = open_result if sys.argv[2:] else read_table
try:
    read(Path(sys.argv[1]))
except InputError as error:
    print(error)
# not ru_maxrss of this process, which begins with its parent's
own = int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
most = max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
print(most // 1024)
"""


def refused(path: Path, *words: str) -> tuple[str, int]:
    """What a process of its own says of a file, and its memory in MB at most."""
    done = subprocess.run([sys.executable, "-c", READ, path, *words], capture_output=True, text=True, timeout=300)
    assert not done.stderr, done.stderr
    *said, memory = done.stdout.splitlines()
    return "\n".join(said), int(memory)


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_in_little_memory(name: str, tmp_path: Path) -> None:
    make, words = BOMBS[name]
    make(tmp_path / name)
    said, memory = refused(tmp_path / name)
    with pytest.raises(InputError, match=words):
        raise InputError(said)
    assert str(tmp_path / name) in said and memory < MOST_MEMORY


@pytest.mark.parametrize("name", ["zlib.mat", "rows.parquet"])
def test_results_are_read_with_the_same_limits(name: str, tmp_path: Path) -> None:
    make, words = BOMBS[name]
    make(tmp_path / name)
    said, memory = refused(tmp_path / name, "result")
    with pytest.raises(InputError, match=words):
        raise InputError(said)
    assert memory < MOST_MEMORY


def test_a_compressed_bus_log_has_a_limit_on_all_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bus.log.gz"
    path.write_bytes(gzip.compress(b"".join(b"(%d.000000) can0 001#1122334455667788\n" % t for t in range(5000))))
    for module, name, value in ((log_lines, "_FEW", 1000), (limits, "_UNSUSPECTED", 1000), (limits, "PACKED", 3)):
        monkeypatch.setattr(module, name, value)
    with pytest.raises(InputError, match=r"bytes unpack to \d+ or more, \d+ times as many.*RDS_FILE_LIMITS="):
        list(LogFile(path))
    monkeypatch.setenv(limits.LIFT, "100")
    assert len(list(LogFile(path))) == 5000


@pytest.mark.parametrize("ending", ["mat", "parquet"])
def test_the_limit_is_lifted_by_the_factor_that_the_message_says(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"log.{ending}"
    columns = {"time": np.arange(1000) * 1e-3, "u": np.ones(1000)}
    if ending == "mat":
        savemat(path, columns, do_compression=True)
    else:
        parquet.write_table(pa.table(columns), path)
    monkeypatch.setattr(limits, "UNPACKED", 4000)
    with pytest.raises(InputError, match=r"in memory; the limit is 4000: .*RDS_FILE_LIMITS=[345] if you trust"):
        read_table(path)
    monkeypatch.setenv(limits.LIFT, "5")
    assert len(read_table(path).columns["u"].values) == 1000


def test_a_description_beside_a_table_has_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "r.csv").write_text("time [s],X_measured [mm]\n0,1\n1,2\n")
    (tmp_path / "r.json").write_text(json.dumps({"a": "b" * (17 << 20)}))
    with pytest.raises(InputError, match=r"r\.json: it has \d+ bytes, too many for a description"):
        open_result(tmp_path / "r.csv")
    monkeypatch.setenv(limits.LIFT, "2")
    assert len(open_result(tmp_path / "r.csv")) == 2


@pytest.mark.parametrize("read", [read_parameters, read_tools])
def test_files_of_part_programs_have_a_limit(read: Callable[[Path], object], tmp_path: Path) -> None:
    path = tmp_path / "large"
    path.write_bytes(b"\n" * ((4 << 20) + 1))
    with pytest.raises(InputError, match="it has 4194305 bytes, too many for a"):
        read(path)
