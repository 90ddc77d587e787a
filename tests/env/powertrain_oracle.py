"""A second simulation of engine, gearbox and brake in plain Python, from the words of `Powertrain`'s attributes."""

import math

import numpy as np

from lanekeep_env import VEHICLES
from lanekeep_env.physics.powertrain_parameters import Powertrain

CAR, TRAIN, G, H = VEHICLES["passat"], Powertrain(), 9.81, 0.01


class Second:
    """The powertrain once more, from the words of its attributes."""

    def __init__(self, train, speed, mass=CAR.mass, slope=0.0, wind=0.0, friction=1.0):
        self.p, self.v, self.mass, self.slope, self.wind, self.grip = train, speed, mass, slope, wind, friction * G
        self.throttle = self.brake = self.a = self.way = 0.0
        self.since, self.last = 10**9, 0  # steps
        self.gear = 0
        while self.gear < len(train.gears) - 1 and self.engine(self.gear) >= 0.9 * train.upshift:
            self.gear += 1

    def ratio(self, gear):
        return (self.p.reverse if gear < 0 else self.p.gears[gear]) * self.p.final_drive / self.p.wheel_radius

    def engine(self, gear):
        """Engine speed without slip."""
        return self.v * self.ratio(gear)

    def full(self, omega):
        fading = min(max(1.0 - (omega - self.p.rev_limit) / 20.0, 0.0), 1.0)
        return fading * max(self.p.peak_torque * (1 - ((omega - self.p.peak_speed) / self.p.torque_width) ** 2), 0.0)

    def torque(self, omega):
        drag = self.p.drag_torque + self.p.drag_slope * omega
        return self.throttle * self.full(omega) - (1 - self.throttle) * drag

    def pulls(self, gear, torque):
        return torque * self.p.efficiency * self.ratio(gear) / self.mass

    def up_at(self):
        part = self.p.part_throttle
        return float(np.interp(self.throttle, [0.0, part, 1.0], [self.p.upshift, self.p.upshift, self.p.upshift_full]))

    def wants(self):
        """1 for the next gear, -1 for the one below, else 0."""
        p, omega = self.p, self.engine(self.gear)
        if self.gear > 0 and not (self.last > 0 and self.since < round(p.settle_time / H)):
            below = self.engine(self.gear - 1)
            kicks = self.throttle > p.kick_down_throttle and below < p.kick_down
            if kicks or below < p.downshift + p.downshift_throttle * self.throttle:
                return -1
        if self.gear + 1 < len(p.gears) and not (self.last < 0 and self.since < round(p.settle_time / H)):
            after = max(self.engine(self.gear + 1), p.idle_speed)
            left = self.a + self.pulls(self.gear + 1, self.full(after)) - self.pulls(self.gear, self.torque(omega))
            margin = p.reserve if self.last < 0 else 0.0
            if omega > self.up_at() and left >= p.reserve and (left >= self.a + margin or omega > p.upshift_full):
                return 1
        return 0

    def step(self, pedal, h=H):
        p = self.p
        change = 0
        if self.v < 1e-3:
            change = -self.gear
        elif self.since >= round(p.hold_time / H):
            change = self.wants()
        if change:
            self.gear, self.since, self.last = self.gear + change, 0, np.sign(change)
        keep = math.exp(-h / p.pedal_lag) if p.pedal_lag else 0.0
        self.throttle = keep * self.throttle + (1 - keep) * max(pedal, 0.0)
        self.brake = keep * self.brake + (1 - keep) * max(-pedal, 0.0)
        torque = self.torque(max(self.engine(self.gear), p.idle_speed))
        if self.engine(self.gear) < p.idle_speed:  # the converter slips
            torque = max(torque, 0.0)
        a = 0.0 if self.since < round(p.shift_time / H) else self.pulls(self.gear, torque)
        self.since += 1
        a += p.creep * min(max(1 - self.v / p.creep_speed, 0.0), 1.0) - p.brake * self.brake
        a = min(max(a, -0.95 * self.grip), 0.95 * self.grip) - G * math.sin(self.slope)
        air = self.v + self.wind
        a -= 0.6 * p.drag_area * air * abs(air) / self.mass + p.rolling * G
        stands = self.v < 1e-3 and a <= 0.0
        self.a, before = -self.v / h if stands else max(a, -self.v / h), self.v
        self.v = 0.0 if stands else max(self.v + a * h, 0.0)
        self.way += 0.5 * (before + self.v) * h
