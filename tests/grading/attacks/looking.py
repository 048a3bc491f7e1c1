"""Searching for answers, secrets and other people's files. What is found is told by a failing assertion."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from tests.grading.attacks import Attack, in_control

_WALK = """
import gc, sys
words = ("plant", "reference", "disturbance", "answer", "solution", "secret", "seed", "criteria", "expected")
found = []
frame = sys._getframe()
while frame is not None:
    found += [name for name in frame.f_locals if any(word == name.lower() for word in words)]
    frame = frame.f_back
for each in gc.get_objects():
    if str(type(each).__module__).startswith("rds.") and type(each).__name__ in (
        "Assignment", "Case", "CaseRun", "Criterion", "Pool", "LoadedSubmission", "OpenSubmission", "Result", "Signal",
        "Grade", "Limits", "ControlCase", "ModelCase", "SegmentCase"):
        found.append(type(each).__name__)
assert not found, found
"""
_TEXTS = """
import gc
mark = "hidden" + "-case-" + "answer"
seen = [each for each in gc.get_objects() if isinstance(each, dict) and mark in map(str, list(each.values())[:50])]
assert not [each for each in seen if each is not globals()], len(seen)
"""
_FILES = """
import os, sys
found = []
for root, folders, files in os.walk("/"):
    if root.startswith(("/usr/lib", "/opt/packages", "/lib", sys.base_prefix)):
        folders[:] = []
        continue
    found += [os.path.join(root, name) for name in files if name.endswith((".toml", ".csv", ".json", ".jsonl", ".parquet"))]
    found += [os.path.join(root, name) for name in files if "assignment" in name or "solution" in name or "test_" in name]
found = [name for name in found if "/machines/" not in name]
assert not found, found
assert os.listdir("/tmp") == ["submission.py"], os.listdir("/tmp")
"""
_PROC = """
import os
for name in ("self/environ", "1/environ", "1/mem", "1/cmdline", "1/fd", "self/fd", "self/maps", "self/mem", "1/root",
             "sys/kernel/core_pattern", "sysrq-trigger", "kcore", "mounts", "net/tcp"):
    assert not os.path.lexists("/proc/" + name), name
for name in ("/sys", "/run", "/var", "/home", "/opt/rds/tests", "/etc/passwd", "/etc/hostname", "/dev/shm", "/dev/mem", "/dev/tty",
             "/dev/pts", "/dev/kmsg", "/dev/fd", "/dev/stdout", "/dev/zero", "/dev/full"):
    assert not os.path.exists(name), name
"""
_TOKENS = """
import ctypes, os
assert not [name for name in os.environ if any(word in name for word in ("TOKEN", "KEY", "SECRET", "PASS", "GRADE"))]
environ = ctypes.POINTER(ctypes.c_char_p).in_dll(ctypes.CDLL(None), "environ")
at, raw = 0, []
while environ[at]:
    raw.append(environ[at]); at += 1
assert not [each for each in raw if b"ATTACK-CANARY" in each], raw
"""
_LIBRARY = """
for name in ("rds.controllers", "rds.interpolators", "rds.grading.assignment.assignment", "rds.grading.cases", "rds.grading.criteria",
             "rds.modes.experiment", "rds.models.linear_axis", "rds.models.machine_motion", "rds.machines.kinematics.inverse",
             "rds.machines.forces.milling", "rds.identification", "pytest", "rds.panels.session"):
    try:
        __import__(name)
    except ImportError:
        continue
    raise AssertionError(name)
"""
_LEVELS = """
import os
for name in ("/tmp/../../../etc/passwd", "/usr/lib/../../etc/shadow", "//proc//1//root", "/opt/rds/rds/.."):
    if os.path.exists(name):
        assert os.path.realpath(name) == "/opt/rds", name
for call in (os.link, os.symlink):
    try: call("/opt/rds/rds/__init__.py", "/tmp/inner")
    except OSError: continue
    raise AssertionError(call)
"""
_SOCKETS = """
import ctypes, errno, socket
libc = ctypes.CDLL(None, use_errno=True)
for family in range(46):
    for kind in (1, 2, 3, 5, 10):
        ctypes.set_errno(0)
        assert libc.socket(family, kind, 0) == -1 and ctypes.get_errno() == errno.EPERM, (family, kind)
try: socket.getaddrinfo("example.org", 80)
except OSError: pass
else: raise AssertionError
"""
_CALLS = """
import ctypes, errno
libc = ctypes.CDLL(None, use_errno=True)
allowed = []
for name, number in dict(
    ptrace=101, process_vm_readv=310, process_vm_writev=311, kcmp=312, pidfd_open=434, pidfd_getfd=438, io_uring_setup=425,
    io_uring_enter=426, io_uring_register=427, bpf=321, perf_event_open=298, userfaultfd=323, keyctl=250, add_key=248,
    unshare=272, setns=308, mount=165, move_mount=429, fsopen=430, open_tree=428, fsmount=432, pivot_root=155, chroot=161,
    execve=59, execveat=322, memfd_create=319, memfd_secret=447, shmget=29, semget=64, msgget=68, mq_open=240, mlock=149,
    mlockall=151, mlock2=325, sched_setaffinity=203, sched_setscheduler=144, setpriority=141, ioprio_set=251, personality=135,
    mknod=133, mknodat=259, symlink=88, link=86, chmod=90, chown=92, setuid=105, setresuid=117, setgroups=116, capset=126,
    eventfd2=290, signalfd4=289, timerfd_create=283, timer_create=222, inotify_init1=294, fanotify_init=300, splice=275,
    tee=276, vmsplice=278, name_to_handle_at=303, open_by_handle_at=304, seccomp=317, landlock_create_ruleset=444,
    syslog=103, sethostname=170, clock_settime=227, swapon=167, init_module=175, kexec_load=246, modify_ldt=154,
    quotactl=179, acct=163, reboot=169, setxattr=188, sendfile=40, socketpair=53, rt_sigqueueinfo=129, tgsigqueueinfo=297,
    pidfd_send_signal=424, flock=73, utimensat=280, statfs=137, fstatfs=138, preadv2=327, mincore=27, process_madvise=440, process_mrelease=448, cachestat=451, map_shadow_stack=453, futex_wake=454,
).items():
    ctypes.set_errno(0)
    if libc.syscall(number, 0, 0, 0, 0, 0, 0) != -1 or ctypes.get_errno() != errno.EPERM:
        allowed.append((name, ctypes.get_errno()))
