"""One episode to look at: in a window, or as a GIF."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_benchmarks.policies import Entry
from lanekeep_benchmarks.replay import Replay
from lanekeep_env.checks import require
from lanekeep_env.files import write_atomic

GIF_WIDTH = 640
#: Pictures a second at the most: more make the file large.
LARGEST_RATE = 20.0
#: Pictures that are held at the most; with 750 of them, and Pillow, a process has 1.1 GB.
MOST_PICTURES = 400
#: Of an episode that is played, s.
LONGEST = 3600.0


@dataclass(frozen=True)
class Episode:
    """What became of a played episode: steps, seconds, RMS and peak lateral error (m), whether it failed, the time of
    a lap or, where it was to park at last, until it had, s, and what happened among others on the road."""

    steps: int
    seconds: float
    rms_lateral_error: float
    peak_lateral_error: float
    departed: bool
    lap_time: float = 0.0
    mishap: str = ""
    parked: bool = False


#: What happens among others on the road, by its entry in ``info``.
_MISHAPS = {"contact": "met another car", "overrun": "passed where it had to stop"}

#: What drives an environment unless told otherwise: the first of these that can.
PREFERRED = (
    "werling-traffic",
    "werling-drive",
    "werling-reverse-ahead",
    "yin-lqr-feedforward",
    "traechtler-inverse",
    "knightriders-park",
    "knightriders-obstacles",
    "knightriders-circuit",
    "knightriders-cascade-kalman",
)


def preferred(env_id: str, **keywords: Any) -> str:
    """Return the name of the controller that drives an environment by default."""
    able = lanekeep_baselines.names(make(env_id, None, **keywords).unwrapped.scenario)  # type: ignore[attr-defined]
    return next((name for name in PREFERRED if name in able), able[0])


def place_of(env_id: str) -> str:
    """Return the keyword that says where an environment's car drives: "road" or "world", "" where none does."""
    scenario = gym.make(env_id).unwrapped.scenario  # type: ignore[attr-defined]
    return next((place for place in ("road", "world") if hasattr(scenario, place)), "")


def make(env_id: str, render_mode: str | None, **keywords: Any) -> gym.Env:
    """Make the environment as it is played: departures and contacts end nothing; roads are shown 2 s ahead."""
    scenario = gym.make(env_id).unwrapped.scenario  # type: ignore[attr-defined]
    if hasattr(scenario, "preview"):
        keywords = {"preview": 20, **keywords}
    ends = "departure" if hasattr(scenario, "departure") else "contact"
    return gym.make(env_id, render_mode=render_mode, **{ends: "cost", **keywords})


@dataclass(frozen=True)
class Drive:
    """An episode to play.

    Attributes:
        env_id: a registered id.
        policy: what drives.
        make: takes a render mode, gives the environment.
        seed: of the episode.
        seconds: length at the most, unless told otherwise.
        options: of `reset`.
        told: takes the environment's scenario, gives the one that the policy is made for.
    """

    env_id: str
    policy: Entry
    make: Callable[[str | None], gym.Env]
    seed: int
    seconds: float
    options: Mapping[str, Any]
    told: Callable[[Any], Any]

    @classmethod
    def fresh(cls, env_id: str, policy: Entry, seed: int, keywords: Mapping[str, Any]) -> Drive:
        """The episode of an environment with that seed, in which departures end nothing."""

        def made(render_mode: str | None) -> gym.Env:
            return make(env_id, render_mode, **keywords)

        return cls(env_id, policy, made, seed, 15.0, {}, lambda scenario: scenario)

    @classmethod
    def of_line(cls, replay: Replay) -> Drive:
        """The episode of a result line, all of it."""
        scenario = replay.scenario
        return cls(
            scenario.env_id,
            replay.policy,
            replay.make,
            replay.line.episode_seed,
            math.inf,
            scenario.options,
            replay.policys_scenario,
        )


def play(drive: Drive, seconds: float | None, see: Callable[[np.ndarray], None] | None) -> Episode:
    """Drive one episode of at most ``seconds``; ``see`` gets each picture, or a window shows it where that is None.

    Raises:
        ValueError, ImportError, gymnasium.error.Error: a wrong id, policy, option, or a missing extra.
    """
    require("--seconds", seconds, "s", at_least=0.1, at_most=LONGEST, optional=True)
    env = drive.make("human" if see is None else "rgb_array")
    try:
        scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
        driver = drive.policy.make(drive.told(scenario))
        observation, _ = env.reset(seed=drive.seed, options=dict(drive.options) or None)
        errors: list[float] = []
        state, departed, over, mishap = None, False, False, ""
        limit = (drive.seconds if seconds is None else seconds) / scenario.control_step
        while len(errors) < limit and not over:
            action, state = driver.predict(observation, state)
            observation, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            errors.append(info["lateral_error"])
            departed = departed or info["cost"] > 0.0
            mishap = mishap or next((told for name, told in _MISHAPS.items() if info.get(name, 0.0) > 0.0), "")
            if see is not None:
                see(env.render())  # type: ignore[arg-type]
    finally:
        env.close()
    size = np.array(errors)
    return Episode(
        len(errors),
        len(errors) * scenario.control_step,
        float(np.sqrt(np.mean(size**2))),
        float(np.abs(size).max()),
        departed,
        info.get("lap_time", 0.0),
        mishap,
        getattr(scenario, "ends_parked", False),
    )


class Film:
    """Evenly spaced pictures of a drive, in a GIF's size: with one too many, every other one goes."""

    def __init__(self) -> None:
        self.frames: list[np.ndarray] = []
        self._seen, self._every = 0, 1

    def see(self, picture: np.ndarray) -> None:
        """Keep a picture (height, width, 3), uint8, or not."""
        from PIL import Image

        if self._seen % self._every == 0:
            height, width, _ = picture.shape
            size = (GIF_WIDTH, round(height * GIF_WIDTH / width))
            self.frames.append(np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)))
        self._seen += 1
        if len(self.frames) > MOST_PICTURES:
            del self.frames[1::2]
            self._every *= 2


def write_gif(path: Path, frames: list[np.ndarray], seconds: float) -> None:
    """Write frames (height, width, 3) of a drive of ``seconds`` as a looped GIF, atomically."""
    from PIL import Image

    frames = frames[:: math.ceil(len(frames) / (LARGEST_RATE * seconds) - 1e-6)]
    # One palette for all frames: what does not move stays the same colour, and the file small. The octree keeps
    # colours of few pixels, as of a small car.
    sample = Image.fromarray(np.vstack([frames[0], frames[len(frames) // 2], frames[-1]]))
    palette = sample.quantize(128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)

    pictures = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer,
        "GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 * seconds / len(frames)),
        loop=0,
        optimize=True,
    )
    write_atomic(path, buffer.getvalue())
