"""What each part of a distilled policy is worth: fits of fewer terms to the drives of a run's last round.

lanekeep distil LaneKeep-v0 --out results/mine && python docs/ablations.py results/mine

The cost on held-out episodes over the base controller's, mean over the sets of cars, as Markdown. Each fit is least
squares over the terms that are left; the drives that it learns from are those of the whole student.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np

import lanekeep_baselines
from lanekeep_agents.distil.rounds import Sums, tensors_of
from lanekeep_agents.distil.run import Distillation, settings_in
from lanekeep_agents.student import StudentPolicy

folder = Path(sys.argv[1])
settings = settings_in(folder)
run = Distillation(settings, folder, resume=True)
record = run.record()
terms = [(left, right) for one in record.student.products for left in one.left for right in one.right]


def score(left_out):
    """Mean over sets of the cost over the base's, without the terms of which a side names any of ``left_out``."""
    kept = np.array([not any(word in term for word in left_out for term in pair) for pair in terms])
    weights, which = np.zeros(len(terms)), np.ix_(kept, kept)
    weights[kept] = Sums(sums.squares[which], sums.products[kept]).solved()
    costs = run.score(partial(StudentPolicy, record, tensors_of(record, weights)))
    return kept.sum(), float(np.mean(costs / base))


last = np.load(folder / f"round-{settings.mix.rounds - 1}.npz")
sums = Sums(last["squares"], last["products"])
base = run.score(lambda scenario: lanekeep_baselines.make(settings.mix.base, scenario))
print("| terms | weights | cost / base's |\n|---|---:|---:|")
for name, left_out in (
    ("all", ()),
    ("without what is identified: gains that follow the speed alone", ("identified.",)),
    ("without the controllers' estimates", ("base0.",)),
    ("without the second controller", ("base1",)),
    ("without any of these: no memory but the base's own", ("identified.", "base0.", "base1")),
):
    print("| {} | {} | {:.3f} |".format(name, *score(left_out)), flush=True)
