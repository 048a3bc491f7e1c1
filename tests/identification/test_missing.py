"""What a fit's residuals hold is named: the option that explains them, or that none does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rds.identification.fit.fit import fit
from rds.identification.fit.missing_options import missing_option, with_hint
from rds.identification.logs import shipped
from rds.identification.logs.log import Log
from rds.identification.structures.structures import structure
from tests.identification.fit_logs import mini_cnc

T = 1e-3  # s


def moved(**added: float) -> Log:
    """2 s of the X axis with what `added` says, behind an encoder of 1 µm."""
    t = np.arange(2000) * T
    u = 3.0 * np.sin(2.0 * np.pi * 0.9 * t) + 1.5 * np.sin(2.0 * np.pi * 2.3 * t + 1.0)
    values = mini_cnc("X") | added
    if "offset" in added:
        values["friction"] = values.pop("friction_plus")
        del values["friction_minus"]
    named = structure("axis", [name.replace("_", "-") for name in added])
    y = named.respond(t, u, [0.0] * named.states, values)
    return Log("moved", t, u, np.rint(y / 1e-3) * 1e-3, resolution=1e-3, units={"position": "mm"})


@pytest.mark.parametrize("added", [{"delay": 0.003}, {"offset": 0.6}])
def test_the_option_that_is_missing_is_named(added: dict[str, float]) -> None:
    log = moved(**added)
    estimate = fit([log], structure("axis"))
    hint = missing_option(estimate, [log])
    (name,) = added
    assert hint is not None and hint.startswith(f"try --option {name}: over 2000 samples it would leave ")
    assert with_hint(estimate, [log]).warnings == (*estimate.warnings, hint)
    assert missing_option(fit([log], structure("axis", [name])), [log]) is None  # nothing is left to be explained


def test_a_command_that_was_logged_after_it_acted_is_named() -> None:
    log = moved()
    late = replace(log, command=np.concatenate([np.zeros(5), log.command[:-5]]))
    hint = missing_option(fit([late], structure("axis")), [late])
    assert hint is not None and hint.startswith("the command comes too late in this log, by about 5 ms"), hint


def test_several_things_are_named_one_after_the_other() -> None:
    """The Z axis of the mini CNC has Stribeck friction and play."""
    log = shipped.log("mini-cnc-Z-steps").part(0, 2000)
    hint = missing_option(fit([log], structure("axis")), [log])
    assert hint is not None and hint.startswith("try --option stribeck: ")


def test_what_no_option_explains_is_said_to_be_so() -> None:
    log = moved()
    log = replace(log, position=log.position + 0.05 * np.sin(2.0 * np.pi * 7.0 * log.time), resolution=None)
    hint = missing_option(fit([log], structure("axis")), [log])
    assert hint is not None and hint.startswith("a short search found none of the other options of structure axis")
    assert "viscous" not in hint


def test_a_structure_of_one_s_own_and_other_methods_have_no_options_to_try() -> None:
    log = moved(delay=0.003)
    estimate = fit([log], structure("axis"))
    assert missing_option(replace(estimate, method="inverse-dynamics"), [log]) is None
    assert missing_option(replace(estimate, structure="mine.py"), [log]) is None