assert not allowed, allowed
for option in (1, 4, 8, 22, 23, 24, 28, 36, 38, 39, 47, 0x59616D61):  # death signal, dumpable, seccomp, subreaper, ...
    assert libc.prctl(option, 0, 0, 0, 0) == -1 and ctypes.get_errno() == errno.EPERM, option
"""
_SETUID = """
import os, stat
found = []
for root, folders, files in os.walk("/usr"):
    for name in files:
        try: mode = os.lstat(os.path.join(root, name)).st_mode
        except OSError: continue
        if stat.S_ISREG(mode) and mode & 0o6000:
            try: os.execv(os.path.join(root, name), [name])
            except PermissionError: continue
            found.append(name)
    folders[:] = [name for name in folders if root.count("/") < 3 and not name.startswith("python")]
assert not found, found
for name in ("/usr/bin/sh", "/bin/sh", "/usr/bin/sudo", "/usr/bin/su"):
    assert not os.path.exists(name), name
"""
_SHADOW = """
import json, os
import numpy
assert numpy.__file__.startswith("/opt/packages/") and not hasattr(numpy, "shadow"), numpy.__file__
assert json.__file__.startswith("/usr/") or "/lib/python" in json.__file__
assert not os.path.exists("/tmp/numpy.py")
"""
_SIBLING = """
import os, time
assert os.listdir("/tmp") == ["submission.py"]
with open("/tmp/left_behind", "w") as file: file.write("for the next one")
import sys
sys.modules["left_behind"] = sys
os.environ["LEFT_BEHIND"] = "1"
"""
_MARKS = """
import fcntl, os, struct
refused = 0
for name in ("/dev/null", "/dev/random", "/dev/urandom"):
    try: os.utime(name)  # the computer's own: the time would be there for the next submission
    except PermissionError: refused += 1
for name in ("/dev/null", "/opt/rds/rds/__init__.py"):
    with open(name, "rb") as file:
        for lock in (lambda: fcntl.flock(file, fcntl.LOCK_EX), lambda: fcntl.lockf(file, fcntl.LOCK_SH),
                     lambda: fcntl.fcntl(file, fcntl.F_GETLK, struct.pack("hhqqi", 0, 0, 0, 0, 0))):
            try: lock()
            except PermissionError: refused += 1
assert refused == 9, refused
"""
_GRADED = """
import os, sys
def control(t, r, y, state, params):
    words = " ".join([*sys.argv, *os.environ, *os.environ.values(), os.getcwd(), __file__, __name__]).lower()
    return (0.0 if "hidden" in words or "grader" in words or "reference" in words else 1.0), state
"""

ATTACKS = {
    "frames and gc": Attack(_WALK),
    "frames and gc in a sample": Attack(in_control(_WALK)),
    "texts in memory": Attack(_TEXTS),
    "hidden cases and reports": Attack(_FILES),
    "proc and devices": Attack(_PROC),
    "tokens in the environment": Attack(_TOKENS),
    "the library's own solutions": Attack(_LIBRARY),
    "ways up": Attack(_LEVELS),
    "sockets of all families": Attack(_SOCKETS),
    "system calls": Attack(_CALLS),
    "setuid programs and shells": Attack(_SETUID),
    "modules beside it": Attack(_SHADOW),
    "what the last one left": Attack(_SIBLING),
    "marks where others look": Attack(_MARKS),
    "good behaviour when it is graded": Attack(_GRADED),
    "solutions anywhere": Attack(
        "import os\nnames = {'solution.py', 'assignment.toml', 'batch.json', 'journal.jsonl', 'class.csv'}\nfound = [top for top, _, files in os.walk('/opt/rds') if names & {*files}] + [top for top in ('/', '/opt', '/tmp', '/etc') if names & {*os.listdir(top)}]\nassert not found, found"
    ),
    "places to write to": Attack(
        "import os\nfound = []\nfor top, folders, _ in os.walk('/'):\n    folders[:] = [each for each in folders if top.count('/') < 3 and (top, each) != ('/', 'tmp')]\n    try: open(f'{top}/canary', 'w').close()\n    except OSError: continue\n    found.append(top)\nassert not found, found"
    ),
    "descriptors of the grader": Attack(
        "import os, sys\nassert os.read(0, 10) == b''\nopen_ones = []\nfor number in range(3, 64):\n    try: os.fstat(number)\n    except OSError: continue\n    open_ones.append(number)\nassert len(open_ones) == 5, open_ones"
    ),
}
