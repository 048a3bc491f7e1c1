"""The `[axis.NAME.module]` table of a machine's file: what a distributed module knows of itself, and its board does.

Only modules that tell the host what they are (dialect oacs) need it; what it leaves out follows from the axis. Whether
the values make a module (a matrix that is a motion, a letter...) is the dialect's business.
"""

from __future__ import annotations

from dataclasses import replace

from rds.core.quantities import Choice, Flag, Items, Quantity, Table, Text
from rds.core.shared_quantities import CLOCK_DRIFT

KINDS = ("translational", "rotary", "tool")
GENDERS = ("male", "female", "neutral")
MOUNTED_BY, CARRIES_ON = "mounted_by", "carries_on"
MOTORS = ("stepper", "analogue", "pwm")
_PLACE = "position, in the axis's unit"
_READING = Quantity("reading of 10 bits", "", 0, 1023, whole=True)
_ROW = Items("row of the matrix", Quantity("entry of the matrix"), "4 numbers", 4)


def _not_negative(meaning: str, unit: str) -> Quantity:
    return Quantity(meaning, unit, low=0.0)


def _three(meaning: str) -> Items:
    return Items(meaning, _READING, "three whole numbers from 0 to 1023", 3)


INTERFACE = Table(
    "an interface",
    {
        "kind": Text("how it holds, such as bolted"),
        "size": Quantity("of its bolt circle or its slide", "mm", above=0.0),
        "gender": Choice("which side of the joint it is", GENDERS, "neutral"),
    },
    needed=("kind", "size"),
)
MODULE = Table(
    "what the module of the axis says of itself (`rds machine serve --dialect oacs`, or `dcs`), and its clock",
    {
        "board": Text("its controller board, for the reader"),
        "kind": Choice("kind of module; by default from the axis's unit", KINDS),
        "motor": Choice("on a serial line (dialect dcs): the motor behind the unit; by default analogue", MOTORS),
        "letter": Text("the axis letter in messages"),
        "kind_text": Text("what it answers to a general call: its kind"),
        "type_text": Text("what it answers to a general call: its type"),
        "drift": replace(CLOCK_DRIFT, meaning="how much too fast its clock goes"),
        "joint": Text("the joint of the kinematic chain that it is"),
        "initial": Quantity(f"initial {_PLACE}"),
        "start": Quantity(f"first {_PLACE} of the virtual axis"),
        "accuracy": _not_negative("accuracy", "axis unit"),
        "repeatability": _not_negative("repeatability, ±", "axis unit"),
        "counts_per_unit": _not_negative("encoder counts", "counts per axis unit"),
        "counts_per_turn": Quantity("encoder counts of a turn", "", low=0, whole=True),
        "least_speed": _not_negative("least speed", "axis unit per min"),
        "clockwise_speed": _not_negative("full speed clockwise", "axis unit per min"),
        "counterclockwise_speed": _not_negative("full speed counter-clockwise", "axis unit per min"),
        "supply": _not_negative("supply voltage of the motor driver", "V"),
        "overtravel": _not_negative("way beyond the travel at which the switch opens", "axis unit"),
        "debounce": _not_negative("how long a switch is open or closed until that counts", "s"),
        "response_call": _not_negative("time until it answers a call", "s"),
        "response_download": _not_negative("time until it answers a download", "s"),
        "current_start": _not_negative("current of the motor while it starts", "A"),
        "current_run": _not_negative("current of the motor while it runs", "A"),
        "counterclockwise_current_start": _not_negative("the same counter-clockwise", "A"),
        "counterclockwise_current_run": _not_negative("the same counter-clockwise", "A"),
        "current_swing": _not_negative("by which the current swings about its mean in each turn of the screw", "A"),
        "lead": _not_negative("way of the axis in a turn of its screw", "axis unit"),
        "current_peak": _not_negative("largest current of the motor, starting or working", "A"),
        "interrupt_service": _not_negative("time that an encoder's interrupt takes", "s"),
        "interrupt_pause": _not_negative("time for which the board serves no interrupt", "s"),
        "interrupt_every": _not_negative("how often such a pause begins", "s"),
        "accelerometer": _three("readings at rest, x, y and z"),
        "vibration": _three("amplitude of the readings at full speed, x, y and z"),
        "matrix": Items("the module's homogeneous transformation", _ROW, "4 rows of 4 numbers", 4),
        "switches": Flag("it has limit switches"),
        "load_cell": Flag("of a cutting head: a load cell measures the cutting force (dialect rds)"),
        MOUNTED_BY: replace(INTERFACE, meaning="the interface by which it is mounted"),
        CARRIES_ON: replace(INTERFACE, meaning="the interface on which it carries the next module"),
        "accessory": Text("the accessory mounted on it, which has no board: its type text in the library"),
    },
)
