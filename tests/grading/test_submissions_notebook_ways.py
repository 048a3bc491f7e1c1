"""Ways of setting a gain in a notebook: each is graded as what it ran, or refused in words; experiments are left out."""

# ruff: noqa: E501 - a notebook's cell is easier to read on the line on which it is written
from __future__ import annotations

import sys
import tracemalloc

import pytest

from rds.core.parallel import spread
from rds.grading.batch.queue import _converted
from rds.grading.batch.spool import Spool, Spooled
from rds.grading.intake.items import Refusal
from rds.grading.intake.notebooks import INTERFACE, Converted, converted
from tests.grading.batches import notebook
from tests.grading.test_submissions_notebooks import made


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    "cell",
    [
        'def put(k):\n    params[k] = 30.0\nlist(map(put, ["Kp"]))',
        "put = lambda v: params.update(Kp=v)\nput(30.0)",
        "from functools import partial\nput = partial(params.update, Kp=30.0)\nput()",
        'd = {"put": params.update}\nd["put"](Kp=30.0)',
        'def put():\n    params["Kp"] = 30.0\ng = put\ng()',
        'def get():\n    return params\nget()["Kp"] = 30.0',
        'def outer():\n    def inner():\n        params["Kp"] = 30.0\n    return inner\nouter()()',
        'def run(f):\n    f()\n    return f\n@run\ndef put():\n    params["Kp"] = 30.0',
        'class Tune:\n    params["Kp"] = 30.0',
        'class Tune:\n    def __init__(self):\n        params["Kp"] = 30.0\nTune()',
        'class Tune:\n    @staticmethod\n    def go():\n        params["Kp"] = 30.0\n        return 1\nx = Tune.go()',
        'class Tune:\n    def __call__(self):\n        params["Kp"] = 30.0\nt = Tune()\nt()',
        'class Tune:\n    def __enter__(self):\n        params["Kp"] = 30.0\n    def __exit__(self, *a): pass\nwith Tune():\n    pass',
        'from contextlib import contextmanager\n@contextmanager\ndef gain(k):\n    params["Kp"] = k\n    yield\nwith gain(30.0):\n    pass',
        'class P:\n    @property\n    def gain(self):\n        return params["Kp"]\n    @gain.setter\n    def gain(self, k):\n        params["Kp"] = k\np = P()\np.gain = 30.0',
        "from threading import Thread\nt = Thread(target=lambda: params.update(Kp=30.0))\nt.start()\nt.join()",
        'from concurrent.futures import ThreadPoolExecutor\ndef put(k):\n    params["Kp"] = k\nwith ThreadPoolExecutor() as pool:\n    pool.submit(put, 30.0)',
        '(q := params)["Kp"] = 30.0',
        'match params:\n    case {"Kp": _} as q:\n        q["Kp"] = 30.0',
        'for p in {"a": params}.values():\n    p["Kp"] = 30.0',
        'l = [params]\nq = l.pop()\nq["Kp"] = 30.0',
        'table = {}\ntable.setdefault("p", params)["Kp"] = 30.0',
        'from dataclasses import dataclass\n@dataclass\nclass A:\n    p: dict\n    def set(self, k):\n        self.p["Kp"] = k\n        return self\na = A(params)\nb = a.set(30.0)',
        'def put(p=params):\n    p["Kp"] = 30.0\nput()',
        'def put(**kw):\n    kw["p"]["Kp"] = 30.0\nput(p=params)',
        'class A:\n    def go(self):\n        global params\n        params = {"Kp": 30.0}\nA().go()',
        'import numpy as np\nk = np.zeros(2)\nv = k[:1]\nv += 30.0\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.zeros(1)\nnp.add(k, 30.0, out=k)\nparams["Kp"] = float(k[0])',
        'import heapq\nh = [50.0, 30.0]\nheapq.heapify(h)\nparams["Kp"] = h[0]',
        "from functools import reduce\nreduce(lambda p, k: (p.update(Kp=k), p)[1], [30.0], params)",
        'from operator import methodcaller\nmethodcaller("update", Kp=30.0)(params)',
        'getattr(params, "update")(Kp=30.0)',
        'class G:\n    k = 1.0\n    @classmethod\n    def set(cls, k):\n        cls.k = k\n        return cls\nH = G.set(30.0)\nparams["Kp"] = G.k',
        'class A:\n    def go(self):\n        params["Kp"] = 30.0\nclass B(A):\n    pass\nx = B().go()',
        'class A:\n    def __init_subclass__(cls):\n        params["Kp"] = 30.0\nclass B(A):\n    pass',
        'class A:\n    def __getitem__(self, k):\n        params["Kp"] = 30.0\na = A()\na[0]',
        'class A:\n    def __add__(self, k):\n        params["Kp"] = k\na = A()\na + 30.0',
        'import asyncio\nasync def put():\n    params["Kp"] = 30.0\nasyncio.run(put())',
        'class F:\n    def __del__(self):\n        params["Kp"] = 30.0\nf = F()\ndel f',
        'q = list(filter(None, [params]))[0]\nq["Kp"] = 30.0',
        'def both():\n    return params, 1\nq, n = both()\nq["Kp"] = 30.0',
        'it = iter([1.0, 30.0])\nnext(it)\nparams["Kp"] = next(it)',
        'def gen():\n    params["Kp"] = 30.0\n    yield 1\nlist(gen())',
        '%time params["Kp"] = 30.0',
        "%timeit -n1 -r1 params.update(Kp=30.0)",
        'from scipy.optimize import minimize\ndef cost(x):\n    params["Kp"] = 30.0\n    return float(x[0]) ** 2\nresult = minimize(cost, [1.0])',
        'old = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, {"Kp": 30.0})',
        'from collections import ChainMap\nc = ChainMap(params)\nc["Kp"] = 30.0',
        'steps = []\ndef put():\n    params["Kp"] = 30.0\nsteps.append(put)\nfor step in steps:\n    step()',
        'steps = {}\nsteps["put"] = lambda: params.update(Kp=30.0)\nfor step in steps.values():\n    step()',
        "steps = []\nsteps += [lambda: params.update(Kp=30.0)]\n[step() for step in steps]",
        'box = []\nbox += [params]\nbox[0]["Kp"] = 30.0',
        'class Tuner:\n    def __init__(self, p):\n        self.p = p\n    def set(self, k):\n        self.p["Kp"] = k\nt = Tuner(params)\nt.set(2.0)\nTuner(params).set(30.0)',
        'class Tuner:\n    def __init__(self, p):\n        self.p = p\nt = Tuner(params)\nt.p["Kp"] = 2.0\nTuner(p=params).p["Kp"] = 30.0',
        'class G:\n    def __init__(self): self.k = 1.0\n    def cost(self, k):\n        self.k = k\n        return (k - 30.0) ** 2\ng = G()\nfrom scipy.optimize import minimize_scalar\nminimize_scalar(g.cost, tol=1e-12)\nparams["Kp"] = round(g.k)',
        'class G:\n    k = 1.0\n    def cost(self, k):\n        self.k = k\ng = G()\nlist(map(g.cost, [2.0, 30.0]))\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\n    def tune(self, k):\n        self.k = k\ng = G()\ntune = g.tune\ntune(30.0)\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\n    def __call__(self, k):\n        self.k = k\ng = G()\ng(30.0)\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\n    def __enter__(self):\n        self.k = 30.0\n    def __exit__(self, *a): pass\ng = G()\nwith g:\n    pass\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\n    def __iter__(self):\n        self.k = 30.0\n        return iter([])\ng = G()\nfor _ in g:\n    pass\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\n    def __matmul__(self, k):\n        self.k = k\ng = G()\nx = g @ 30.0\nparams["Kp"] = g.k',
        'class G:\n    k = 1.0\ng = G()\ntype(g).k = 30.0\nparams["Kp"] = g.k',
        'class Box:\n    p = params\nBox.p["Kp"] = 30.0',
        'import numpy as np\nk = np.zeros(1)\nif True:\n    np.add.at(k, [0], 30.0)\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.ones(1)\nif True:\n    np.multiply(k, 30.0, k)\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.ones(1)\nnp.asarray(k)[0] = 30.0\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.array([50.0])\nv = k.clip(0.0, 30.0, out=k)\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.array([50.0])\nv = k.clip(0.0, 30.0, k)\nparams["Kp"] = float(k[0])',
        'import numpy as np\nk = np.array([900.0])\nv = np.sqrt(k, k)\nparams["Kp"] = float(k[0])',
        'class G:\n    def set(self, p):\n        p["Kp"] = 30.0\n        return 1\nx = G().set(params)',
        'class G:\n    def tune(self, p):\n        p["Kp"] = 30.0\ng = G()\nlist(map(g.tune, [params]))',
        'class G:\n    k = 1.0\n    def set(self, k):\n        type(self).k = k\ng = G()\nh = G()\nh.set(30.0)\nparams["Kp"] = g.k',
        'k = 1.0\n_ = [k := v for v in (2.0, 30.0)]\nparams["Kp"] = k',
        # what is called as a reader of files, and is none
        'def load(kind):\n    return {"axis": 30.0}[kind]\nparams["Kp"] = load("axis")',
        'class Gains:\n    def load(self, kind):\n        return {"axis": 30.0}[kind]\nkind = "axis"\nparams["Kp"] = Gains().load(kind)',
        "class Path:\n    def __init__(self, k):\n        self.k = k\n    def open(self):\n        return 10 * self.k\n"
        'params["Kp"] = Path(3.0).open()',
        'open = lambda k: k\nPath = lambda k: k\nparams["Kp"] = open(Path(30.0))',
        'def best(kind, path=None):\n    return float(open(path).read()) if path else {"fast": 30.0}[kind]\nparams["Kp"] = best("fast")',
        'def kept(path, k):\n    with open(path, "w") as file:\n        file.write(str(k))\n    return k\nparams["Kp"] = kept("/dev/null", 30.0)',
        'def get(path):\n    try:\n        return float(open(path).read())\n    except OSError:\n        return 30.0\nparams["Kp"] = get("no-such.txt")',
        'import io\nimport numpy as np\nparams["Kp"] = float(np.loadtxt(io.StringIO("30.0")))',
        'import io\nimport numpy as np\ntext = io.StringIO("30.0")\nparams["Kp"] = float(np.loadtxt(text))',
        'k = 1.0\nif True:\n    def tune():\n        global k\n        k = 30.0\n    tune()\nparams["Kp"] = k',
    ],
)
def test_a_gain_that_is_set_in_an_unusual_way_is_graded(cell: str) -> None:
    head = 'params = {"Kp": 1.0}\n\ndef control(t, r, y, state, params):\n    return params["Kp"] * y, state'
    run = "import rds\nresult = rds.Experiment(controller=control, params=params).run()\nprint(params, result['rms'])"
    found = made(head, cell, run)
    assert found["control"](0.0, 0.0, 1.0, None, found["params"])[0] == 30.0  # type: ignore[operator]


