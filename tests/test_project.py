"""The lock file belongs to pyproject.toml, and names no place that packages come from."""

from __future__ import annotations

import re
import tomllib

from documents import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PINNED = re.findall(r"(?m)^([A-Za-z0-9][\w.-]*)==([^\s;\\]+)", LOCK)


def test_every_requirement_is_locked() -> None:
    versions: dict[str, set[Version]] = {}
    for name, version in PINNED:
        versions.setdefault(canonicalize_name(name), set()).add(Version(version))
    extras = PROJECT["project"].get("optional-dependencies", {})
    lists = [PROJECT["project"]["dependencies"], PROJECT["build-system"]["requires"], *extras.values()]
    wanted = [requirement for requirements in lists for requirement in requirements]
    for requirement in map(Requirement, wanted):
        if requirement.name == PROJECT["project"]["name"]:
            continue
        found = versions.get(canonicalize_name(requirement.name), set())
        assert any(version in requirement.specifier for version in found), f"{requirement}: run make lock"


def test_every_pin_has_hashes() -> None:
    entries = re.split(r"(?m)^(?=[A-Za-z0-9])", LOCK)[1:]
    assert len(entries) == len(PINNED) > 100
    assert all("--hash=sha256:" in entry for entry in entries)


def test_the_lock_names_no_place() -> None:
    assert not re.search(r"https?:|file:|--(extra-)?index|--find-links|@ ", LOCK)
