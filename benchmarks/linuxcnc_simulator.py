"""LinuxCNC's own task, motion controller and trajectory planner, simulated: no screen, no hardware, no real time.

It runs as its user (as nobody where that is root, as which it refuses to), from a folder of its own with the machine's
limits, and what it commands is sampled in its servo thread: the time of a program is counted in servo periods of 1 ms.
"""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rds.interpolators.motion import Limits

PERIOD = 1e-3  # s
MOVES = 1e-9  # mm in a period
RESTS = 200  # periods: the drive waits longer before each program, and no program here rests so long
DRIVE = Path(__file__).with_name("linuxcnc_drive.py")
HAL = """\
loadrt trivkins coordinates=XYZ
loadrt motmod servo_period_nsec=1000000 num_joints=3
loadrt sampler cfg=fff depth=20000
addf motion-command-handler servo-thread
addf motion-controller servo-thread
addf sampler.0 servo-thread
net x joint.0.motor-pos-cmd => joint.0.motor-pos-fb sampler.0.pin.0
net y joint.1.motor-pos-cmd => joint.1.motor-pos-fb sampler.0.pin.1
net z joint.2.motor-pos-cmd => joint.2.motor-pos-fb sampler.0.pin.2
net enable iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
"""
INI = """\
[EMC]
VERSION = 1.1
MACHINE = simulated
[DISPLAY]
DISPLAY = {folder}/drive.py
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = parameters.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = 1000000
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = tools.tbl
[HAL]
HALFILE = machine.hal
[KINS]
JOINTS = 3
KINEMATICS = trivkins coordinates=XYZ
[TRAJ]
SPINDLES = 1
COORDINATES = X Y Z
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = {velocity}
MAX_LINEAR_VELOCITY = {fastest}
MAX_LINEAR_ACCELERATION = {quickest}
NO_FORCE_HOMING = 1
"""
AXIS = """\
[AXIS_{name}]
MIN_LIMIT = -200
MAX_LIMIT = 200
MAX_VELOCITY = {velocity}
MAX_ACCELERATION = {acceleration}
[JOINT_{number}]
TYPE = LINEAR
HOME = 0
MIN_LIMIT = -200
MAX_LIMIT = 200
MAX_VELOCITY = {velocity}
MAX_ACCELERATION = {acceleration}
FERROR = 100
MIN_FERROR = 100
HOME_SEQUENCE = 0
HOME_SEARCH_VEL = 0
HOME_LATCH_VEL = 0
"""


def positions(programs: Mapping[str, str], limits: Limits, seconds: float) -> dict[str, np.ndarray] | str:
    """Of each program the commanded X, Y, Z (m, 3) in mm from rest to rest, PERIOD apart; or why there is none.

    seconds: that all of them may take, after which LinuxCNC is ended.
    """
    if shutil.which("linuxcnc") is None:
        return "skipped: linuxcnc (Debian: linuxcnc-uspace) is not installed"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        words = _words(folder, limits)
        for number, text in enumerate(programs.values()):
            (folder / f"{number:02}.ngc").write_text(text)
        command = ["timeout", str(round(seconds)), "linuxcnc", "-r", str(folder / "machine.ini")]
        if os.getuid() == 0:
            nobody = pwd.getpwnam("nobody").pw_uid
            for path in (folder, *folder.iterdir()):
                os.chown(path, nobody, -1)
            command = ["setpriv", f"--reuid={nobody}", "--clear-groups", *command]
        done = subprocess.run(command, cwd=folder, env=words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        files = [folder / f"{number:02}.samples" for number in range(len(programs))]
        if done.returncode or not all(file.exists() for file in files):
            said = (done.stdout + done.stderr).strip().splitlines()
            return f"skipped: LinuxCNC ended with {done.returncode}: {said[-1] if said else 'no word'}"
        return {name: _moving(file) for name, file in zip(programs, files, strict=True)}


def _words(folder: Path, limits: Limits) -> dict[str, str]:
    """Writes what LinuxCNC is started with; returns its environment."""
    most = dict(zip("XYZ", zip(limits.velocity, limits.acceleration, strict=True), strict=False))
    text = INI.format(
        folder=folder,
        velocity=limits.velocity[0],
        fastest=2 * limits.velocity.max(),
        quickest=2 * limits.acceleration.max(),
    )
    for number, (name, (velocity, acceleration)) in enumerate(most.items()):
        text += AXIS.format(name=name, number=number, velocity=velocity, acceleration=acceleration)
    (folder / "machine.ini").write_text(text)
    (folder / "machine.hal").write_text(HAL)
    (folder / "tools.tbl").write_text("")
    shutil.copy(DRIVE, folder / "drive.py")
    (folder / "drive.py").chmod(0o755)
    return {"PATH": "/usr/bin:/bin:/usr/sbin", "HOME": str(folder), "USER": "rds", "LANG": "C.UTF-8"}


def _moving(file: Path) -> np.ndarray:
    rows = [line.split() for line in file.read_text().splitlines() if not line.startswith("overrun")]
    table = np.array([row for row in rows if len(row) == 3], dtype=float)
    moving = np.flatnonzero(np.abs(np.diff(table, axis=0)).max(axis=1) > MOVES)
    # What the sampler had kept comes first, and in it the way to machine zero: the program begins after the last rest.
    begins = np.flatnonzero(np.diff(moving) > RESTS)
    first = moving[begins[-1] + 1] if len(begins) else moving[0]
    return table[first : moving[-1] + 2]