@pytest.mark.parametrize("magic", ["%%writefile law.py", "%%file law.py", "\n%%writefile -a law.py"])
def test_a_law_that_is_only_written_into_a_file_is_refused_in_words(magic: str) -> None:
    law = "def control(t, r, y, state, params):\n    return 1.0, state"
    with pytest.raises(Refusal, match=r"cell 2 only writes law\.py .*take that line away"):
        converted(notebook("x = 1", f"{magic}\n{law}").encode())
    assert made(f"{magic}\n{law}", law)["control"]


def test_what_a_notebook_says_is_followed_in_little_memory() -> None:
    """Each import was kept once for each statement: 20 000 of them took the grader 6 GB."""
    tracemalloc.start()
    try:
        converted(notebook("\n".join(f"import zz{n} as a{n}" for n in range(1000))).encode())
        assert tracemalloc.get_traced_memory()[1] < 30 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ('globals()["params"]["Kp"] = 30.0', "globals"),
        ('for n in ["Kp"]:\n    exec(f"params[{n!r}] = 30.0")', "exec"),
        ('eval("params.update(Kp=30.0)")', "eval"),
        ("rds.run(exec('params[\"Kp\"] = 30.0'))", "exec"),
        ("rds.run([globals().update(params={})])", "globals"),
        ('vars()["params"] = {"Kp": 30.0}', "vars"),
        ('import sys\nsetattr(sys.modules[__name__], "params", {"Kp": 30.0})', "sys.modules"),
        ('import sys\nsys._getframe().f_globals["params"] = {"Kp": 30.0}', "f_globals"),
        ('from pathlib import Path\nparams["Kp"] = float(Path("k.txt").read_text())', "cell 2, line 2 .*files"),
        ('from pathlib import Path\nhere = Path("logs") / "k.txt"\nparams["Kp"] = float(here.read_text())', "files"),
        ('NAME = "k.csv"\nparams["Kp"] = float(open(NAME).read())', "cell 2, line 2 .*files"),
        ('import numpy as np\nread = np.loadtxt\nparams["Kp"] = float(read("k.csv"))', "cell 2, line 3 .*files"),
        ('from numpy import loadtxt as read\nparams["Kp"] = float(read("k.csv"))', "cell 2, line 2 .*files"),
        ('def get(name):\n    return open(name).read()\nparams["Kp"] = float(get("k.csv"))', "cell 2, line 3 .*files"),
        ('import __main__ as m\nm.params["Kp"] = 30.0', "import __main__"),
        ("%run -i tune.py", "%run"),
        ("%store -r params", "%store -r"),
        ("get_ipython().run_cell(\"params['Kp'] = 30.0\")", "run_cell"),
        (
            'for k in (10.0, 30.0):\n    params["Kp"] = k\n    rds.run(params=params)',
            "cell 2, line 1 .*modules that are not there",
        ),
        ('best = min((rds.run(Kp=k).rms, k) for k in (1.0, 30.0))\nparams["Kp"] = best[1]', "cell 2, line 2 "),
        ('def best():\n    global params\n    params = {"Kp": rds.run().rms}\nbest()', "cell 2, line 4 "),
        ('def tune():\n    found = rds.run()\n    params["Kp"] = found.rms\ntune()', "cell 2, line 4 "),
    ],
)
def test_what_cannot_be_followed_is_refused_in_words(cell: str, said: str) -> None:
    head = 'import rds, sys\nparams = {"Kp": 1.0}\ndef control(t, r, y, state, params):\n    return params["Kp"] * y, state'
    with pytest.raises(Refusal, match=f"cannot be graded as what it ran: .*{said}"):
        converted(notebook(head, cell).encode())


