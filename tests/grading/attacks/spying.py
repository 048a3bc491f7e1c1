"""Learning what is hidden, which case runs, or who grades: by memory, frames, clocks, descriptors and what others left."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import DESCRIPTORS, Attack, in_control

TIMED_OUT, LOAD, CONTRACT, KILLED = Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT, Status.KILLED

_ENDS = "import ctypes, fcntl, mmap, os, struct, sys, time\n" + DESCRIPTORS
_KNOWN = {"op", "params", "initial_state", "T", "axes", "names", "through_memory", "kind", "name", "text"}
_ORDERS = f"""
import sys
known = {sorted(_KNOWN)}
seen = []
frame = sys._getframe()
while frame is not None:
    for name, value in list(frame.f_locals.items()):
        if name in ("order", "request", "about", "task") and isinstance(value, dict): seen.append(value)
        assert "seed" not in name and "seal" not in name and "secret" not in name, name
    frame = frame.f_back
assert any("op" in each for each in seen) or len(seen) < 9, seen
for each in seen:
    rest = set(each) - set(known) - {{"limits", "cpus"}}
    assert not rest, rest
    said = str({{key: value for key, value in each.items() if key != "text"}})
    assert "hidden" not in said and "student" not in said and "/home" not in said, said
"""
_HEAP = """
import ctypes, os, sys
libc = ctypes.CDLL(None, use_errno=True)
libc.sbrk.restype = ctypes.c_void_p
source, sink = os.pipe()
mark, other = b"ATTACK" + b"-CANARY", b"only the " + b"instructor knows this"
def page(at):
    '''What is in a page, or None: the kernel says EFAULT where Python would fall.'''
    libc.write.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t]
    if libc.write(sink, at, 4096) != 4096: return None
    return os.read(source, 4096)
found, pages = [], 0
starts = [libc.sbrk(0) - 4096, id(object()) & ~4095, id(sys.modules) & ~4095, ctypes.addressof(ctypes.c_char_p.in_dll(libc, "environ")) & ~4095]
for start in starts:
    for step in (-4096, 4096):
        at = start
        for _ in range(1500):
            data = page(at)
            if data is None: break
            pages += 1
            if mark in data or other in data: found.append(hex(at))
            at += step
