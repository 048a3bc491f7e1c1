"""Loops over a network: measured on a machine, and analysed from an experiment."""
