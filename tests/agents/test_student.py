"""Policies with memory: rows, memory, files, and what they identify of a car."""

import functools
import hashlib
import json
import time
from dataclasses import replace
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.distil.features import products
from lanekeep_agents.identified import IDENTIFIED, MEMORY, Identifier, Seen
from lanekeep_agents.policy_file import read_policy, read_record, write_policy
from lanekeep_agents.policy_record import Network
from lanekeep_agents.student import StudentPolicy
from lanekeep_agents.student_record import Product, Student
from lanekeep_env import LaneKeepScenario
from lanekeep_env.physics.vehicles import vehicle_from

SCENARIO = LaneKeepScenario(preview=20, departure="cost")
BASES = ("lq-preview-offset-free", "lq-preview")


@pytest.fixture(autouse=True, scope="module")
def _designed_once():
    """Controllers are pure: those of a scenario serve all tests."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(lanekeep_baselines, "make", functools.cache(lanekeep_baselines.make))
        yield


@pytest.fixture
def record(make_record):
    channels = [channel.name for channel in SCENARIO.channels]
    student = Student(BASES[1:], 8.0, products(channels))
    network = Network((), "relu", False)
    return make_record(SCENARIO, network=network, base=BASES[0], bound=0.15, student=student, algorithm="distillation")


def _tensors(record, scale=1e-3):
    rng = np.random.default_rng(3)
    return {name: (scale * rng.standard_normal(shape)).astype(np.float32) for name, shape in record.shapes.items()}


def _histories(cars, steps):
    """What cars observe that an LQ controller drives, (steps, cars, channels)."""
    keywords = {"preview": 20, "randomisation": "mismatch", "sensors": "production", "departure": "cost"}
    env = gym.make_vec("lanekeep/LaneKeep-v0", cars, vectorization_mode="vector_entry_point", **keywords)
    seen, _ = env.reset(seed=11)
    policy, memory, found = lanekeep_baselines.make("lq-preview", SCENARIO), None, [seen]
    for _ in range(steps - 1):
        action, memory = policy.predict(seen, memory)
        seen = env.step(action)[0]
        found.append(seen)
    return np.array(found)


def test_rows_are_independent_to_the_last_bit_and_forget_by_themselves(record):
    policy, seen = StudentPolicy(record, _tensors(record)), _histories(23, 30)
    rng = np.random.default_rng(0)
    starts = rng.random((30, 23)) < 0.1
    together, memory = [], None
    for rows, start in zip(seen, starts, strict=True):
        action, memory = policy.predict(rows, memory, start)
        together.append(action)
    assert memory.shape == (23, policy.memory) and memory.dtype == np.float64
    for car in (0, 7, 22):
        memory = None
        for k in range(30):
            if starts[k, car]:
                memory = None  # as if nothing had been
            action, memory = policy.predict(seen[k, car], memory)
            np.testing.assert_array_equal(action, together[k][car])
    order, memory = rng.permutation(23)[:13], None
    for k in range(30):
        action, memory = policy.predict(seen[k, order], memory, starts[k, order])
        np.testing.assert_array_equal(action, together[k][order])


def test_nothing_that_is_handed_over_is_written_to(record):
    policy, seen = StudentPolicy(record, _tensors(record)), _histories(3, 2)
    _, memory = policy.predict(seen[0])
    kept, before = seen[1].copy(), memory.copy()
    first, _ = policy.predict(seen[1], memory)
    np.testing.assert_array_equal(memory, before)
    np.testing.assert_array_equal(seen[1], kept)
    np.testing.assert_array_equal(policy.predict(seen[1], memory)[0], first)


def test_correction_is_the_sum_that_it_stands_for(record):
    """Written out term by term, from names, in float64."""
    student = Student(("lq-preview",), 8.0, (Product(("speed*slowness", "1"), ("base1", "base0.5*yaw_rate")),))
    record = replace(record, student=student, bound=2.0)
    weights = np.float32([[0.1, 30.0], [-0.2, 2.0]])
    policy = StudentPolicy(record, {"products.0": weights})
    bases = [lanekeep_baselines.make(name, SCENARIO) for name in BASES]
    memories, memory = [None, None], None
    for rows in _histories(5, 20):
        found, memory = policy.predict(rows, memory)
        actions = []
        for i, base in enumerate(bases):
            action, memories[i] = base.predict(rows, memories[i])
            actions.append(action[:, 0].clip(-1.0, 1.0))
        channel = {c.name: rows[:, i].astype(float) for i, c in enumerate(SCENARIO.channels)}
        left = np.array([channel["speed"] / np.maximum(channel["speed"], 6.0), np.ones(5)])
        right = np.array([actions[1], memories[0][:, 5] * channel["yaw_rate"]])
        wanted = actions[0] + np.einsum("in,ij,jn->n", left, weights, right)
        np.testing.assert_allclose(found[:, 0], wanted.clip(-1.0, 1.0), atol=1e-6)


def test_without_weights_it_is_its_base_and_no_correction_is_larger_than_the_bound(record):
    base, seen = lanekeep_baselines.make(BASES[0], SCENARIO), _histories(6, 10)
    for scale in (0.0, 1e3):
        policy = StudentPolicy(record, _tensors(record, scale))
        memory = of_base = None
        for rows in seen:
            action, memory = policy.predict(rows, memory)
            asked, of_base = base.predict(rows, of_base)
            change = np.abs(action - asked.clip(-1.0, 1.0))
            assert change.max() <= (0.15 + 1e-6 if scale else 0.0)
        assert scale == 0.0 or change.min() > 0.0


def test_file_drives_as_the_policy_of_training(record, tmp_path):
    """10,000 histories: 500 cars, 20 steps."""
    tensors = _tensors(record)
    write_policy(tmp_path / "mine.json", replace(record, name="mine"), tensors)
    read = lanekeep_agents.load(tmp_path / "mine.json", SCENARIO)
    policy, seen = StudentPolicy(record, tensors), _histories(500, 20)
    memory = of_read = None
    for rows in seen:
        wanted, memory = policy.predict(rows, memory)
        found, of_read = read.predict(rows, of_read)
        np.testing.assert_array_equal(found, wanted)


def test_files_of_other_policies_are_written_as_before():
    record = read_record(next(iter(sorted(lanekeep_agents._zoo().glob("ppo-*.json")))))
    assert record.student is None and "student" not in record.to_dict()


def _written(folder, record):
    write_policy(folder / "a.json", replace(record, name="a"), _tensors(record))
    return folder / "a.json", folder / "a.safetensors"


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
@pytest.mark.parametrize("which", [0, 1])
def test_truncated_files_are_refused(record, tmp_path, which, share):
    files = _written(tmp_path, record)
    content = files[which].read_bytes()
    files[which].write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"a\.(json|safetensors)"):
        read_policy(files[0])


def test_tampered_weights_are_refused(record, tmp_path):
    files = _written(tmp_path, record)
    content = bytearray(files[1].read_bytes())
    content[-1] ^= 1
    files[1].write_bytes(content)
    with pytest.raises(ValueError, match="sha256"):
        read_policy(files[0])
    tensors = _tensors(record)
    tensors["products.0"][0, 0] = np.nan
    with pytest.raises(ValueError, match="holds nan"):
        StudentPolicy(record, tensors)
    with pytest.raises(ValueError, match="has shape"):
        StudentPolicy(record, {**_tensors(record), "products.1": np.zeros((2, 2), np.float32)})


CHANGES = [
    (lambda s: s["products"][0]["left"].append("lateral_eror"), "has the factor 'lateral_eror'"),
    (lambda s: s["products"][0]["left"].append("base2"), "has the factor 'base2'"),
    (lambda s: s["products"][0]["left"].append("sure"), "has the factor 'sure'"),
    (lambda s: s["products"][0]["left"].append("__import__"), "has the factor '__import__'"),
    (lambda s: s["products"][0]["left"].append("1*1*1*1*1"), "at most 4 factors"),
    (lambda s: s["products"][0].update(left=[]), "it must be a list of 1 to 512"),
    (lambda s: s["products"][0].update(left=["1"] * 513), "it must be a list of 1 to 512"),
    (lambda s: s["products"][0].update(middle=["1"]), "no field 'middle'"),
    (lambda s: s.update(products=[]), "student.products=[] is not allowed"),
    (lambda s: s.update(fade=0.0), "student.fade=0.0 is not allowed"),
    (lambda s: s.update(fade="8"), "student.fade='8' is not allowed"),
    (lambda s: s.update(beside="lq-preview"), "student.beside='lq-preview' is not allowed"),
    (lambda s: s.pop("fade"), "student lacks the field 'fade'"),
]


@pytest.mark.parametrize(("change", "words"), CHANGES)
def test_tampered_records_are_refused_in_a_line(record, tmp_path, change, words):
    file, _ = _written(tmp_path, record)
    values = json.loads(file.read_text())
    change(values["student"])
    file.write_text(json.dumps(values))
    with pytest.raises(ValueError) as refused:
        read_policy(file)
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"base": None, "bound": None}, "base is not allowed"),
        ({"network": Network((4,), "relu", False)}, "network.hidden is not allowed"),
        ({"actions": 2}, "actions is not allowed"),
    ],
)
def test_records_that_no_student_has_are_refused(record, changes, words):
    with pytest.raises(ValueError, match=words):
        replace(record, **changes)


def test_estimates_that_a_controller_does_not_have_are_named(record):
    student = Student(("pd",), 8.0, (Product(("1",), ("base1.0",)),))
    record = replace(record, student=student)
    with pytest.raises(ValueError, match=r"'base1.0' is not known: pd remembers 0 numbers"):
        StudentPolicy(record, _tensors(record))


def test_scenarios_without_the_road_ahead_are_refused(record):
    with pytest.raises(ValueError, match="curvature_preview_0"):
        StudentPolicy(record, _tensors(record), LaneKeepScenario())


CAR = vehicle_from("yin")


def _identified(lag_factor=1.0, delay=0, offsets=(0.0, 0.0), noise=0.0, steps=400, changed=None):
    """Follow a made-up car whose road wheel goes after its command as a first-order lag, exactly."""
    rng = np.random.default_rng(5)
    follow, memory, fresh = Identifier(CAR, 0.05, 8.0), np.zeros((MEMORY, 1)), True
    steer, sent = 0.0, [0.0] * 3
    for k in range(steps):
        factor = changed if changed is not None and k > steps // 2 else lag_factor
        acceleration = 3.0 * np.sin(0.05 * k)
        seen = np.array([noise * rng.standard_normal(), acceleration / 20.0, 20.0, steer, sent[0]])
        told = Seen(*seen[:, None], *(np.array([one * acceleration]) for one in offsets))
        found, memory = follow.follow(memory, fresh, told)
        fresh = False
        sent = [0.02 * rng.standard_normal(), *sent[:2]]  # so rich that what is not known yet stands for nothing
        # The command of this step acts in it; `steering_command` shows it in the next observation.
        response = -np.expm1(-0.05 / (factor * CAR.steering.lag))
        steer += response * (sent[delay] - steer)
    return dict(zip(IDENTIFIED, found[:, 0], strict=True))


def test_a_slower_actuator_is_identified():
    """Its answer to the command of the step, minus the nominal one's, five times: from the exponentials."""
    for factor in (0.7, 1.0, 2.0):
        wanted = -5.0 * (np.expm1(-0.05 / (factor * CAR.steering.lag)) - np.expm1(-0.05 / CAR.steering.lag))
        assert _identified(factor)["response_now"] == pytest.approx(wanted, abs=0.01)


