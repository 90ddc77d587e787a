"""Which row of the kernels' arrays holds what: one column a lane.

The kernels take a few packed arrays instead of many, because each array argument costs a call about
0.2 µs. ``lanes`` is floating point, ``counters`` int64, ``road`` one row a segment, ``outcome`` what a
step returns beside the observation.
"""

from __future__ import annotations

# lanes: (blocks, rows, lanes of a block), so that a block is one piece of memory.
# The state:
ALONG = 0  # m from the start of the present road segment
LATERAL = 1  # lateral error d, m; from here on in the order of the observation
HEADING = 2  # heading error theta, rad
YAW_RATE = 3  # rad/s
SPEED = 4  # m/s
STEER = 5  # road-wheel angle, rad
COMMAND = 6  # command that entered the actuator in this control step, rad
# The present road segment:
SEGMENT_LENGTH = 7  # m
CURVATURE = 8  # at the segment's start, 1/m
CURVATURE_SLOPE = 9  # 1/m²
SPEED_SQUARED = 10  # at the segment's start, m²/s²
SPEED_SQUARED_SLOPE = 11  # twice the longitudinal acceleration, m/s²
STATION = 12  # arc length at the segment's start, m
# The car:
CAR = 13  # l_f, l_r, 1/m, 1/J, C_f, C_r, peak_f, peak_r
CAR_SIZE = 8
STEER_RESPONSE = 21  # share of the remaining way that the actuator goes in half a sub-step
STEER_CHANGE = 22  # largest change of the road-wheel angle in half a sub-step, rad
# Results of the step:
STEER_BEFORE = 23  # road-wheel angle at the start of the control step, rad
SIDESLIP = 24  # beta, rad
ACCELERATION = 25  # lateral, m/s²
STEP = 26  # control steps done in this episode
DONE = 27  # 1 after the episode's last step, until the lane is reset
DEPARTED = 28  # 1 once the car has left the lane in this episode
# This episode's car beside CAR:
SPEED_FACTOR = 29  # of the squared speeds of the road's profile
DELAY = 30  # of the command, in sub-steps
# The delay line, where there is a delay:
DELAYED_FIRST = 31  # delayed command before ... , rad
DELAYED_THEN = 32  # ... and from the sub-step at which it changes, rad
ACTING = 33  # the one of them that acts in the present sub-step, rad
LANE_ROWS = 34  # further rows, as many as needed: commands (newest first), then the sensors' rows

# counters: (rows, n) int64
KEY = 0  # base key of the lane (a uint64, reinterpreted)
EPISODE = 1  # number of the episode under that key
SEGMENT = 2  # row of the present segment in ``road``
CLIPPED = 3  # actions outside [-1, 1] since the environment was made
ROAD = 4  # index of the road in the set
COUNTER_ROWS = 5

# road: (segments, columns) float
R_LENGTH = 0
R_CURVATURE = 1
R_CURVATURE_SLOPE = 2
R_SPEED_SQUARED = 3
R_SPEED_SQUARED_SLOPE = 4
R_NEXT = 5  # row of the segment behind this one
R_STATION = 6  # arc length at the segment's start, m
R_PREVIOUS = 7  # row of the segment before this one, -1 at the start of an open road
ROAD_COLUMNS = 8

# roads: (roads, columns) float64, read at resets only
S_FIRST = 0
S_COUNT = 1
S_LATEST_START = 2  # largest arc length at which an episode starts, m

# settings: one float vector, constant for a scenario
STEP_TIME = 0  # integration step h, s
SUBSTEPS = 1
MODEL = 2
IDEAL_STEERING = 3
DELAY_DEPTH = 4  # commands remembered, 0 without delay
ACTION_KIND = 5
ACTION_SCALE = 6  # rad or rad/s at action 1
COMMAND_LIMIT = 7  # rad
HALF_LANE = 8  # m
DEPARTURE = 9
COST_WEIGHT = 10
COST_RATE = 11  # reference steering rate, rad/s
COST_CAP = 12  # 1/s
COST_LATERAL = 13  # reference lateral error, m
MAX_STEPS = 14  # after which a lane is truncated
AUTORESET = 15
PREVIEW = 16
PREVIEW_TIME = 17  # s between samples
FULL = 18
START_LATERAL = 19  # m, either side
START_HEADING = 20  # rad, either side
HORIZON = 21  # steps for whose rest a departure is charged
LATERAL_LIMIT = 22  # largest lateral acceleration of the speed profile, m/s²; 0 for a constant speed
NOMINAL = 23  # the nominal car: mass, yaw inertia, l_f, l_r, C_f, C_r, friction, lag, rate limit, delay
NOMINAL_SIZE = 10
RANGES = 33  # low and high of each randomised number, in the order of `Randomisation`
RANGES_SIZE = 16
BOUNDS = 49  # low and high of each channel follow, channel by channel

# sensors: (MEASURED, SENSOR_SIZE), or None where all are perfect
MEASURED = 5  # lateral_error, heading_error, yaw_rate, speed, steering_angle
SENSOR_SIZE = 8  # noise, bias, resolution, period and delay (control steps), dropout, jump, jumps a sample

# values of the switches
KINEMATIC, LINEAR, MAGIC_FORMULA = 0, 1, 2
STEERING_ANGLE, STEERING_RATE = 0, 1
TERMINATE, COST, OFF = 0, 1, 2
NO_AUTORESET, NEXT_STEP, SAME_STEP = 0, 1, 2

# outcome: (rows, n) float. In same-step autoreset OUTCOME_ROWS and as many rows as there are channels follow:
# what the last step of an ended episode gave, and its observation.
O_REWARD = 0
O_TERMINATED = 1
O_TRUNCATED = 2
O_LATERAL_ERROR = 3
O_HEADING_ERROR = 4
O_LATERAL_ACCELERATION = 5
O_STEERING_RATE = 6
O_SPEED = 7
O_ARC_LENGTH = 8
O_COST = 9
O_SUCCESS = 10
OUTCOME_ROWS = 11

# start: (rows, n) float64; NaN means drawn by the episode's key
START_ROWS = 4  # lateral error, heading error, arc length, road index
