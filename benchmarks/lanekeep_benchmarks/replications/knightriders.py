"""Team KnightRiders 2017: chapter 3's controllers along a wall, perception (4) and parking (5), computed again.

The report prints the cascade's poles and gains and the poles of the PD; its responses are curves. "Checked" numbers
were recomputed from its equations and listings by others than the authors of this code. Units: `wall_simulation`.
"""

from __future__ import annotations

from lanekeep_benchmarks.replications.knightriders_designs import cascade, pd, pi, state_feedback
from lanekeep_benchmarks.replications.knightriders_drives import comparison, kalman_filter, one_sample
from lanekeep_benchmarks.replications.knightriders_figures import responses
from lanekeep_benchmarks.replications.knightriders_loci import root_loci
from lanekeep_benchmarks.replications.knightriders_parking import parking
from lanekeep_benchmarks.replications.knightriders_perception import perception

STEPS = (
    ("first approach", pi),
    ("second approach", state_feedback),
    ("third approach", cascade),
    ("PD", pd),
    ("root loci", root_loci),
    ("responses", responses),
    ("comparison", comparison),
    ("one sample of delay", one_sample),
    ("Kalman filter", kalman_filter),
    ("perception", perception),
    ("parking", parking),
)
