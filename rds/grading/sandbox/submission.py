"""A file that was handed in, read without running or trusting it."""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError

LARGEST = 512 << 10  # bytes; a file of data, not of code

_SAFE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,60}\.py")
_IMPORTS = re.compile(rb"^[ \t]*(?:import|from)[ \t]([^\n]*)", re.MULTILINE)


# A link is not followed, and a pipe does not hold the reader up. Windows has neither, and needs a flag of its own,
# without which it changes line ends.
UNFOLLOWED = os.O_RDONLY
for _flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
    UNFOLLOWED |= getattr(os, _flag, 0)


@dataclass(frozen=True)
class Submission:
    """Its bytes, and a name for messages that can be shown anywhere."""

    name: str
    data: bytes

    def imports(self, package: str) -> bool:
        """Whether a line imports `package`: a guess that saves time, and need not be right.

        By pattern, because parsing what somebody wrote to crash a parser is not for the grader's process.
        """
        word = re.compile(rb"\b%s\b" % package.encode())
        return any(word.search(line) for line in _IMPORTS.findall(self.data))


def read_submission(path: Path) -> Submission:
    """The regular file at `path`. SubmissionError for anything else: a link, a device, or one that is too large."""
    try:
        descriptor = os.open(path, UNFOLLOWED)
    except FileNotFoundError:
        raise SubmissionError(Status.MISSING, "there is no such file") from None
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise SubmissionError(Status.REFUSED, f"it cannot be opened, or is a link: {said}") from None
    about = os.fstat(descriptor)
    if not stat.S_ISREG(about.st_mode) or about.st_nlink > 1:
        os.close(descriptor)
        kind = "not a regular file" if not stat.S_ISREG(about.st_mode) else "a hard link to another file"
        raise SubmissionError(Status.REFUSED, f"it is {kind}; hand in one Python file")
    with os.fdopen(descriptor, "rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise SubmissionError(Status.REFUSED, f"it has more than {LARGEST} bytes; keep data out of it")
    return Submission(safe_name(path.name), data)


def safe_name(name: str) -> str:
    """The name, where it is a plain one of a Python file."""
    return name if _SAFE_NAME.fullmatch(name) else "submission.py"
