"""Machines as data."""

from rds.machines.machine import Axis, Converter, Machine, load_machine, machine_names

__all__ = ["Axis", "Converter", "Machine", "load_machine", "machine_names"]
