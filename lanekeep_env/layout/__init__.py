"""Which row of the kernels' arrays holds what: one column a car ("lane" is a road's).

The kernels take a few packed arrays instead of many. ``cars`` is floating point, ``counters`` int64,
``road`` one row a segment, ``outcome`` what a step returns beside the observation.
``from lanekeep_env import layout as at`` gives all of them.
"""

from lanekeep_env.layout.cars import *
from lanekeep_env.layout.outcome import *
from lanekeep_env.layout.settings import *
from lanekeep_env.layout.tables import *
