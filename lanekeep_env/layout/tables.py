"""Columns of what the cars meet and carry: roads, sensors, scan, worlds, powertrain, timelines, camera, traffic."""

from __future__ import annotations

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