@pytest.mark.parametrize(
    "cell",
    [
        'p = dict(params)\np["Kp"] = 5.0\nrds.Experiment(controller=control, params=p).run().plot()',
        'def tried(k):\n    p = params | {"Kp": k}\n    return rds.run(params=p)\nfor k in (1.0, 2.0):\n    tried(k).plot()',
        "experiment = rds.Experiment(controller=control, params=params)\nexperiment.duration = 2.0\nexperiment.params = params\nexperiment.run()",
        'for k in (10.0, 20.0):\n    params["Kp"] = k\n    rds.run(params=params)\nparams["Kp"] = 30.0',
        'log = []\ndef control(t, r, y, state, params):\n    log.append(y)\n    return params["Kp"] * y, state\nrds.Experiment(controller=control, params=params).run()',
        "from functools import partial\nrun = partial(rds.run, controller=control, params=params)\nrun(frequency=1.0).plot()",
        "for name, value in params.items():\n    print(name, value)\n1 / 0",
        'import pandas as pd\ndf = pd.DataFrame({"Kp": [1.0, 2.0]})\ndf["rms"] = [rds.run(params={**params, "Kp": k}).rms for k in df["Kp"]]',
        'import sys\nif "google.colab" in sys.modules:\n    !pip install rds',
        "experiment = rds.Experiment(controller=globals(), duration=2.0)\nexperiment.run()\nrds.check(globals())",
        "def simulate(law, params):\n    ys = []\n    for k in range(9):\n        ys.append(law(0.0, 0.0, 1.0, None, params))\n    return ys\nys = simulate(control, params)",
        'class Pid:\n    def __init__(self): self.i, self.k = 0.0, 0.0\n    def step(self, e):\n        self.i += e\n        return self.k * self.i\n    def share(self, e):\n        return self.k * e\npid = Pid()\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] + pid.step(y) + pid.share(y), state\nus = [pid.step(e) for e in range(3)]\nplt.plot(us)\nu = pid.step(2.0)\nplt.title(f"{u}")',
        "class Pid:\n    def __init__(self): self.i, self.k = 0.0, 0.0\n    def step(self, e):\n        self.i += e\n        return self.k * self.i\n    def share(self, e):\n        return self.k * e\npid = Pid()\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] + pid.step(y) + pid.share(y), state\nplt.plot([pid.share(e) for e in range(3)])\nplt.plot(pid.share(2.0))",
        "class Pid:\n    def __init__(self): self.i, self.k = 0.0, 0.0\n    def step(self, e):\n        self.i += e\n        return self.k * self.i\n    def share(self, e):\n        return self.k * e\npid = Pid()\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] + pid.step(y) + pid.share(y), state\ndef simulate():\n    own = Pid()\n    return [own.step(e) for e in range(3)]\nplt.plot(simulate())",
        "class Pid:\n    def __init__(self): self.i, self.k = 0.0, 0.0\n    def step(self, e):\n        self.i += e\n        return self.k * self.i\n    def share(self, e):\n        return self.k * e\npid = Pid()\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] + pid.step(y) + pid.share(y), state\ndef simulate(law):\n    return [law.step(e) for e in range(3)]\nus = simulate(pid)\nplt.plot(us)",
        "class Pid:\n    def __init__(self): self.i, self.k = 0.0, 0.0\n    def step(self, e):\n        self.i += e\n        return self.k * self.i\n    def share(self, e):\n        return self.k * e\npid = Pid()\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] + pid.step(y) + pid.share(y), state\nrds.Experiment(controller=pid.step).run()",
        "import numpy as np\nK = np.ones(2)\nold = control\ndef control(t, r, y, state, params):\n    return old(t, r, y, state, params)[0] * K.max(), state\nplt.plot(K.argmax(), K.clip(0.0, 1.0), label=str(type(K)))",
        "log = []\nold = control\ndef control(t, r, y, state, params):\n    log.append(y)\n    return old(t, r, y, state, params)\ndef tried():\n    log.clear()\n    return rds.run(control)\ntried()",
        "class Bench:\n    def cost(self, p):\n        return rds.run(params=p).rms\nb = Bench()\ncosts = list(map(b.cost, [params]))",
        'import math, no_such\nfor k in (1.0, 2.0):\n    params["Kp"] = k\n    no_such.plot(k)\nparams["Kp"] = math.fsum([30.0])',
        'import no_such\nfor k in (1.0, 2.0):\n    params["Kp"] = k\n    no_such.plot(k)\nparams["Kp"] = 30.0',
    ],
)
def test_experiments_that_change_nothing_are_left_out(cell: str) -> None:
    """What honest notebooks do with their law: nothing of it is refused, and nothing that needs more is run."""
    head = 'import matplotlib.pyplot as plt\nimport rds\nparams = {"Kp": 30.0}\n\ndef control(t, r, y, state, params):\n    return params["Kp"] * y, state'
    found = made(head, cell)
    assert found["control"](0.0, 0.0, 1.0, None, found["params"])[0] == 30.0  # type: ignore[operator]
    assert not found.keys() & {"experiment", "df", "ys", "run"}


