"""MAT files of version 7.3: the same numbers as from version 7, and messages for those that would do harm."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.core.parallel import reader_process as apart
from rds.identification.logs import hdf5_mat
from rds.identification.logs.hdf5_mat import parts_here
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import MAP, axis

h5py = pytest.importorskip("h5py")
RUN = MAP.replace('"time"', '"run.time"').replace('"voltage"', '"data_1"').replace('"position"', '"data_2"')


def matlab(path: Path, fill: Callable[[Any], None]) -> Path:
    """A file as MATLAB writes it: HDF5 behind a header of 512 bytes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def put(place: Any, name: str, values: Any, kind: str = "double", **more: Any) -> Any:
    """An array with its axes in reverse, as MATLAB does."""
    made = place.create_dataset(name, data=np.atleast_2d(np.asarray(values)), **more)
    made.attrs["MATLAB_class"] = np.bytes_(kind)
    return made


def filled(file: Any) -> None:
    made = axis()
    run = file.create_group("run")
    run.attrs["MATLAB_class"] = np.bytes_("struct")
    put(run, "time", made["time"], compression="gzip")
    put(file, "data", np.stack([made["voltage"], made["position"]]), compression="gzip")  # 4000 x 2 in MATLAB
    put(file, "gtau", 35.0)
    put(file, "who", np.frombuffer(b"m\0e\0", np.uint16), "char")


def test_vectors_structs_matrices_constants_and_texts(tmp_path: Path) -> None:
    made = axis()
    path = matlab(tmp_path / "log.mat", filled)
    (tmp_path / "log.mat.map.toml").write_text(RUN + 'force_gain = "gtau"\n')
    (log,) = read_log(path)
    assert np.array_equal(log.position, made["position"]) and np.array_equal(log.command, made["voltage"])
    assert np.array_equal(log.time, made["time"]) and log.force_gain == 35.0
    assert [f.what for f in log.findings if f.kind == "columns"] == ["left out, as they hold no real numbers: who"]


def test_a_timetable_is_refused_with_what_to_type(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        put(file, "tt", np.arange(6, dtype=np.uint32), "timetable").attrs["MATLAB_object_decode"] = np.int32(3)

    with pytest.raises(InputError, match=r"tt: of MATLAB's class timetable, .*t = seconds\(tt\.Time - tt\.Time\(1\)\)"):
        read_log(matlab(tmp_path / "log.mat", fill))


def test_without_h5py_the_message_has_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = matlab(tmp_path / "log.mat", filled)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"version 7\.3 \(HDF5\) needs h5py, which is not installed; "):
        read_log(path)


def _loop(file: Any) -> None:
    file.create_group("run")["again"] = file


def _fan(file: Any) -> None:
    """30 groups, each twice in the next: a thousand million paths."""
    below = file.create_group("g0")
    for number in range(1, 30):
        above = file.create_group(f"g{number}")
        above["a"] = above["b"] = below
        below = above


def _huge(file: Any) -> None:
    file.create_dataset("x", shape=(10**12,), dtype="f8", chunks=(10**6,))


def _hollow(file: Any) -> None:
    file.create_dataset("x", shape=(10**7,), dtype="f8", chunks=(10**6,))


def _many(file: Any) -> None:
    for number in range(101):
        file.create_group(f"g{number}")


@pytest.mark.parametrize(
    ("fill", "words"),
    [
        (_loop, "run.again is at two places, holds itself"),
        (_fan, "is at two places"),
        (_huge, r"takes 8e\+12 bytes in memory; the limit is 1073741824: .*RDS_FILE_LIMITS=7451"),
        (_hollow, "claims 10000000 values, and the file holds 0 bytes"),
        (_many, "101 variables at one place"),
    ],
)
def test_what_would_never_end_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fill: Callable[[Any], None], words: str
) -> None:
    monkeypatch.setattr(hdf5_mat, "_MOST_VARIABLES", 100)
    with pytest.raises(InputError, match=words):
        parts_here(matlab(tmp_path / "log.mat", fill))


def test_nothing_outside_the_file_is_read(tmp_path: Path) -> None:
    """Links to other files and datasets that lie in them are left out, and said."""
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["x"] = np.arange(4000.0)
    (tmp_path / "raw.bin").write_bytes(bytes(32000))

    def fill(file: Any) -> None:
        filled(file)
        file["link"] = h5py.ExternalLink("secret.h5", "/x")
        file["soft"] = h5py.SoftLink("/data")
        file.create_dataset("raw", shape=(4000,), dtype="f8", external=[(str(tmp_path / "raw.bin"), 0, 32000)])
        layout = h5py.VirtualLayout(shape=(4000,), dtype="f8")
        layout[:] = h5py.VirtualSource(tmp_path / "secret.h5", "x", shape=(4000,))
        file.create_virtual_dataset("virtual", layout)

    path = matlab(tmp_path / "log.mat", fill)
    (tmp_path / "log.mat.map.toml").write_text(RUN)
    (log,) = read_log(path)
    assert [f.what for f in log.findings if f.kind == "columns"] == [
        "left out, as they hold no real numbers: link, raw, soft, virtual, who"
    ]


def test_a_file_that_is_cut_is_refused(tmp_path: Path) -> None:
    path = matlab(tmp_path / "log.mat", filled)
    whole = path.read_bytes()
    for end in (520, 700, 2000, len(whole) // 2, len(whole) - 100):
        path.write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"version 7\.3, and is damaged or cut"):
            parts_here(path)


def _waits(path: Path) -> None:
    time.sleep(60.0)


def _dies(path: Path) -> None:
    os.abort()


@pytest.mark.parametrize(("read", "words"), [(_waits, "was not over after 0 s"), (_dies, "ended the process")])
def test_a_library_that_a_file_leads_astray_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], None], words: str
) -> None:
    monkeypatch.setattr(apart, "_PATIENCE", 0.1)
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match=f"to read it {words}: it is damaged, or was made to do harm"):
        apart.read_apart(read, tmp_path / "file")
