"""Places in the flat float64 arrays that every kernel shares: coefficients `c` and state `x`.

Flat arrays, not tuples, because a streamed call then passes two pointers; a filter's own entries come after these.
"""

from typing import Final

# Coefficients
SIZE: Final = 0  # how many coefficients there are; in a streamed call the state follows them in one array
UP: Final = 1  # +1 where the navigation z axis points up, −1 where it points down
NORTH_X: Final = 2  # horizontal unit vector that the magnetometer calls north, in the navigation frame
NORTH_Y: Final = 3
MAX_GAP: Final = 4  # s; a longer step is not integrated
USE_MAG: Final = 5  # 0 where the magnetometer is not wanted
TRIAL_TIME: Final = 6  # s; see settling.py
OWN_C: Final = 7

# State
Q: Final = 0  # q_nb, 4
BIAS: Final = 4  # gyroscope bias in body axes, rad/s, 3
RATE: Final = 7  # last good rate in body axes, rad/s, 3
STAGE: Final = 10  # what has been initialised
HELD: Final = 11  # for how long the rate has been missing, s
COUNT: Final = 12  # samples taken
LAST: Final = 13  # what each triad said last, as one number, 3
SAME: Final = 16  # for how long it has said the same, s, 3
CLOCK: Final = 19  # see timing.py, 5
SEEN: Final = 24  # mean level and vertical part of the field, µT, and of how many; of filters with a covariance, 3
TRIAL: Final = 27  # see settling.py, 15
OWN: Final = 42

# Stages
BLIND: Final = 0.0
LEVEL: Final = 1.0
HEADED: Final = 2.0
