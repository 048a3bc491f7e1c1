"""Python processes that tests start import python-can without asammdf, as our own programs do (rds/bus/tools/mf4.py).

It is on their PYTHONPATH: the small programs of tests, and what they start in turn, are users' programs otherwise, and
each of them would import asammdf and pandas, for seconds, where a test looks at something else.
"""

import sys


class _NotYet:  # no importlib.abc.MetaPathFinder: to import that takes as long as Python's own start
    """Python does not find asammdf while python-can is being imported."""

    def find_spec(self, name, path=None, target=None):
        importing = getattr(getattr(sys.modules.get("can"), "__spec__", None), "_initializing", False)
        if name == "asammdf" and importing:
            raise ModuleNotFoundError("asammdf is not imported with python-can in tests", name="asammdf")


sys.meta_path.insert(0, _NotYet())
