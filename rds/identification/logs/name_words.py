"""What the words of a column's name tell of its quantity, in the languages of the logs that were met."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_DRIVING = frozenset(("torque", "force", "effort", "drehmoment", "kraft"))
_VOLTAGES = _words("voltage volt volts spannung motorspannung ankerspannung voltaje voltagem tensao tensione")
_CURRENTS = _words("current amps strom iststrom motorstrom ankerstrom i amperage corrente corriente courant")
_ACTS = _DRIVING | _VOLTAGES | {"current", "strom", "motorstrom", "ankerstrom"}
# words of names, lower case, that tell a quantity; the first that fits
_WORDS: Mapping[str, frozenset[str]] = {
    "time": _words("time t zeit timestamp timestamps elapsed seconds zeitstempel tempo tiempo"),
    "reference": _words(
        "reference ref setpoint sp set des desired target commanded soll demand qg sollposition lagesollwert "
        "solldrehzahl sollgeschwindigkeit drehzahlsollwert referencia consigna consigne riferimento"
    ),
    "velocity": _words(
        "velocity velo vel speed rpm v rate omega dq geschwindigkeit drehzahl istdrehzahl istgeschwindigkeit "
        "drehzahlistwert velocidade velocidad vitesse velocita"
    ),
    "current": _CURRENTS,
    "command": _words("command cmd u input control vir pwm duty dutycycle").union(_DRIVING, _VOLTAGES),
    "position": _words(
        "measured position pos encoder enc y x q qm ist output angle theta counts feedback actual act istposition "
        "lageistwert lage weg istweg posicao posicion posizione salida"
    ),
}
# never what was measured
_OTHERS = _words(
    "modelled simulated model error err acceleration accel acc difference diff deviation lag temperature temp "
    "fehler abweichung regelabweichung schleppfehler schleppabstand temperatur"
)
# what drives nothing: supplies, and where no command is named, what sensors answer and what acts from outside
_SUPPLIES = _words(
    "supply bus dcbus busvoltage battery batt vbus vbat dclink sensor zwischenkreisspannung versorgungsspannung "
    "batterie vdc udc zk uzk rail mains netzspannung"
)
_SUPPLY_PAIRS = ({"dc", "link"},)
_NO_DRIVES = _words(
    "tacho tachometer tachogenerator potentiometer poti encoder resolver lvdt strain loadcell cell ain "
    "friction disturbance external load brake braking reaction contact cutting process "
    "reibung reibmoment lastmoment stoermoment bremsmoment"
)
_NO_DRIVE_PAIRS = ({"analog", "input"},)
_COMMANDS = _words(
    "command cmd commanded setpoint demand stellgroße stellgroesse stellsignal sollspannung sollstrom sollmoment "
    "sollkraft motorspannung ankerspannung"
)
_COMMANDED = {"command", "cmd"}
_GOALS = _words("position pos angle velocity velo vel speed rpm")  # of which a command is where the axis is to go
_AT_THE_MOTOR = _words("motor armature output applied control u vm phase motorspannung ankerspannung")
# bounds, and lengths and angles that are no position; but what is corrected by them, or comes behind them, is one
_BOUNDS = _words("limit limits limitation grenze maximum minimum max min")
_NO_PLACES = _words(
    "offset compensation correction tolerance thickness diameter backlash electrical elec commutation phase "
    "limit limits limitation max min"
)
_BEHIND = _words("after with without corrected compensated nach mit ohne korrigiert kompensiert")

_GAPS = re.compile(r"[\W_\u2e80-\uffff]+|(?<=[a-z])(?=[A-Z])|(?<=[A-Z]{2})(?=[A-Z][a-z])")  # motorVoltage, DCBus


def role(name: str) -> str | None:
    """The quantity that a name tells: a key of `_WORDS`."""
    words = [word.lower().rstrip("0123456789") or word for word in _tokens(name)]  # time1, u2
    acts = bool(_ACTS & set(words))  # a target torque is what drives the axis, and not where it is to go
    if not acts and _COMMANDED & set(words) and _GOALS & set(words):
        return "reference"
    return next(
        (r for r, known in _WORDS.items() if any(word in known for word in words) and not (acts and r == "reference")),
        None,
    )


def words_of(name: str) -> frozenset[str]:
    """The words of a name, lower case."""
    return frozenset(word.lower() for word in _tokens(name))


def is_never_measured(name: str) -> bool:
    """Whether a column of this name is computed, as a model's answer or an error."""
    return bool(_OTHERS & words_of(name))


def drives_nothing(name: str) -> bool:
    """Whether a voltage, current or force of this name is none that drives the axis."""
    words = words_of(name)
    if _SUPPLIES & words or any(pair <= words for pair in _SUPPLY_PAIRS) or (_BOUNDS & words and not _BEHIND & words):
        return True
    return not _COMMANDS & words and bool(_NO_DRIVES & words or any(pair <= words for pair in _NO_DRIVE_PAIRS))


def is_commanded(name: str) -> bool:
    """Whether a name says that a controller commands it, as `torque cmd` does."""
    return bool(_COMMANDS & words_of(name))


def is_at_the_motor(name: str) -> bool:
    """Whether a voltage of this name is surely the motor's, and not that of a drive's supply."""
    return bool(_AT_THE_MOTOR & words_of(name))


def is_no_place(name: str) -> bool:
    """Whether a length, angle or speed of this name is not that of the axis."""
    words = words_of(name)
    return bool(_NO_PLACES & words) and not _BEHIND & words


def _tokens(name: str) -> list[str]:
    """The words of a name without their accents: an accent is no gap between words, a Chinese character is one."""
    plain = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    return [word for word in _GAPS.split(plain) if word]
