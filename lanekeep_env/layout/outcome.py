"""Rows of what a step returns beside the observation."""

from __future__ import annotations

# outcome: (rows, n) float. In same-step autoreset OUTCOME_ROWS and as many rows as there are channels follow:
# what the last step of an ended episode gave, and its observation.
O_REWARD = 0
O_TERMINATED = 1
O_TRUNCATED = 2
O_SUCCESS = 3
O_FLAGS = slice(O_TERMINATED, O_SUCCESS + 1)  # what is true or not
O_LATERAL_ERROR = 4
O_HEADING_ERROR = 5
O_LATERAL_ACCELERATION = 6
O_STEERING_RATE = 7
O_SPEED = 8
O_ARC_LENGTH = 9
O_COST = 10
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
