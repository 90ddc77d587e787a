"""A PD on lateral and heading error: lanekeep bench --policies stanley,benchmarks/examples/pd.py:Pd --episodes 16"""

from lanekeep_baselines import SteeringPolicy


class Pd(SteeringPolicy):
    """The heading error is the rate of the lateral one over the speed, so this is a PD in the lateral error."""

    name = "my-pd"
    reads = ("lateral_error", "heading_error", "speed", "curvature_preview_0")

    def __init__(self, scenario):
        super().__init__(scenario)
        self._wheelbase = scenario.vehicle.wheelbase

    def command(self, at, memory, fresh):
        """Return the road-wheel angle, rad, + left, and the next memory; arrays have one row for each car."""
        feedback = 0.05 * at["lateral_error"] + 0.6 * at["heading_error"]
        return self._wheelbase * at["curvature_preview_0"] - feedback, None
