"""Model structures: which parameters a model has, and how it answers a log's commands."""

SIMULATION_ERROR = "simulation"  # the method of estimation that most structures take by default
INVERSE_DYNAMICS = "inverse-dynamics"  # takes held parameters, too
