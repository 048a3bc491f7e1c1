"""What drawings need besides the core: the extra `drawing`, imported by those who trace."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from rds.core.errors import InputError

INSTALL = "pip install 'rds[drawing]'"
_PACKAGES = {"shapely": "shapely", "skimage": "scikit-image", "PIL": "pillow"}


def needed(module: str) -> ModuleType:
    """A module of the extra `drawing`; InputError with the command that installs it where it is missing."""
    try:
        return import_module(module)
    except ImportError as error:
        package = _PACKAGES[module.partition(".")[0]]
        raise InputError(f"tracing a drawing needs {package} ({error}); install it with: {INSTALL}") from error