assert pages > 100 and not found, (pages, found)
"""

ATTACKS = {
    "orders that the worker holds": Attack(in_control(_ORDERS)),
    "orders while it loads": Attack(_ORDERS),
    "the heap and the stack read page by page": Attack(_HEAP),
    "every object of the collector searched for numbers of a plant": Attack(
        in_control(
            "import gc\nnames = [str(each)[:200] for each in gc.get_objects() if type(each) is dict and {'K', 'tau'} <= {*map(str, list(each)[:50])}]\nassert not [n for n in names if 'axis' in n or 'plant' in n], names"
        )
    ),
    "referrers of the reference": Attack(
        in_control(
            "import gc\nseen, todo = set(), [r]\nfor _ in range(300):\n    if not todo: break\n    for each in gc.get_referrers(todo.pop()):\n        if id(each) not in seen and len(seen) < 3000:\n            seen.add(id(each)); todo.append(each)\n            assert type(each).__name__ not in ('Result', 'Plan', 'ControlCase', 'CaseRun', 'Assignment', 'LinearAxis'), each"
        )
    ),
    "the next sample in the mailbox": Attack(
        _ENDS
        + "initial_state = 0\ndef control(t, r, y, state, params):\n    shared = mmap.mmap(memory, 4096)\n    values = [v for v in struct.unpack('<512d', shared[:]) if abs(v) > 1e-300]\n    late = [v for v in values if v in (0.1 * (state + 1), 0.05 * (state + 1)) and v not in (t, r.position, r.velocity, y, 1.0)]\n    assert not late, late\n    return 1.0, state + 1\n"
    ),
    "the next question in the pipe": Attack(
        _ENDS
        + "def control(t, r, y, state, params):\n    n = fcntl.ioctl(questions, 0x541b, struct.pack('i', 0))\n    assert struct.unpack('i', n)[0] == 0\n    return 1.0, state\n"
    ),
    "a question taken before its time": Attack(_ENDS + in_control("os.read(questions, 1)"), TIMED_OUT, "no answer"),
    "output of others read back": Attack(
        "import os\nfor fd in (1, 2):\n    for act in (lambda: os.read(fd, 10), lambda: os.pread(fd, 10, 0), lambda: os.lseek(fd, 0, 0), lambda: os.ftruncate(fd, 0)):\n        try: act()\n        except OSError: continue\n        raise AssertionError(fd)"
    ),
    "ends of others by their numbers": Attack(
        "import os\nfor number in range(3, 1024):\n    try: kind = os.fstat(number)\n    except OSError: continue\n    assert os.path.exists('/dev/null') and number < 40, number"
    ),
    "waiting for somebody's end": Attack(
        "import os\nfor pid in (-1, 1, 2, 3, 100):\n    for act in (lambda: os.waitpid(pid, os.WNOHANG), lambda: os.waitid(os.P_PID, max(pid, 1), os.WEXITED | os.WNOHANG | os.WNOWAIT), lambda: os.getsid(pid) and 1 / 0 if pid > 2 else 1 / 0):\n        try: found = act()\n        except (OSError, ZeroDivisionError): continue\n        assert not found, found"
    ),
    "times of files that tell the assignment's": Attack(
        "import os, time\nrecent = []\nfor top in ('/', '/opt', '/opt/rds', '/opt/rds/rds/grading', '/tmp', '/etc'):\n    for name in os.listdir(top):\n        path = os.path.join(top, name)\n        if 'assignment' in name or 'batch' in name or 'student' in name: recent.append(path)\nassert not recent, recent"
    ),
    "clocks of other processes": Attack(
        "import time, os\nfor pid in (1, 3, 100, 1000):\n    try: time.clock_gettime((~pid << 3) | 2)\n    except OSError: continue\n    assert pid in (1,), pid"
    ),
    "the load of the computer": Attack(
        "import os\ntry: os.getloadavg()\nexcept OSError: pass\nassert not os.path.exists('/proc/loadavg') and not os.path.exists('/proc/stat')"
    ),
    "what the two cases have different": Attack(
        "import os, sys, json\nmarks = [os.getpid(), os.getppid(), os.getpgrp(), os.getsid(0), os.getcwd(), sys.argv, dict(os.environ), sys.flags.optimize, sorted(os.listdir('/tmp')), sorted(os.listdir('/')), sys.getrecursionlimit(), hash('x'), len(sys.modules), os.umask(0o77)]\nplace = '/tmp/marks'\nassert not os.path.exists(place)\nopen(place, 'w').write(json.dumps(marks, default=str))\nassert marks[:4] == [2, 1, 2, 2] and sys.argv[:1] in (['-c'], ['']), marks"
    ),
    "a marker in a module that the next case shares": Attack(
        "import builtins, json, math, numpy, os, sys\nfor module in (builtins, json, math, numpy, os, sys):\n    assert not hasattr(module, 'seen_before'), module\n    module.seen_before = True\nassert not numpy.get_printoptions().get('precision') == 3\nnumpy.set_printoptions(precision=3)\nassert numpy.geterr()['divide'] != 'raise'\nnumpy.seterr(all='raise')"
    ),
    "a marker in the interpreter's own constants": Attack(
        "import ctypes, sys\nt = (1.5, 'mark', 2.5)\nassert sys.intern('seen' + 'before') == 'seenbefore'\nassert not hasattr(sys.intern, 'x')\nimport decimal, locale\nassert decimal.getcontext().prec == 28\ndecimal.getcontext().prec = 5\nassert sys.getswitchinterval() < 1\nsys.setswitchinterval(2.0); sys.setswitchinterval(0.005)"
    ),
    "a marker in the random numbers": Attack(
        "import random, numpy as np\nfirst = random.random(), float(np.random.rand())\nassert abs(first[0] - 0.8444218515250481) < 1e-12, first\nrandom.seed(99); np.random.seed(99)"
    ),
    "a marker in the limits": Attack(
        "import resource\nsoft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)\nassert hard > 4096\nresource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))"
    ),
    "a marker in the terminal and the group": Attack(
        "import os\nfor fd in (0, 1, 2): assert not os.isatty(fd)\ntry: os.open('/dev/tty', os.O_RDWR)\nexcept OSError: pass\nelse: raise AssertionError\ntry: os.tcgetpgrp(1)\nexcept OSError: pass\nelse: raise AssertionError"
    ),
    "objects of System V and of POSIX": Attack(
        "import ctypes, errno\nlibc = ctypes.CDLL(None, use_errno=True)\nfor number in (29, 30, 31, 64, 65, 66, 68, 69, 70, 71, 240, 241, 242, 243, 244, 245):\n    ctypes.set_errno(0)\n    assert libc.syscall(number, 0x1234, 4096, 0o1666, 0, 0) == -1 and ctypes.get_errno() == errno.EPERM, number\nfrom multiprocessing import shared_memory\ntry: shared_memory.SharedMemory('mark', create=True, size=64)\nexcept (OSError, ImportError): pass\nelse: raise AssertionError"
    ),
    "the grader's words in its own modules": Attack(
        "import sys\nwords = ('overshoot', 'rms-error', 'phase-margin', 'settling-time', 'model-fit')\nfound = []\nfor name, module in list(sys.modules.items()):\n    if name.startswith('rds.'):\n        for key, value in list(vars(module).items()):\n            if isinstance(value, (str, tuple, list, dict, frozenset)) and any(word in str(value) for word in words): found.append((name, key))\nassert not found, found"
    ),
    "the grader's files by import": Attack(
        "import importlib, pkgutil, rds\nfor name in ('grading.batch.work', 'grading.criteria.rms_error', 'grading.exports.moodle', 'grading.intake.notebooks', 'grading.cases.control', 'grading.assignment.seeds', 'grading.feedback.feedback', 'identification.fit', 'interpolators.tustin', 'controllers.pid', 'models.machine_axis', 'references', 'nc', 'panels', 'bus', 'cli'):\n    try: importlib.import_module('rds.' + name)\n    except ImportError: continue\n    raise AssertionError(name)"
    ),
    "the text of the library's solutions": Attack(
        "import os\nfound = []\nfor top, folders, names in os.walk('/opt/rds'):\n    for name in names:\n        data = open(os.path.join(top, name), 'rb').read() if name.endswith('.py') else b''\n        if b'def interpolate(segment' in data or b'class Pid' in data: found.append(name)\nassert not found, found"
    ),
    "debuggers and profilers": Attack(
        "import pdb, bdb, trace, cProfile, sys\ncProfile.Profile().runcall(lambda: 1)\nassert sys.gettrace() is None\nassert not hasattr(sys, 'remote_exec') or sys.remote_exec"
    ),
    "words of the machine in its name": Attack(
        "import os, platform, socket\nassert os.uname().nodename == 'sandbox' and socket.gethostname() == 'sandbox', os.uname()\ntry: import getpass; who = getpass.getuser()\nexcept Exception: who = ''\nassert who in ('', '1000'), who"
    ),
    "accounts of the computer": Attack(
        "import pwd, grp, os\nfor ask in (lambda: pwd.getpwuid(0), lambda: pwd.getpwall() or 1 / 0, lambda: grp.getgrgid(0), lambda: os.getlogin()):\n    try: ask()\n    except (KeyError, OSError, ZeroDivisionError): continue\n    raise AssertionError(ask)"
    ),
}
