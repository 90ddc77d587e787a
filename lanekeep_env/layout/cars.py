"""Rows of the cars and of their counters, a column each."""

from __future__ import annotations

# cars: (blocks, rows, cars of a block), so that a block is one piece of memory.
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
CG_TO_FRONT = 13  # l_f, m
CG_TO_REAR = 14  # l_r, m
INVERSE_MASS = 15  # 1/kg
INVERSE_INERTIA = 16  # 1/(kg m²)
FRONT_STIFFNESS = 17  # of the axle, N/rad
REAR_STIFFNESS = 18
FRONT_PEAK = 19  # largest force of the axle, N
REAR_PEAK = 20
CAR, CAR_SIZE = CG_TO_FRONT, 8  # the rows that the equations take, in their order
STEER_RESPONSE = 21  # share of the remaining way that the actuator goes in half a sub-step
STEER_CHANGE = 22  # largest change of the road-wheel angle in half a sub-step, rad
# Results of the step:
STEER_BEFORE = 23  # road-wheel angle at the start of the control step, rad
SIDESLIP = 24  # beta, rad
ACCELERATION = 25  # lateral, m/s²
STEP = 26  # control steps done in this episode
DONE = 27  # 1 after the episode's last step, until the car is reset
DEPARTED = 28  # 1 once the car has left the lane in this episode
# This episode's car beside CAR:
SPEED_FACTOR = 29  # of the squared speeds of the road's profile
DELAY = 30  # of the command, in sub-steps
# The delay line, where there is a delay:
DELAYED_FIRST = 31  # delayed command before ... , rad
DELAYED_THEN = 32  # ... and from the sub-step at which it changes, rad
ACTING = 33  # the one of them that acts in the present sub-step, rad
# The steering gear, where there is backlash:
MOTOR = 34  # motor angle in terms of the road wheel, rad
STEER_GAIN = 35  # share of the remaining way that the motor would go in half a sub-step at its present speed
# Set speeds in time, where the speed does not come from the road:
SPEED_TARGET = 36  # m/s; with a powertrain the fastest in the direction that is engaged, negative in reverse
# The camera:
EDGE = 37  # distance from the road's edge, m; NaN where none is seen
# Walled worlds, where ALONG and LATERAL are x and y, HEADING counts from the x axis, and STATION along the centre line:
SERVO = 38  # angle that the servo turns the road wheel to, rad
STEER_OFFSET = 39  # what the road wheel has more than that in this episode, rad; on roads as well
RIGHT = 40  # distance of the walls in the cone of the ultrasonic to the right, m; NaN where it meets none
LEFT = 41
FRONT = 42
WAY = 43  # driven by the wheels, m
WHEEL_SPEED = 44  # as the encoder tells it, m/s
TICKS = 45  # of the encoder at the last control step
PROGRESS = 46  # along the centre line since the start, m
LAP_BEGAN = 47  # s
LAP_TIME = 48  # of the last lap, s; 0 before
CLEARANCE = 49  # distance of the body from the nearest wall, m
# At the start of the control step:
BEFORE_X = 50  # m
BEFORE_Y = 51  # m
BEFORE_HEADING = 52  # rad
BEFORE_SPEED = 53  # m/s
LAPS_DONE = 54  # in this episode
BLOCKED = 55  # 1 where the start that was drawn or asked for lay in or beyond a wall, and the world's own was taken
# Cars with a powertrain:
PULL = 56  # longitudinal acceleration, m/s²
PEDAL = 57  # asked for: throttle where positive, brake where negative, -1 to 1
THROTTLE = 58  # 0 to 1
BRAKE = 59  # 0 to 1
GEAR = 60  # 0 for the first, -1 for reverse
SHIFT = 61  # sub-steps until a gear change may follow that takes back the last one
SLOPE = 62  # sine of the road's rise
WIND = 63  # headwind, m/s
SET_SPEED = 64  # m/s
LEAD_GAP = 65  # to the car ahead, m; NOWHERE for none
LEAD_SPEED = 66  # m/s
STOP_GAP = 67  # to the stop point, m; FAR for none
EVENT = 68  # number of the timeline's next event
CURVATURE_HERE = 69  # of the road at the car, 1/m; where the observation is full
# Between walls, of the control step:
ERROR = 70  # lateral, m
TURNED = 71  # heading error, rad
SCAN_NEW = 72  # 1 where the scan was renewed
DIVERGED = 73  # 1 where the state is no number any more
# On courses, which have tasks that follow each other, and parking spaces:
MODE = 74  # ROUNDTRIP, OBSTACLES or PARK
PARKED = 75  # control steps for which the car has stood inside a space
SHARE = 76  # of the car that is inside a space
KERB_DISTANCE = 77  # of the body from the kerb of that space, m; FARTHEST outside of any
SPACE_AHEAD = 78  # middle of the world's longest space from the middle of the body, along the space's kerb, m ...
SPACE_LEFT = 79  # ... and to the left
SPACE_TURNED = 80  # heading minus that of the kerb, rad
SPACE_LENGTH = 81  # m
# Rows from here on are shared by cars that are never one: with a driver, whom an assistant may override:
DRIVER = 82  # road-wheel angle that the driver asks for, rad
AUTHORITY = 83  # share of the assistant in the command, 0 to 1 ...
AUTHORITY_BEFORE = 84  # ... and in the control step before
ASSISTANCE = 85  # what the assistant adds to the driver's angle, rad
LAPSE = 86  # control steps until a driver who does not look looks at the road again
AIM = 87  # where the driver wants to be, m left of the lane's centre
INTERVENTIONS = 88  # of the assistant in this episode
HANDOVER = 89  # largest change of the assistance in a step in which the authority changed, rad
SET_POINT = 90  # distance from the road's edge that a camera-guided car is to keep, m
# ... or with a powertrain:
SHIFTED = 82  # direction of the last gear change: 1 up, -1 down
FRONT_GRIP = 83  # largest force of the axle before engine and brake took theirs, N ...
REAR_GRIP = 84
LEAD_TARGET = 85  # speed that the car ahead goes to, m/s ...
LEAD_RATE = 86  # ... and how fast, m/s²
LEAD_SEEN = 87  # its speed as far as it is in sight, m/s; 0 elsewhere
PULL_BEFORE = 88  # longitudinal acceleration at the start of the control step, m/s²
LEAD_SIGHT = 89  # what was seen when the car ahead came: SIGHT_SIZE rows
STOP_SIGHT = 96  # the same of the stop point
# of a sight:
SIGHT_STEP = 0  # control step whose observation was the first to show it, -1 for that of the reset
SIGHT_GAP = 1  # at the start of that step, as all that follows, m
SIGHT_SPEED = 2  # own, m/s
SIGHT_PULL = 3  # own acceleration, m/s²
SIGHT_SEGMENT = 4  # of the road
SIGHT_ALONG = 5  # m
SIGHT_EVENT = 6  # number of the timeline's event that brought it
SIGHT_SIZE = 7
AVOIDABLE = 103  # 1 where full braking in time had avoided the contact or overrun of this step
FAILED = 104  # code of `Termination` of the last contact or overrun of this episode, 0 for none
RATIO = 105  # engine over wheel's way in the gear engaged, rad/m
ENDING = 106  # code of `Termination` of the contact or overrun of this step, 0 for none
EVENT_STEP = 107  # control step at which the timeline's next event is due
UP_FROM = 108  # speed from which on a gear change up may be due, m/s
DOWN_BELOW = 109  # speed below which one down may be due without kick-down, m/s
DUE = 110  # 1 where an event or a gear change may be due at the start of the control step
POSITION_GAP = 111  # way along the road to the set position, m; NOWHERE for none
POSITION_SPEED = 112  # its speed, m/s ...
POSITION_PULL = 113  # ... and acceleration, m/s²
POSITION_TARGET = 114  # speed that it goes to, m/s ...
POSITION_RATE = 115  # ... and how fast, m/s²
# Among traffic:
LANE = 116  # number of the nearest lane, 0 for the right-most
LANE_OFFSET = 117  # from its middle, m, left positive
LEAD_NUMBER = 118  # of the car ahead, 0 for none
LEAD_OURS = 119  # 1 where it is ahead because the car came into its lane
PLACE_BEFORE = 120  # arc length of the road at the end of the control step before, m
LANE_SINCE = 121  # control step in which it came to its lane, 0 for the start
LANE_END = 122  # way from the car's front to the end of lane 0, m; NOWHERE where it does not end
# Where something disturbs the car:
STEER_FACTOR = 123  # of what the actuator is told that the road wheel turns by
TOLD = 124  # angle that the road wheel is turned to on roads, with both faults, rad
BANK = 125  # roll angle of the road, rad
CROSSWIND = 126  # to the left, with its gust, m/s
MEAN_WIND = 127  # without it, m/s
GUST = 128  # m/s
SIDE_WEIGHT = 129  # what the bank pulls to the left with, N
WIND_AREA = 130  # half density times the car's side area, N s²/m²
WIND_LEVER = 131  # centre of wind pressure ahead of the centre of gravity, m
FRONT_HOLD = 132  # largest force of the axle off any patch, N
REAR_HOLD = 133
FRICTION_HERE = 134  # largest force of the front axle over its load on a level road
CHANGES_AT = 135  # control step from which on the car is another, -1 for never ...
CHANGES_UNTIL = 136  # ... and from which on it is itself again
DRAWN = 137  # what the episode drew of INVERSE_MASS to REAR_PEAK, DRAWN_SIZE rows ...
DRAWN_SIZE = 6
DRAWN_LAG = 143  # ... and the lag of the steering, s
# Where the motor's way costs, at the start of the control step:
MOTOR_BEFORE = 144  # motor angle, rad
WHEEL_BEFORE = 145  # road-wheel angle, rad, while rewards are counted
CAR_ROWS = 146  # further rows, as many as needed: commands (newest first), then the sensors' rows

# counters: (rows, n) int64
KEY = 0  # base key of the car (a uint64, reinterpreted)
EPISODE = 1  # number of the episode under that key
SEGMENT = 2  # row of the present segment in ``road``; of the centre line in a walled world
CLIPPED = 3  # actions outside [-1, 1] since the environment was made
ROAD = 4  # index of the road or the world in the set
TIMELINE = 5  # index of the timeline in the set
COUNTER_ROWS = 6
