"""The clauses of the three fixed interfaces, as faults name them."""

ARGUMENTS = "right arguments"
PARAMS = "params is a dict of defaults"
INITIAL_STATE = "initial_state"
RUNS = "runs without an error"
RETURNS = "comes back"
TIME = "time per call"

# controller
PAIR = "returns (voltage, next_state)"
VOLTAGE = "finite voltage"
NEXT_STATE = "usable next_state"
SIGNALS = "returns the signals that it declares"
SAVED_STATE = "works with a saved and restored state"
MEMORY = "keep all memory in `state`"
DETERMINISTIC = "deterministic: same arguments, same answer"
UNCHANGED = "leaves its arguments as they are"

# model
SHAPE = "one value per state"
FINITE = "finite values"
OUTPUT = "one finite output"
NO_MEMORY = "keep no memory outside x"
AT_REST = "at rest without voltage"
SAMPLE_TIME = "advance over T"

# interpolator
ROWS = "yields (position, velocity, acceleration)"
AXES = "one value per axis"
ENDS = "terminates"
START = "starts at the segment's start"
END = "ends at the segment's end"
PATH = "stays on the path"
VELOCITY = "velocity agrees with position"
FEED = "takes the time that the feed rate gives"
SWEEP = "goes round the arc in its direction"
SEGMENTS = "kinds of segments"
NO_GLOBALS = "keep no memory between calls"

# file
PRINTS = "no printing"
OTHERS = "other functions"
