"""What stands between the computer and the machine."""

from rds.interface.converter import as_voltage, converter
from rds.interface.encoder import diverged, encoder

__all__ = ["as_voltage", "converter", "diverged", "encoder"]
