"""Which row of the kernels' arrays holds what: one column a car ("lane" is a road's).

The kernels take a few packed arrays instead of many, because each array argument costs a call about
0.2 µs. ``cars`` is floating point, ``counters`` int64, ``road`` one row a segment, ``outcome`` what a
step returns beside the observation.
"""

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
STEER_OFFSET = 39  # what it adds to that in this episode, rad
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
CAR_ROWS = 123  # further rows, as many as needed: commands (newest first), then the sensors' rows

# counters: (rows, n) int64
KEY = 0  # base key of the car (a uint64, reinterpreted)
EPISODE = 1  # number of the episode under that key
SEGMENT = 2  # row of the present segment in ``road``; of the centre line in a walled world
CLIPPED = 3  # actions outside [-1, 1] since the environment was made
ROAD = 4  # index of the road or the world in the set
TIMELINE = 5  # index of the timeline in the set
COUNTER_ROWS = 6

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
S_LATEST_START = 2  # largest arc length at which an episode starts, m; backwards, counted from the road's end
S_LENGTH = 3  # m

# settings: one float vector, constant for a scenario
STEP_TIME = 0  # integration step h, s
SUBSTEPS = 1
SLIPS = 2  # 1 where the car has tyres
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
MAX_STEPS = 14  # after which a car is truncated
AUTORESET = 15
PREVIEW = 16
PREVIEW_TIME = 17  # s between samples, at the present speed
FULL = 18
START_LATERAL = 19  # m, either side
START_HEADING = 20  # rad, either side
HORIZON = 21  # steps for whose rest a departure is charged
LATERAL_LIMIT = 22  # largest lateral acceleration of the speed profile, m/s²; 0 for a constant speed
# The nominal car:
MASS = 23  # kg
INERTIA = 24  # kg m²
NOMINAL_FRONT = 25  # l_f, m
NOMINAL_REAR = 26  # l_r, m
NOMINAL_FRONT_STIFFNESS = 27  # of the axle, N/rad
NOMINAL_REAR_STIFFNESS = 28
FRICTION = 29  # of the road
LAG = 30  # of the actuator, s
RATE_LIMIT = 31  # of the road wheel, rad/s
NOMINAL_DELAY = 32  # of the command, s
RANGES = 33  # low and high of each randomised number, in the order of `Randomisation`
PREVIEW_DISTANCE = 49  # m between samples, at any speed
SPEED_LOW = 50  # bounds of the set speeds, m/s
SPEED_HIGH = 51
SPEED_HOLD = 52  # control steps between set speeds, inf for one an episode
SPEED_CHANGE = 53  # largest change of the speed in a sub-step, m/s
STANDSTILL = 54  # share of set speeds that are 0
# Of walled worlds:
TASK = 55  # WALL_FOLLOW, CIRCUIT or PARKING
SET_DISTANCE = 56  # m
LARGEST_SPEED = 57  # that action 1 asks for, m/s; 0 where the set speed is drawn
TICK = 58  # way of the wheel that is one tick of the encoder, m, 0 for a continuous one
SIGNLESS = 59  # 1 where the encoder does not tell forwards from backwards
OFFSET_LOW = 60  # of the steering offset, rad
OFFSET_HIGH = 61
SIDE_ARM = 62  # the side sensors ahead of the centre of gravity, m
FRONT_ARM = 63  # the front sensors and the depth camera ahead of it, m
BODY_MIDDLE = 64  # of the body ahead of the centre of gravity, m
BODY_HALF_LENGTH = 65  # m
BODY_HALF_WIDTH = 66  # m
LAPS = 67  # after which an episode on a circuit is done
BACKWARDS = 68  # 1 where the car drives the road from its end to its start
SLOPE_LOW = 69  # of the sine of the road's rise
SLOPE_HIGH = 70
WIND_LOW = 71  # of the headwind, m/s
WIND_HIGH = 72
SPEED_REFERENCE = 73  # reference speed error of the running cost, m/s
SATURATES = 74  # 1 where friction limits the speed profile
FRONT_SPEED = 75  # 1 where the speed is the front wheels'
POWERED = 76  # 1 where the speed at the start is the one that is set
FIRST_PREVIEW = 77  # channel of the first preview sample, or beam of the scan
LARGEST_COST = 78  # of a second, 1/s
SECOND = 79  # row of what the second action asks for
SECOND_LOW = 80  # its least value that counts
SECOND_SCALE = 81  # what is asked for at 1
CIRCLE = 82  # share of the friction that engine and brake take at the most, leaving the rest across; 0: no circle
GATHERED = 83  # how many channels are rows as they stand
TRACKS = 84  # 1 where set positions may come
# Among traffic:
WISH_LOW = 85  # of the set speed, m/s
WISH_HIGH = 86
LANES = 87
LANE_WIDTH = 88  # m
SITUATION = 89
SPACING = 90  # between cars in a lane where episodes start, m
FLOW_LOW = 91  # of the speeds that the others like, m/s
FLOW_HIGH = 92
FIRST_NEIGHBOUR = 93  # first of the channels that show the cars around
CHANNELS = 94  # low and high of each channel follow, then column and source (a row) of each gathered one

