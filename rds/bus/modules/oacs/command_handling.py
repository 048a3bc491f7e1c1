"""What a module does with a command from the host: each is acknowledged, if only to say why it is not carried out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rds.bus.modules.oacs.codes import OF_MOVE, THOUSAND, Acknowledges, Code, Move, Parameter, Quantity, Result, Select
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.bus.modules.oacs.module import OacsModule


def carry_out_command(module: OacsModule, fields: Mapping[str, Any], at: float) -> None:
    """Carry out, or refuse, the command with these fields, which arrived at the instant `at`, s."""
    code = fields["Code"]
    if code == Code.DATA_CALL:
        module.start_download(at)
    elif code == Code.MOVE:
        _move(module, Move(fields["Move"]), fields, at)
    elif code == Code.SET_PARAMETER:
        result = _set_parameter(module, Parameter(fields["Parameter"]), fields)
        module.acknowledge(Acknowledges.PARAMETER, result, at)
    elif code == Code.READ_PARAMETER:
        module.report_parameter(Parameter(fields["ReadIndex"]), at)
    elif code == Code.READINGS:
        done = module.readings.subscribe(Quantity(fields["Quantities"]), fields["ReadingsPeriod"], at)
        module.acknowledge(Acknowledges.READINGS, Result.CARRIED_OUT if done else Result.BAD_VALUE, at)
    elif code == Code.EMERGENCY:
        module.acknowledge(Acknowledges.EMERGENCY, module.reset_emergency(at), at)


def _move(module: OacsModule, move: Move, fields: Mapping[str, Any], at: float) -> None:
    mover = module.mover
    answers = OF_MOVE[move]
    if move == Move.STOP:
        mover.stop(Result.STOPPED_BY_COMMAND, at)
        result = Result.CARRIED_OUT
    elif module.commanded:
        result = Result.HOST_COMMANDS
    elif move == Move.SWITCH_DIRECTION:
        result = mover.switch_direction(at)
    elif module.plant.emergency:
        result = Result.EMERGENCY_LATCHED
    else:
        begins = module.slot(at)
        result = _begin(module, move, fields, begins)
        if result == Result.ACCEPTED:
            module.readings.begin(begins)
    module.acknowledge(answers, result, at)


def _begin(module: OacsModule, move: Move, fields: Mapping[str, Any], begins: float) -> Result:
    mover, plant = module.mover, module.plant
    direction = 1 if fields["Direction"] else -1
    if move == Move.HOME:
        return mover.home(begins)
    if plant.tool and move in (Move.TO_POINT, Move.JOG):
        return Result.NOT_FOR_THIS_MODULE
    if move == Move.JOG:
        return mover.jog(direction, fields["Value"], fields["Argument"] / THOUSAND, begins)
    if move == Move.TO_POINT:
        return mover.move(fields["Argument"] / THOUSAND, begins, Acknowledges.TO_POINT)
    amount = fields["Argument"] / THOUSAND if fields["Argument"] else float(fields["Value"])
    if amount <= 0.0:  # a distance of nothing, or one whose sign contradicts the direction
        return Result.BAD_VALUE
    if plant.tool:
        return mover.run(direction * amount, begins)
    here = plant.counts / plant.data.counts_per_unit
    return mover.move(here + direction * amount, begins, Acknowledges.START)


def _set_parameter(module: OacsModule, parameter: Parameter, fields: Mapping[str, Any]) -> Result:
    """Keep a value for later; SELECT makes all that were kept take effect, or none if they do not fit together."""
    mover = module.mover
    try:
        if parameter != Parameter.SELECT:
            module.draft = module.draft.with_parameter(parameter, fields["ParameterValue"])
            return Result.CARRIED_OUT
        if mover.motion is not None:
            return Result.BUSY
        module.draft = module.draft.with_controller(Select(fields["Selection"]))
    except (InputError, ValueError):
        module.draft = mover.tuning
        return Result.BAD_VALUE
    mover.tuning = module.draft
    return Result.CARRIED_OUT
