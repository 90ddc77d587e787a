"""Ctrl-C while kernels are compiled: a process of its own, since what went wrong would end this one."""

import os
import signal
import subprocess
import sys

import pytest

#: Compiles kernels that nobody keeps, each interrupted somewhere in it, by its own processor time.
SCRIPT = """
import random, signal, time
import numpy as np
from lanekeep_env.compile import helper, kernel

signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs in the background inherits that it is ignored
signal.signal(signal.SIGVTALRM, lambda *_: signal.raise_signal(signal.SIGINT))

def compiled(factor):
    @helper
    def one(x):
        return np.sin(x) * factor + np.arctan(x)

    @kernel()
    def total(values):
        found = 0.0
        for i in range(values.shape[0]):
            found += one(values[i])
        return found

    return total

values = np.array([0.5, 1.5])
compiled(-2)(values)
begun = time.process_time()
compiled(-1)(values)
whole = time.process_time() - begun
random.seed(0)
interrupted = 0
for number in range(40):
    total = compiled(number)
    signal.setitimer(signal.ITIMER_VIRTUAL, random.uniform(0.001, 0.7 * whole))
    try:
        total(values)
    except KeyboardInterrupt:
        interrupted += 1
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    assert total.signatures, "a first Ctrl-C waits until the compilation is done"
    assert np.isclose(total(values), (np.sin(values) * number + np.arctan(values)).sum(), rtol=1e-14)
print(interrupted)
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
def test_an_interrupted_compilation_ends_and_then_interrupts(tmp_path):
    environment = os.environ | {"LANEKEEP_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert int(done.stdout) >= 20