# sensors: (measured channels, SENSOR_SIZE), or None where all are perfect
# noise, bias, resolution, period and delay (control steps), dropout, jump, jumps a sample, then:
SOURCE = 8  # row that holds the truth
COLUMN = 9  # of the observation
VALID_COLUMN = 10  # of the flag that says whether the last sample saw anything, -1 for none
MISSING = 11  # shown until anything was seen
HOLDS = 12  # 1 where the last sample is held while nothing is seen, 0 where MISSING is shown
SENSOR_SIZE = 13

# gear: backlash of the steering gear, or None where there is none
GEAR_HALF_GAP = 0  # rad of the road wheel
GEAR_ON_MOTOR = 1  # 1 where the loop is closed on the motor's angle, 0 behind the gear
GEAR_SIZE = 2

# servo: (command quantum, 0 for none; then angles at commands from -max to +max, uniformly spaced), rad of the road
# wheel, or None where the wheel goes where it is told

# scan: numbers, beams, scratch, fan and held, or None for each; numbers in this order:
SCAN_FIRST = 0  # angle of the first beam from the car's axis, rad
SCAN_STEP = 1
SCAN_NEAREST = 2  # m
SCAN_FARTHEST = 3
SCAN_NOISE = 4  # standard deviation at 1 m, growing with the square of the range, m
SCAN_EVERY = 5  # each that many beams one is missing, 0 for none
SCAN_RIM = 6  # beams missing at either rim
SCAN_JUMP = 7  # share of the beams beside a depth jump that show something between
SCAN_PERIOD = 8  # control steps between scans
SCAN_SIZE = 9

# worlds: walls (4, all), index (worlds, INDEX_SIZE) int64, line (3, all points): x, y and station, starts (3, all)
I_FIRST = 0  # wall
I_GLASS = 1  # first glass wall
I_END = 2  # wall behind the last
I_LINE = 3  # first point of the centre line
I_POINTS = 4  # its points; a closed one repeats its first point at the end
I_CLOSED = 5
I_START = 6  # first start
I_STARTS = 7
INDEX_SIZE = 8

# course: numbers; spaces (SPACE_COLUMNS, all); a world's spaces (worlds, 3): first, behind the last, longest
C_KERB = 0  # farthest that a parked car is from the kerb, m
C_TURNED = 1  # largest angle of a parked car to the kerb, rad
C_STEPS = 2  # that it has to stand
C_SPEED = 3  # below which it stands, m/s
C_MODES = 4  # number of modes; time (control steps) and mode of each follow
S_X, S_Y, S_HEADING, S_LONG, S_DEEP = 0, 1, 2, 3, 4
SPACE_COLUMNS = 5

# drive: (numbers, timelines), or None without a powertrain; numbers in this order:
D_PEAK_TORQUE = 0  # N m
D_PEAK_SPEED = 1  # of the engine at it, rad/s
D_NARROWNESS = 2  # one over what is from there to no torque, s/rad
D_DRAG = 3  # of the engine with closed throttle, N m
D_DRAG_SLOPE = 4  # N m s/rad
D_IDLE = 5  # rad/s
D_EFFICIENCY = 6  # of the gears
D_AIR = 7  # half density times drag area, N s²/m²
D_ROLL = 8  # rolling resistance over weight
D_CREEP = 9  # acceleration by the converter at standstill, m/s²
D_CREEP_FALL = 10  # share of it that is lost for each m/s
D_BRAKE = 11  # deceleration of the full brake, m/s²
D_PEDAL_SHARE = 12  # share of the remaining way that throttle and brake go in a sub-step
D_UP = 13  # engine speed of an upshift up to part throttle, rad/s ...
D_UP_FULL = 14  # ... and at full throttle
D_PART = 15  # that part
D_DOWN = 16  # engine speed in the gear below at which it shifts down, closed throttle, rad/s ...
D_DOWN_THROTTLE = 17  # ... and what full throttle adds
D_KICK = 18  # throttle beyond which kick-down shifts down ...
D_KICK_SPEED = 19  # ... as long as the engine stays below this, rad/s
D_RESERVE = 20  # acceleration that the next gear up must have left, m/s²
D_LIMIT = 21  # engine speed at which the limiter cuts in, rad/s
D_WITHOUT = 22  # sub-steps without torque
D_HOLD = 23  # sub-steps from one gear change to the next
D_SETTLE = 24  # sub-steps from one gear change to one that takes it back
D_REVERSE = 25  # engine over wheel's way in reverse, rad/m
D_GEARS = 26
D_RATIOS = 27  # the same of the gears; GEARS_MOST of them
GEARS_MOST = 8
DRIVE_SIZE = 35