def test_a_later_actuator_is_identified():
    nominal = -5.0 * np.expm1(-0.05 / CAR.steering.lag)
    found = _identified(delay=1)
    # A step later the answer is to the command before, of which the wheel then had its share.
    assert found["response_now"] == pytest.approx(-nominal, abs=0.01)
    assert found["response_before"] == pytest.approx(nominal, abs=0.01)


def test_a_car_that_changes_is_seen():
    before, after = _identified(1.0), _identified(2.0)
    changed = _identified(1.0, steps=1200, changed=2.0)
    assert abs(changed["response_now"] - after["response_now"]) < 0.1
    assert abs(changed["response_now"] - before["response_now"]) > 0.5


def test_slip_offsets_are_told_per_lateral_acceleration():
    found = _identified(offsets=(0.004, -0.002))
    assert found["front_slip"] == pytest.approx(0.4, rel=0.1)
    assert found["rear_slip"] == pytest.approx(-0.2, rel=0.1)


def test_noise_is_told_by_second_differences():
    """Of white noise their mean square is six times the noise's."""
    quiet, loud = _identified(noise=0.0), _identified(noise=0.05)
    assert quiet["little_noise"] < 1e-6
    square = 6.0 * 0.05**2
    assert loud["much_noise"] == pytest.approx(square / (square + 0.01), rel=0.15)


