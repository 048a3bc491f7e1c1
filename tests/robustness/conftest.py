"""Model files and experiments that the tests of robustness share."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent / "identification"))
