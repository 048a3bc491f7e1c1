"""Odd but honest styles, which look like attacks and are none: they run, and answer the same in every run."""

# ruff: noqa: E501 - what is handed in is easier to read on the line on which it is written
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rds.grading.grade import Status
from rds.grading.sandbox import Pool
from tests.grading.attacked import SAMPLES, run
from tests.grading.attacks import PATIENT

Written = Callable[..., Path]

_LAW = "def control(t, r, y, state, params):\n    return 30.0 * (r.position - y), state\n"
STYLES = {
    "threads that are joined": "import threading\nbox = []\nthread = threading.Thread(target=box.append, args=(30.0,))\nthread.start(); thread.join()\n" + _LAW,
    "a pool of threads": "from concurrent.futures import ThreadPoolExecutor\nwith ThreadPoolExecutor(2) as pool: gains = list(pool.map(float, (1, 2)))\n" + _LAW,
    "a file of its own": "import json, pathlib, tempfile\nplace = pathlib.Path(tempfile.mkdtemp()) / 'gains.json'\nplace.write_text(json.dumps({'kp': 30.0}))\nkp = json.loads(place.read_text())['kp']\n" + _LAW.replace("30.0", "kp"),
    "a pickle of its own": "import io, pickle\nkp = pickle.loads(pickle.dumps({'kp': 30.0}))['kp']\n" + _LAW.replace("30.0", "kp"),
    "ctypes for a library of mathematics": "import ctypes, ctypes.util\nlibm = ctypes.CDLL('libm.so.6')\nlibm.sqrt.restype, libm.sqrt.argtypes = ctypes.c_double, [ctypes.c_double]\nkp = libm.sqrt(900.0)\n" + _LAW.replace("30.0", "kp"),
    "code that writes code": "exec(compile('kp = 30.0', 'made', 'exec'))\nlaw = eval('lambda e: kp * e')\ndef control(t, r, y, state, params):\n    return law(r.position - y), state\n",
    "an alarm clock of its own": "import signal\nsignal.signal(signal.SIGALRM, lambda *a: None)\nsignal.alarm(0)\n" + _LAW,
    "masked arrays without a masked number": "import numpy as np\ndef control(t, r, y, state, params):\n    return np.ma.array([30.0 * (r.position - y)]), state\n",
    "a state of masked arrays": "import numpy as np\ninitial_state = np.ma.array([0.0, 0.0], mask=[True, False])\n" + _LAW,
    "a subclass of float and of tuple": "from typing import NamedTuple\nclass Volt(float):\n    def __repr__(self): return f'{float(self)} V'\nclass Answer(NamedTuple):\n    u: float\n    state: object\ndef control(t, r, y, state, params):\n    return Answer(Volt(30.0 * (r.position - y)), state)\n",
    "patches of numpy that many have": "import numpy as np\nnp.float = float\nnp.int = int\nnp.set_printoptions(precision=3)\nnp.seterr(all='raise')\n" + _LAW,
    "a check of who runs it": "import os, sys\nif not os.environ.get('DISPLAY'): print('no display')\nassert sys.version_info >= (3, 11)\nprint(os.getcwd(), os.cpu_count() and 'cpus')\n" + _LAW,
    "frames and the collector for a message": "import gc, inspect, sys\ndef here(): return inspect.currentframe().f_back.f_code.co_name\ngc.disable(); gc.collect(); gc.enable()\ndef control(t, r, y, state, params):\n    assert here() == 'control'\n    return 30.0 * (r.position - y), state\n",
    "warnings, logs and a traceback": "import logging, traceback, warnings\nlogging.basicConfig(level=logging.INFO)\nlogging.info('begun')\nwarnings.warn('an older numpy')\ntry: 1 / 0\nexcept ZeroDivisionError: traceback.print_exc()\n" + _LAW,
    "a large table in memory": "import numpy as np\ntable = np.ones((4000, 1000))\nplan = np.broadcast_to(table, (4, 4000, 1000))\n" + _LAW,
    "shared views of one array": "import numpy as np\nkept = np.zeros(4)\nview = memoryview(kept)\ndef control(t, r, y, state, params):\n    view[0] = 30.0 * (r.position - y)\n    return kept[:1].copy(), state\n",
    "a module made at run time": "import sys, types\nhelp_ = types.ModuleType('help_')\nhelp_.kp = 30.0\nsys.modules['help_'] = help_\nfrom help_ import kp\n" + _LAW.replace("30.0", "kp"),
    "a generator as memory": "def filter_():\n    value = 0.0\n    while True: value = 0.5 * value + (yield value)\ndef control(t, r, y, state, params):\n    state = state or filter_()\n    if state.gi_frame.f_lasti < 0 or not getattr(state, 'gi_running', False) and state.gi_frame.f_lineno == 1: next(state)\n    return 30.0 * (r.position - y), state\ninitial_state = None\n",
}  # fmt: skip


@pytest.mark.parametrize("name", STYLES)
def test_an_odd_style_is_no_attack(name: str, pool: Pool, written: Written) -> None:
    path = written(STYLES[name], "")
    found = run(pool, path, PATIENT)
    assert (found.status, found.reason) == (Status.OK, "")
    expected = [30.0 * (0.1 * k - 0.05 * k) for samples in (SAMPLES, 3) for k in range(samples)]
    assert found.answers == pytest.approx(expected, abs=1e-12)
    assert run(pool, path, PATIENT) == found