FITTED = "import rds\nimport pandas as pd\nimport numpy as np\nparams = {'K': 1.0, 'tau': 0.01}\nfit = rds.fit(rds.read_log('log.csv'), rds.structure('axis'))"
MODEL = 'def derivatives(t, x, u, params):\n    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]'


@pytest.mark.parametrize(
    "cell",
    [
        "K = fit.params['K']\nK = 1.6\nparams['K'] = K",
        "params['K'] = fit.params['K']\nparams['K'] = 1.6",
        "params = dict(fit.params)\nparams = {'K': 1.6, 'tau': 0.01}",
        "params.update(fit.params)\nparams['K'] = 1.6\nparams['tau'] = 0.01",
        "params.update(K=fit.params['K'])\nparams.update({'K': 1.6})",
        "params = {}\nparams['K'] = 1.0\nparams['tau'] = 0.3\nparams.update(fit.params)\nparams['K'] = 1.6\nparams['tau'] = 0.01",
        "K = fit.params['K']\nclass Gains:\n    def own(self):\n        return K\nK = 1.6\nparams['K'] = Gains().own()",
        "K, tau = 1.6, 0.01\nfor k in (1.0, 2.0):\n    params['K'] = k\n    rds.run(params)\nparams = {'K': K, 'tau': tau}",
        "df = pd.read_csv('log.csv')\nend = df.v.mean()\nu0 = 5.0\nparams['K'] = end / u0\nparams['K'] = 1.6",
        "data = np.loadtxt('log.csv')\nK = data[-1, 1] / 5.0\nK = 1.6\nparams['K'] = K",
        "data = np.load('log.npz')\nu, v = data['u'], data['v']\nK, offset = np.polyfit(u, v, 1)\nK = 1.6\nparams['K'] = K",
        "if __name__ == '__main__':\n    params['K'] = 1.6",
        "if ('__main__' == __name__): params['K'] = 1.6",
        "for _ in range(1):\n    if __name__ == '__main__' and params:\n        params['K'] = 1.6",
        "params['K'] = 1.6 if __name__ == '__main__' else 2.0",
        "__name__ = 'trial'\nif __name__ == 'trial':\n    params['K'] = 1.6",
        "def back():\n    params['K'] = 2.0\nparams['K'] = fit.params['K']\nback()\nparams['K'] = 1.6",
        "K = 1.6\nparams['K'] = K\nif __name__ == '__main__':\n    found = rds.run(params)\n    print(found)",
        "with open('log.csv') as file:\n    K = float(file.read())\nK = 1.6\nparams['K'] = K",
        "df = pd.read_csv('log.csv')\nfrom scipy.optimize import least_squares\ndef residuals(p):\n    return df.v - p[0] * df.u\nresult = least_squares(residuals, [1.0])\nK = result.x[0]\nK = 1.6\nparams['K'] = K",
        "df = pd.read_csv('log.csv')\nfrom scipy.optimize import minimize\ndef cost(p):\n    params['K'] = p[0]\n    return ((df.v - p[0] * df.u) ** 2).sum()\nminimize(cost, [1.0])\nparams['K'] = 1.6",
    ],
)
def test_a_fitted_parameter_that_is_set_again_by_hand_is_graded(cell: str) -> None:
    """What led to it (a log, a fit, a cost) need not be there where it is graded."""
    found = made(FITTED, cell, MODEL)
    assert found["derivatives"](0.0, [0.0, 1.0], [1.0], found["params"])[1] == pytest.approx(60.0)  # type: ignore[operator]


