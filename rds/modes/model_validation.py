"""Model validation: the same voltage signal to the machine and to its model."""

from rds.core.clock import LatePolicy
from rds.modes.implementation import build
from rds.modes.loop.mode import Mode

MODE = Mode(
    "model-validation",
    "Model validation",
    "machine and models, on the same voltage",
    build,
    drivers="live",
    drives=("signal",),
    followed="modelled",
    late=LatePolicy(discard=True),
    validates=True,
)
