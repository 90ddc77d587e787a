"""How fast environments step, beside others', in one run: `contenders`, `rounds`, `start_up`, `history`.

Machines are noisy and shared: absolute rates drift by tens of percent within a minute. So every contender of a group
runs in every round, in alternating order, and what is reported is the median over rounds of the ratios within a round.
"""