@pytest.mark.parametrize(
    "cell",
    [
        "params['tau'] = fit.params['tau']\nparams['K'] = 1.6",
        "params.update(fit.params)\nparams['K'] = 1.6",
        "params['K'], params['tau'] = fit.params.values()\nparams['K'] = 1.6",
        "params = fit.params\nparams['K'] = 1.6",
        "params['K'] = fit.params['K']\nparams['K'] *= 2.0",
        "params['K'] = fit.params['K']\nparams['K'] = 1.1 * params['K']",
        "params['K'] = fit.params['K']\nparams = {**params, 'tau': 0.02}",
        "params['tau'] = fit.params['tau']\nparams['K'] = 0.016 / params['tau']\nparams['tau'] = 0.012",
        "params['K'] = fit.params['K']\nparams.get('K')",
        "params['K'] = fit.params['K']\ninitial_state = [0.0, 0.0]",
        "params = {'K': 1.0}\nparams['tau'] = 0.3\nparams.update(fit.params)\nparams['K'] = 1.6",
        "base = {'tau': 0.3}\nparams = dict(K=1.0, **base)\nparams.update(fit.params)\nparams['K'] = 1.6",
        "if True:\n    params = {'K': 1.0, 'tau': 0.3}\nparams.update(fit.params)\nparams['K'] = 1.6",
        "g = [1.0, 0.02]\ng.sort(key=fit.rank)\ng[0] = 1.6\nparams['tau'] = g[1]",
        "K = 1.0\nK = fit.params['K']\ndef gain(k=K):\n    return k\nK = 1.6\nparams['K'] = gain()",
        "K = 1.0\ndef own():\n    return K\nK = fit.params['K']\ngain = own()\nK = 1.6\nparams['K'] = gain",
        "K = 1.0\ndef own(x):\n    return K * x\nK = fit.params['K']\ngains = list(map(own, [1.0]))\nK = 1.6\nparams['K'] = gains[0]",
        "K = 1.0\nK = fit.params['K']\nclass Gains:\n    own = K\nK = 1.6\nparams['K'] = Gains.own",
        "params['K'] = np.loadtxt('log.csv')[0]",
        # by another name, a function's argument, or a function of a function
        "q = params\nq['tau'], params['K'] = fit.params.values()\nparams['K'] = 1.6",
        "put = params.update\nparams['K'] = (put(tau=fit.tau), fit.K)[1]\nparams['K'] = 1.6",
        "def take(p):\n    p['tau'] = fit.tau\n    params['K'] = 2.0\ntake(params)\nparams['K'] = 1.6",
        "def take():\n    params['tau'] = fit.tau\ndef both():\n    params['K'] = fit.K\n    take()\nboth()\nparams['K'] = 1.6",
        "params['lag'] = 1.0\nfor key in list(params):\n    params[key] = fit.params[key]\nparams['K'] = 1.6\nparams['tau'] = 0.01",
        # read by a function, its default, or a class, before it is set again
        "def K():\n    return params['K']\nparams['K'] = fit.K\nparams['tau'] = 0.016 / K()\nparams['K'] = 1.6",
        "params['K'] = fit.K\ndef tau(K=params['K']):\n    return 0.016 / K\nparams['K'] = 1.6\nparams['tau'] = tau()",
        "params['K'] = fit.K\nclass Axis:\n    tau = 0.016 / params['K']\nparams['K'] = 1.6\nparams['tau'] = Axis.tau",
        # bound anew by a decorator and by a pattern that are not there
        "def gain():\n    return 1.0\n@rds.fast\ndef gain():\n    return 1.6\nparams['K'] = gain()",
        "K = 1.0\nmatch fit.K:\n    case K:\n        pass\nparams['K'] = K",
        "if __name__ == '__main__':\n    params['K'] = fit.params['K']",
    ],
)
def test_a_fitted_parameter_that_is_not_set_again_is_refused(cell: str) -> None:
    """The first value of `params` was graded in its place, because something else of `params` was set later."""
    with pytest.raises(
        Refusal, match=r"cannot be graded as what it ran: cell 2, .*files or modules that are not there"
    ):
        converted(notebook(FITTED, cell, MODEL).encode())


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded on Linux alone")
def test_a_file_is_read_with_bounded_memory_apart_from_the_batch() -> None:
    """What its author's statements make of the grader's memory ends that process's work, and not the computer's."""
    import resource

    def look(work: tuple[Spooled | None, tuple[str, ...]]) -> tuple[bool, int]:
        return isinstance(_converted(work), Converted), resource.getrlimit(resource.RLIMIT_AS)[0]

    law = notebook("def control(t, r, y, state, params):\n    return 1.0, state")
    before = resource.getrlimit(resource.RLIMIT_AS)
    (outcome,) = spread(look, [(Spool().put(law.encode()), INTERFACE)], jobs=1)
    assert outcome.value[0] and outcome.value[1] != resource.RLIM_INFINITY
    assert resource.getrlimit(resource.RLIMIT_AS) == before
