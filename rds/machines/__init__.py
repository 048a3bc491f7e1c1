"""Machines as data."""

from rds.machines.machine import Axis, AxisLimits, Converter, Machine, load_machine, machine_names

__all__ = ["Axis", "AxisLimits", "Converter", "Machine", "load_machine", "machine_names"]
