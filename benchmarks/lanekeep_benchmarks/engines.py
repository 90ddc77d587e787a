"""Where batches of episodes are driven: in this process, in several, or on the nodes of a Ray cluster.

Whatever drives, this process alone writes the folder, line by line as batches end, so that nothing is lost or doubled.
A batch has the same cars everywhere, and a car depends on its own seed only: result lines are those of a serial run.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from typing import Any

from lanekeep_benchmarks.evaluate import Batch, Driven, Driver, MakePolicy, Policy
from lanekeep_benchmarks.policies import Entry, rebuilt
from lanekeep_env.checks import choose, require

ENGINES = ("serial", "processes", "ray")
#: How often a batch may take its worker with it before the run ends.
TRIES = 4


@dataclass(frozen=True)
class Engine:
    """What drives a run.

    Attributes:
        kind: one of `ENGINES`.
        workers: processes of ``"processes"``; None for one a processor.
        address: of the Ray cluster, as `ray.init` takes it; None for one that is started for this run alone.
    """

    kind: str = "serial"
    workers: int | None = None
    address: str | None = None

    def __post_init__(self) -> None:
        choose("--engine", self.kind, ENGINES)
        require("--workers", self.workers, "", at_least=1, at_most=1024, whole=True, optional=True)
        for option, value, kind in (("--workers", self.workers, "processes"), ("--address", self.address, "ray")):
            if value is not None and self.kind != kind:
                raise ValueError(f"{option} {value} has no effect with --engine {self.kind}; it is for --engine {kind}")
        if self.kind == "ray" and find_spec("ray") is None:
            raise ImportError('--engine ray needs ray, which is not installed; pip install "lanekeep[ray]"')


@dataclass(frozen=True)
class Work:
    """What a worker has to know beside the batch; it goes to other processes, ``given`` as `policies.Entry` has it."""

    suite: str
    seed: int
    kept: str
    given: Mapping[str, Any]
    sha256: Mapping[str, str]


def drive_all(engine: Engine, work: Work, batches: Iterable[Batch], make_policy: MakePolicy) -> Iterator[Driven]:
    """Yield what becomes of the batches, in whatever order they end; ``make_policy`` serves this process.

    Raises:
        ValueError: a policy's code fails.
        ChildProcessError: a worker died again and again with the same batch, driven alone.
    """
    if engine.kind == "serial":
        driver = Driver(work.suite, work.seed, make_policy, work.kept)
        for batch in batches:
            yield driver.drive(batch)
        driver.close()
        return
    if engine.kind == "processes":
        yield from _processes(work, iter(batches), engine.workers or os.cpu_count() or 1)
    else:
        yield from _on_ray(work, iter(batches), engine.address)


def check_travels(engine: Engine, policies: Mapping[str, Any]) -> None:
    """Raise ValueError where a policy, given as `policies.Entry` has it, cannot go where the engine drives."""
    for name, given in policies.items() if engine.kind != "serial" else ():
        try:
            pickle.dumps(given)
        except Exception as error:
            raise ValueError(
                f"policy {name!r} cannot go to another process ({' '.join(str(error).split())}); name it as "
                "module:factory or path/to/file.py:factory, or leave --engine out"
            ) from None


#: The driver of this worker, and the work that it is for.
_mine: tuple[Work, Driver] | None = None


def _drive(work: Work, batch: Batch) -> Driven:
    """Drive a batch in a worker; the file of its steps is written here."""
    global _mine
    if _mine is None or _mine[0] != work:
        _mine = work, Driver(work.suite, work.seed, _maker(work), work.kept)
    driven = _mine[1].drive(batch)
    if driven.trace is None:
        return driven
    name, content = driven.trace
    return Driven(driven.results, (name, _Kept(content())))


class _Kept:
    """Content that is there already."""

    def __init__(self, content: bytes) -> None:
        self._content = content

    def __call__(self) -> bytes:
        return self._content


def _maker(work: Work) -> MakePolicy:
    entries: dict[str, Entry] = {}
    made: dict[tuple[str, str], Policy] = {}

    def make(name: str, definition: Any) -> Policy:
        key = name, definition.hash
        if name not in entries:
            entries[name] = rebuilt(name, work.given[name])
            if isinstance(work.given[name], str) and entries[name].sha256 != work.sha256.get(name):
                raise ValueError(f"policy {name!r} is another one where a worker runs: its file differs")
        if key not in made:
            made[key] = entries[name].make(definition)
        return made[key]

    return make


def _begin() -> None:
    """A worker leaves Ctrl-C to the run, and goes when that is gone, however it ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def _processes(work: Work, batches: Iterator[Batch], workers: int) -> Iterator[Driven]:
    """Drive on ``workers`` processes; where one dies, what ran then is driven one by one: some of it may be why."""
    while lost := (yield from _side_by_side(work, batches, workers)):
        yield from _one_by_one(work, lost)


def _side_by_side(work: Work, batches: Iterator[Batch], workers: int) -> Generator[Driven, None, list[Batch]]:
    """Drive until all is done or a worker dies; return what ran then."""
    pool = _pool(workers)
    lost: list[Batch] = []
    running: dict[Future[Driven], Batch] = {}
    try:
        while not lost:
            # As many as keep all busy: what has ended waits in memory until it is written.
            for batch in islice(batches, max(0, 2 * workers - len(running))):
                lost = [batch]  # until it is handed over: the pool may be broken by then
                running[pool.submit(_drive, work, batch)] = batch
                lost = []
            if not running:
                return []
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                batch = running.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    lost.append(batch)
                else:
                    yield future.result()
    except BrokenProcessPool:
        pass
    finally:
        pool.shutdown(cancel_futures=True)
    return lost + list(running.values())


def _one_by_one(work: Work, batches: list[Batch]) -> Iterator[Driven]:
    """Drive one batch after the other, each up to `TRIES` times."""
    pool = _pool(1)
    try:
        for batch in batches:
            for _ in range(TRIES):
                try:
                    driven = pool.submit(_drive, work, batch).result()
                    break
                except BrokenProcessPool:
                    pool.shutdown()
                    pool = _pool(1)
            else:
                raise ChildProcessError(
                    f"a worker died {TRIES} times while {batch.policy} drove {batch.scenario.name}, episodes "
                    f"{batch.numbers[0]} to {batch.numbers[-1]}: out of memory, killed, or begun by a script "
                    'that lacks if __name__ == "__main__"'
                )
            yield driven
    finally:
        pool.shutdown(cancel_futures=True)


def _pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin)


def _on_ray(work: Work, batches: Iterator[Batch], address: str | None) -> Iterator[Driven]:
    logging.getLogger("ray").setLevel(logging.ERROR)
    ray: Any = import_module("ray")
    ours = not ray.is_initialized()
    if ours:
        ray.init(
            address=address,
            include_dashboard=False if address is None else None,
            log_to_driver=False,
            logging_level=logging.ERROR,
        )
    try:
        # Ray itself starts a task again whose worker or node has died.
        task: Callable[..., Any] = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_drive).remote
        told = ray.put(work)
        running: list[Any] = []
        while True:
            size = 2 * int(ray.cluster_resources().get("CPU", 1))
            running += [task(told, batch) for batch in islice(batches, max(0, size - len(running)))]
            if not running:
                return
            ended, running = ray.wait(running, num_returns=1)
            try:
                yield ray.get(ended[0])
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except ray.exceptions.RayError as error:
                raise ChildProcessError(f"Ray lost a batch {TRIES} times: {type(error).__name__}") from None
    finally:
        if ours:
            ray.shutdown()