def test_what_does_not_steer_is_no_base(record, monkeypatch):
    base = SimpleNamespace(name="walker", predict=None)
    monkeypatch.setattr("lanekeep_agents.binding._designed", lambda name, scenario: base)
    with pytest.raises(ValueError, match="base='walker' is not allowed"):
        StudentPolicy(record, _tensors(record))


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 32, 256, 1024])
def test_takes_half_as_long_again_as_its_bases_at_the_most(record, n):
    """CPU time, in turns, the least of many; only a machine with nothing else to do shows it."""
    policy, rows = StudentPolicy(record, _tensors(record)), _histories(n, 2)[1]
    bases = [lanekeep_baselines.make(name, SCENARIO) for name in BASES]
    states = [one.predict(rows)[1] for one in (policy, *bases)]

    def seconds(which):
        began = time.thread_time()
        for _ in range(20):
            for i in which:
                (policy, *bases)[i].predict(rows, states[i], np.zeros(n, dtype=bool))
        return time.thread_time() - began

    mine, theirs = zip(*((seconds([0]), seconds([1, 2])) for _ in range(20)), strict=True)
    assert min(mine) < 1.5 * min(theirs)


def test_hash_of_the_weights_is_that_of_the_file(record, tmp_path):
    file, weights = _written(tmp_path, record)
    assert read_record(file).sha256 == hashlib.sha256(weights.read_bytes()).hexdigest()
