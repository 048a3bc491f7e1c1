"""Hostile submissions, by what they are after. They are texts and not files: nobody runs one outside by mistake.

Each is put behind `INSIDE`, which ends it at once where it does not run in a sandbox.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from rds.grading.grade import Status
from rds.grading.sandbox import Limits

INSIDE = """
import os as _os
_found = (_os.getuid(), _os.getpid(), _os.getppid(), _os.path.exists("/etc/passwd"), _os.listdir("/proc"))
if _found != (1000, 2, 1, False, []):
    raise SystemExit(f"not inside: {_found}")
try:
    import socket as _socket
    _socket.socket()
except PermissionError:
    print("inside", flush=True)
else:
    raise SystemExit("not inside: there is a network")
"""
CONTROL = """
def control(t, r, y, state, params):
    return 1.0, state
"""
"""What a submission does besides its attack, where that says nothing else: 1 V."""
DESCRIPTORS = """
there = []
for number in range(3, 64):
    try: os.fstat(number)
    except OSError: continue
    there.append(number)
questions, answers, memory, question_bell, answer_bell = there
"""
"""The names of its worker's own descriptors, of which all of these attacks make use."""

SHORT = Limits(
    cpu_seconds=2.0,
    wall_seconds=4.0,
    call_seconds=0.4,
    load_seconds=1.0,
    memory_bytes=192 << 20,
    processes=8,
    output_bytes=10_000,
    file_bytes=4 << 20,
)
PATIENT = replace(SHORT, wall_seconds=40.0, call_seconds=10.0, load_seconds=10.0)
"""For honest submissions: a busy computer makes no difference to what they answer."""


@dataclass(frozen=True)
class Attack:
    """`text` is the submission. `status` is how it must end and `said` a pattern of the reason.

    With the status OK it runs to its end, and every answer is 1 V: the attack gained nothing.
    """

    text: str
    status: Status = Status.OK
    said: str = ""
    limits: Limits = SHORT

    @property
    def whole(self) -> str:
        """What is handed in."""
        return INSIDE + self.text + ("" if "def control(" in self.text else CONTROL)


def in_control(body: str) -> str:
    """A controller that does `body` at its sixth sample, and answers 1 V if it gets past it."""
    lines = "\n".join(f"        {line}" for line in body.strip().splitlines())
    head = "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n"
    return f"{head}{lines}\n    return 1.0, state + 1\n"
