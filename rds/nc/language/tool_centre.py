"""G43.4, tool centre point control: while it is on, X Y Z are the tool's tip on the work, wherever the joints are.

The language knows no machine: where the tip is when it is switched on, only the machine's links tell. So the first move
afterwards names X, Y and Z, and so does the first one after G49.
"""

from __future__ import annotations

from rds.nc.language.blocks import COMPENSATION, COORDINATES, G92_SERIES, NON_MODAL, Block
from rds.nc.language.context import Context
from rds.nc.language.expressions import Fault

TCP = 434
# In the machine's coordinates, or moving those of the work, whose X Y Z do not lie along the axes now.
_REFUSED = frozenset((100, 280, 281, 300, 301, 530, 920))


def check_switch(m: Context, code: int) -> None:
    """Raises Fault for a tool offset that cannot be switched on now."""
    if code == TCP and not m.dialect.tcp:
        raise Fault(
            "tool centre point control needs a machine whose links have rotary axes (--machine xyzac); "
            "`rds nc canon` reads it `--with tcp`",
            f"g{code}",
        )
    if m.state.tcp and code not in (TCP, 490):
        raise Fault("tool centre point control (G43.4) is in force; write G49 on a line before", f"g{code}")


def switch(m: Context, code: int, offset: list[float]) -> None:
    """Switch it on or off where `code` says so. Raises Fault for an offset that is not along the tool."""
    if code == TCP and any(value for index, value in enumerate(offset) if index != 2):
        raise Fault("the tool's offset has more than a length (Z); G43.4 takes the length alone", f"g{code}")
    if code == TCP or m.state.tcp:
        m.out.call("TOOL_CENTRE_POINT", int(code == TCP))
        m.state.tcp, m.state.unplaced = int(code == TCP), 1


def check_words(g: dict[int, int]) -> None:
    """Raises Fault for what does not go with it."""
    word = g.get(NON_MODAL, -1)
    if word not in _REFUSED:
        word = g.get(COORDINATES, g.get(G92_SERIES, -1))
    if word == -1 and g.get(COMPENSATION, 400) != 400:
        word = g[COMPENSATION]
    if word != -1:
        raise Fault("it does not go with tool centre point control (G43.4); write it before, or after G49", f"g{word}")


def check_placed(m: Context, block: Block) -> None:
    """Raises Fault for a first move after switching that does not say where the tip goes."""
    straight = block.motion in (0, 10) and m.state.absolute
    if block.motion == 800:
        return
    if not straight or not {"x", "y", "z"} <= block.words.keys():
        said = "G43.4" if m.state.tcp else "G49, which ended G43.4,"
        raise Fault(f"the first move after {said} is a line (G0 or G1, in G90) with X, Y and Z; name all three")
    m.state.unplaced = 0
