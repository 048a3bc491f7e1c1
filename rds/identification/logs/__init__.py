"""Logs of real axes: tables in many formats to arrays with units, and what they say about themselves."""