# driver, guidance: float64, in the order of `scenario.driver` and `scenario.guidance`, or None; behind the guidance the
# roads' bends, (bends, 2): station of the start and length, m, and each road's first bend and their number, (roads, 2)

# timelines: (timelines, events, 4): time (s), kind, and up to two numbers; unused events are at inf
E_TIME, E_KIND, E_FIRST, E_SECOND = 0, 1, 2, 3
SPEED_EVENT, LEAD_EVENT, LEAD_GONE, STOP_EVENT, STOP_GONE, LEAD_SPEED_EVENT = 0, 1, 2, 3, 4, 5
POSITION_EVENT, POSITION_SPEED_EVENT, POSITION_GONE = 6, 7, 8
FAR = 200.0  # how far cars ahead and stop points are seen, m
NOWHERE = 1e6  # gap of a car ahead, or a set position, that is not there, m

# camera: float64, or None for an environment without; CAMERA_SIZE numbers, then one a road segment: 1 where its
# edge is marked
CAMERA_REACH = 0  # from the rear axle to the look-ahead point, m
CAMERA_OFFSET = 1  # of the edge from the road's centre line, m, left positive
CAMERA_WIDEST = 2  # largest distance, either side, inside the field of view, m
CAMERA_SIZE = 3

# values of the switches
STEERING_ANGLE, STEERING_RATE = 0, 1
TERMINATE, COST, OFF = 0, 1, 2
WALL_FOLLOW, CIRCUIT, PARKING = 0, 1, 2
ROUNDTRIP, OBSTACLES, PARK = 0, 1, 2
FLOWS, LEAD_BRAKES, CUTS_IN, MERGES = 0, 1, 2, 3
# Cost of a second on a circuit at most: twice that of standing still.
LARGEST_CIRCUIT_COST = 2.0
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

# With a driver, before the repetition of same-step autoreset:
O_INTERVENTIONS, O_AUTHORITY, O_ASSISTANCE, O_HANDOVER = 11, 12, 13, 14
SUPPORT_OUTCOME_ROWS = 15

# Of walled worlds, before the repetition of same-step autoreset:
O_X = 11
O_Y = 12
O_DISTANCE = 13  # of the wall on the right, m
O_CLEARANCE = 14
O_LAP_TIME = 15
WALL_OUTCOME_ROWS = 16
# On courses:
O_MODE = 16
O_SHARE = 17
O_KERB_DISTANCE = 18
COURSE_OUTCOME_ROWS = 19

# With a powertrain, behind OUTCOME_ROWS:
O_GAP = 11  # to the car ahead, m; NOWHERE without one
O_TIME_TO_COLLISION = 12  # s, at present speeds; NOWHERE where it does not come nearer
O_STOP_ERROR = 13  # of a car that stands at a stop point, or is beyond it: way left, m
O_SPEED_ERROR = 14  # against the wanted speed, m/s
O_JERK = 15  # m/s³, over the control step
O_CONTACT = 16  # 1 where the car meets the one ahead ...
O_AVOIDABLE_CONTACT = 17  # ... and full braking in time had avoided that, in the step in which it does
O_OVERRUN = 18  # 1 beyond a stop point ...
O_AVOIDABLE_OVERRUN = 19
DRIVE_OUTCOME_ROWS = 20

# start: (rows, n) float64; NaN means drawn by the episode's key
START_ROWS = 4  # lateral error, heading error, arc length, road index

# traffic: (T_ROWS, cars) float64, behind one another in the road's coordinates
T_X = 0  # of the middle, along the road, m
T_Y = 1  # from the middle of lane 0, left positive, m
T_HEADING = 2  # from the road's, rad
T_SPEED = 3  # m/s
T_LANE = 4  # number of the nearest lane, 0 for the right-most
T_TARGET = 5  # of the lane that it goes to
T_TIMER = 6  # since the last decision about lanes, s
T_WISH = 7  # speed on a free road, m/s
T_EXPONENT = 8  # of IDM
T_CRASHED = 9  # 1 after a contact among them
T_PUSHED = 10  # 1 where a contact pushes in the next step, by ...
T_PUSH_X = 11  # ... m
T_PUSH_Y = 12
T_STEER = 13  # wheel angle, rad
T_PULL = 14  # acceleration, m/s²
T_COSINE = 15  # of the heading
T_SINE = 16
# ... and what some of them are told:
T_BRAKES_AT = 17  # s of the episode, ...
T_BRAKES_UNTIL = 18
T_BRAKE = 19  # m/s²
T_CUTS_IN = 20  # gap at which it goes to the lane of the car behind it, m; 0 for never
T_ROWS = 21
# and their road:
T_LANES = 0
T_LANE_WIDTH = 1  # m
T_SPEED_LIMIT = 2  # m/s
T_FIRST_LANE = 3  # right-most lane that they change to
T_GRIP = 4  # largest acceleration that the road allows, m/s²
T_ROAD_SIZE = 5
