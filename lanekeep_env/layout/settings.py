"""Rows of a scenario's numbers, and the values of its switches."""

from __future__ import annotations

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
# What disturbs it, where anything does:
STEERING_GAIN = 33  # road wheel's angle over the one that the actuator was told
STEERING_OFFSET = 34  # rad
BANK_LOW = 35  # roll angle of the road, rad
BANK_HIGH = 36
CROSSWIND_LOW = 37  # to the left, m/s
CROSSWIND_HIGH = 38
GUSTS = 39  # standard deviation, m/s
GUST_KEPT = 40  # share of a gust that is left after a control step
SIDE_AREA = 41  # half density times the car's side area, N s²/m²; 0 without wind
NOMINAL_LEVER = 42  # centre of wind pressure ahead of the centre of gravity, m
PATCH_EVERY = 43  # m, 0 for none
PATCH_LENGTH = 44  # m
PATCH_LOW = 45  # factor of the friction
PATCH_HIGH = 46
CHANGE_FROM = 47  # control step at which the car changes, -1 for never
CHANGE_TO = 48
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
CHANGE_SHORTEST = 94  # control steps for which the change lasts
CHANGE_LONGEST = 95
CHANGES = 96  # low and high of each factor, in the order of `Changes`
RANGES = 106  # low and high of each randomised number, in the order of `Randomisation`
# Load transfer:
CG_HEIGHT = 126  # of the centre of gravity, m
ROLL_FRONT = 127  # share of the axle's roll stiffness times twice the height over the track width
ROLL_REAR = 128
FRICTION_SENSITIVITY = 129  # share lost as the load doubles
STIFFNESS_SENSITIVITY = 130
HALF_TRACK = 131  # half of the width between the wheels, m
CHANNELS = 132  # low and high of each channel follow, then column and source (a row) of each gathered one

# values of the switches
STEERING_ANGLE, STEERING_RATE = 0, 1
TERMINATE, COST, OFF = 0, 1, 2
WALL_FOLLOW, CIRCUIT, PARKING = 0, 1, 2
ROUNDTRIP, OBSTACLES, PARK = 0, 1, 2
FLOWS, LEAD_BRAKES, CUTS_IN, MERGES = 0, 1, 2, 3
# Cost of a second on a circuit at most: twice that of standing still.
LARGEST_CIRCUIT_COST = 2.0
NO_AUTORESET, NEXT_STEP, SAME_STEP = 0, 1, 2
