"""Packages that not every installation has: which extra brings each, and what to say where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.installed import install_command

# By the name that is imported: the extra of pyproject.toml ("": always required), and the package's own name.
_PACKAGES = {
    "scipy": ("analysis", "scipy"),
    "control": ("analysis", "control"),
    "pandas": ("tables", "pandas"),
    "pyarrow": ("tables", "pyarrow"),
    "numba": ("fast", "numba"),
    "ruckig": ("motion", "ruckig"),
    "asammdf": ("mdf", "asammdf"),
    "h5py": ("hdf5", "h5py"),
    "skimage": ("drawing", "scikit-image"),
    "shapely": ("drawing", "shapely"),
    "PIL": ("drawing", "pillow"),
    "distributed": ("cluster", "distributed"),
    "dask": ("cluster", "dask"),
    "pyseccomp": ("grading", "pyseccomp"),
    "nbformat": ("grading", "nbformat"),
    "pylti1p3": ("lti", "pylti1p3next"),
    "cryptography": ("lti", "pylti1p3next"),
    "yaml": ("grading", "pyyaml"),
    **{name: ("lab", name) for name in ("ipywidgets", "jupyterlab", "voila", "ipympl", "anywidget", "k3d")},
    **{name: ("lab", name) for name in ("sphinx", "furo")},
    "traitlets": ("lab", "ipywidgets"),
    "IPython": ("lab", "ipywidgets"),
    "myst_parser": ("lab", "myst-nb"),
    "cantools": ("", "cantools"),
}


def remedy(extra: str) -> str:
    """The command that installs an extra, for messages."""
    return install_command(extra, sorted({package for of, package in _PACKAGES.values() if of == extra}))


def missing(
    module: str, what: str, instead: str = "", where: str | None = None, extra: str | None = None
) -> InputError:
    """The error that `what` (as in "tracing a drawing") needs a package that is not installed, with the command for it.

    `module` is what is imported, `instead` another way out, `extra` its extra where the table above has none.
    """
    known, package = _PACKAGES.get(module.partition(".")[0], ("lab", module.partition(".")[0]))
    command = install_command(known if extra is None else extra, [package])
    other = f"; or {instead}" if instead else ""
    return InputError(f"{what} needs {package}, which is not installed; install it with: {command}{other}", where)


def there(module: str) -> bool:
    """Whether a package is installed; it is not imported."""
    return find_spec(module) is not None


@contextmanager
def needed_for(what: str, instead: str = "", where: str | None = None) -> Iterator[None]:
    """Around an import of a package of an extra: InputError that `what` needs it, where it is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = error.name or ""
        if name.partition(".")[0] not in _PACKAGES:
            raise
        raise missing(name, what, instead, where) from error


def python_control(what: str) -> Any:
    """The package control, which `what` needs. InputError where it is missing, or where a file of the user's is found
    in its place: a law called control.py, beside the notebook that designs one.
    """
    with needed_for(what):
        import control
    file = control.__file__
    if file and Path(file).name == "control.py":  # the package's is its __init__.py
        raise InputError(
            f"{what} needs the package control, and this file is found in its place: rename it and start Python anew",
            file,
        )
    return control
