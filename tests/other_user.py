"""What another user of the same computer sees of a folder, and what its modes would let one see."""

from __future__ import annotations

import json
import os
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

OTHER = 0x6F00BEEF  # a user, and a group, that have no name
SIGN = "public.txt"  # in a hall: what everybody can read, so that nobody is taken for blind


@contextmanager
def hall(umask: int = 0) -> Iterator[Path]:
    """A folder that all users can look into, as /tmp is, under a umask that keeps nothing from them."""
    before = os.umask(umask)
    place = Path(tempfile.mkdtemp(prefix="rds-hall-", dir="/tmp"))
    try:
        place.chmod(0o1777)
        (place / SIGN).touch()
        (place / SIGN).chmod(0o644)
        yield place
    finally:
        os.umask(before)
        shutil.rmtree(place)


def open_by_mode(places: Iterable[Path]) -> list[str]:
    """Everything below that has a bit for the group or others, whether its folder can be entered or not."""
    found = []
    for place in places:
        for path in [place, *place.rglob("*")] if place.is_dir() else [place]:
            try:
                about = path.lstat()
            except FileNotFoundError:  # a run's end takes it away meanwhile
                continue
            if stat.S_IMODE(about.st_mode) & 0o077 and not stat.S_ISLNK(about.st_mode):
                found.append(f"{path} {stat.filemode(about.st_mode)}")
    return found


def seen_by_another(places: Iterable[Path], group: int = OTHER) -> list[str]:
    """What a user of another number can list or read, in a process that is his. Only root can ask."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(group)
            os.setuid(OTHER)
            os.write(writing, json.dumps(_look(places)).encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        found = answer.read()
    os.waitpid(child, 0)
    seen = json.loads(found)
    assert isinstance(seen, list)
    return seen


def _look(places: Iterable[Path]) -> list[str]:
    seen, todo = [], [str(place) for place in places]
    while todo:
        path = todo.pop()
        try:
            if os.path.isdir(path):
                todo += [os.path.join(path, name) for name in os.listdir(path)]
            else:
                with open(path, "rb") as file:
                    file.read(1)
        except OSError:
            continue
        seen.append(path)
    return seen
