"""Team KnightRiders 2017: chapter 3's controllers along a wall, perception (4) and parking (5), computed again.

The report prints the cascade's poles and gains and the poles of the PD; its responses are curves. "Checked" numbers
were recomputed from its equations and listings by others than the authors of this code. Units: `wall_simulation`.

Assumptions, of which the report says nothing: the steering limit of 22°, a scan of 141 beams over 70° (it cuts a depth
image of 512 × 424 to a scan, and takes a median over 41 values), body, wheel, mass and tyres of the car.
"""

from __future__ import annotations

from lanekeep_benchmarks.replications.knightriders_designs import cascade, pd, pi, state_feedback
from lanekeep_benchmarks.replications.knightriders_drives import comparison, kalman_filter, one_sample
from lanekeep_benchmarks.replications.knightriders_figures import responses
from lanekeep_benchmarks.replications.knightriders_loci import root_loci
from lanekeep_benchmarks.replications.knightriders_parking import parking
from lanekeep_benchmarks.replications.knightriders_perception import perception
from lanekeep_benchmarks.replications.knightriders_rules import pi_over_speed, slow_cascade, steps

STEPS = (
    ("Figures 3.4, 3.5, 3.25", steps),
    ("first approach", pi),
    ("the PI over speed", pi_over_speed),
    ("second approach", state_feedback),
    ("third approach", cascade),
    ("PD", pd),
    ("root loci", root_loci),
    ("responses", responses),
    ("comparison", comparison),
    ("one sample of delay", one_sample),
    ("Kalman filter", kalman_filter),
    ("the filter at low speed", slow_cascade),
    ("perception", perception),
    ("parking", parking),
)
