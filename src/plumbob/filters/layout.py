"""Places in the flat float64 arrays that every kernel shares: coefficients `c` and state `x`.

Flat arrays, not tuples, because a streamed call then passes two pointers; a filter's own entries come after these.
"""

from typing import Final

# Coefficients
UP: Final = 0  # +1 where the navigation z axis points up, −1 where it points down
NORTH_X: Final = 1  # horizontal unit vector that the magnetometer calls north, in the navigation frame
NORTH_Y: Final = 2
MAX_GAP: Final = 3  # s; a longer step is not integrated
OWN_C: Final = 4

# State
Q: Final = 0  # q_nb, 4
BIAS: Final = 4  # gyroscope bias in body axes, rad/s, 3
RATE: Final = 7  # last good rate in body axes, rad/s, 3
STAGE: Final = 10  # what has been initialised
HELD: Final = 11  # for how long the rate has been missing, s
COUNT: Final = 12  # samples taken
OWN: Final = 13

# Stages
BLIND: Final = 0.0
LEVEL: Final = 1.0
HEADED: Final = 2.0
