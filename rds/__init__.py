"""RDS: the rapid development system for machine-tool axes.

What a person types in a notebook, flat: `rds.Experiment(...)`, `rds.fit(...)`, `rds.PartProgram(...)`. Each name is
imported when it is first used, so that `import rds` is light.
"""

from importlib import import_module as _import
from typing import Any as _Any

# name: where it is defined; "module:name" where it is called otherwise there
_NAMES = {
    # runs
    "Experiment": "rds.modes.experiment",
    "steps": "rds.modes.experiment.steps",
    "PartProgram": "rds.nc.run.run",
    "Result": "rds.results",
    "open_result": "rds.results",
    "compare": "rds.results.compare",
    "lsim": "rds.modes.experiment.model_alone",
    "learn": "rds.modes.experiment.learning",
    # references and voltages
    "sinusoid": "rds.references",
    "square": "rds.references",
    "triangle": "rds.references",
    "constant": "rds.references",
    "multisine": "rds.references",
    "chirp": "rds.references",
    "staircase": "rds.references",
    "speed": "rds.references",
    "user": "rds.references",
    # machines, and what the three interfaces exchange
    "Machine": "rds.machines.machine",
    "load_machine": "rds.machines",
    "machine_names": "rds.machines",
    "Kinematics": "rds.machines.kinematics",
    "verdict": "rds.machines.configuration",
    "Model": "rds.core.types",
    "Controller": "rds.core.types",
    "library_model": "rds.models",
    "library_controller": "rds.controllers",
    "Reference": "rds.core.types",
    "LineSegment": "rds.core.types",
    "ArcSegment": "rds.core.types",
    # paths
    "interpolate": "rds.interpolators.path",
    "interpolator": "rds.interpolators.interpolator:library_interpolator",
    # checks
    "check_file": "rds.checks",
    "check_controller": "rds.checks",
    "check_model": "rds.checks",
    "check_interpolator": "rds.checks",
    # logs, models and designs
    "read_log": "rds.identification.logs.read_log",
    "Log": "rds.identification.logs.log",
    "shipped_log": "rds.identification.logs.shipped:path",
    "structure": "rds.identification.structures.structures",
    "fit": "rds.identification.fit.fit",
    "frequency_response": "rds.identification.fit.frequency_response",
    "validate": "rds.identification.validate.validate",
    "compare_models": "rds.identification.validate.validate",
    "read_model": "rds.identification.fit.model_file",
    "write_model": "rds.identification.fit.model_file",
    "design": "rds.identification.fit.design:design_tracking",
    "robustness": "rds.identification.robustness.study:study",
    # one function over many items
    "spread": "rds.core.parallel",
    # grading
    "grade": "rds.grading.batch.run:run_batch",
    # errors
    "RdsError": "rds.core.errors",
    "InputError": "rds.core.errors",
    "ContractError": "rds.core.errors",
    "MachineError": "rds.core.errors",
}

__all__ = [*_NAMES, "__version__"]


def __getattr__(name: str) -> _Any:
    if name == "__version__":
        from rds.core.installed import version

        return version()
    if name not in _NAMES:
        from difflib import get_close_matches

        near = get_close_matches(name, _NAMES, 1)
        meant = f"did you mean rds.{near[0]}? " if near else ""
        raise AttributeError(f"module 'rds' has no attribute {name!r}; {meant}dir(rds) lists what there is")
    module, _, called = _NAMES[name].partition(":")
    found = getattr(_import(module), called or name)
    if isinstance(found, type(_import)):  # a function
        from rds.core.options import known_keywords

        theirs, found = found, known_keywords(found)
        if found is not theirs:
            found.__module__, found.__qualname__ = __name__, name  # as it is looked for in another process
        globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
