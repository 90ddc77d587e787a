"""Every option of every environment, with values beside its default: what tests over the registry try."""

import pytest

import lanekeep_env
from lanekeep_env.scenario import (
    CameraLaneScenario,
    CircuitScenario,
    DriveScenario,
    EvasiveScenario,
    LaneKeepScenario,
    LaneSupportScenario,
    ObstacleCircuitScenario,
    ParallelParkScenario,
    ReversePathScenario,
    TrafficScenario,
    WallFollowScenario,
)

ON_A_ROAD = {
    "vehicle": ["commonroad-2", {"base": "yin", "mass": 2000.0, "steering": {"lag": 0.05, "delay": 0.07}}],
    "dynamics": ["kinematic"],
    "tyre": ["magic_formula", "load_sensitive"],
    "cornering_drag": [True],
    "friction": [0.5],
    "road": ["yin", {"kind": "circle", "radius": 150.0}],
    "speed": [20.0, {"lateral_acceleration": 2.0, "maximum": 30.0, "friction_ellipse": True}],
    "action": ["steering_rate"],
    "max_steering_angle": [0.3],
    "max_steering_rate": [0.2],
    "start_lateral_error": [0.3],
    "start_course_error": [0.1],
    "lane_width": [3.0],
    "reference_lateral_error": [0.3],
    "cost_weight": [0.5],
    "reference_steering_rate": [0.2],
    "cost_cap": [20.0],
    "effort": ["motor"],
    "preview_interval": [0.2],
    "departure": ["cost", "off"],
    "preview": [4],
    "observation": ["full"],
    "randomisation": ["stress", {"steering_delay": [0.0, 0.07]}],
    "sensors": ["poor", {"yaw_rate": {"noise": 0.01}}],
    "control_step": [0.1],
    "episode_steps": [300],
    "bank": [0.03],
    "crosswind": [(-8.0, 8.0)],
    "gusts": [2.0],
    "gust_time": [0.5],
    "patches": [{"friction": (0.4, 0.9), "length": 30.0, "every": 40.0}],
    "changes": [{"mass": (1.2, 1.3), "steering_lag": 2.0, "time": (0.2, 1.0), "duration": 0.5}],
    "dtype": ["float32"],
}
#: What side forces and friction do to a car that rolls without slip.
NONE_WITHOUT_SLIP = {name: [] for name in ("bank", "crosswind", "gusts", "gust_time", "patches")}
BY_CAMERA = {
    **{
        key: ON_A_ROAD[key] for key in ("action", "departure", "observation", "randomisation", "dtype", "episode_steps")
    },
    **{key: ON_A_ROAD[key] for key in ("cost_weight", "cost_cap", "effort", "max_steering_angle", "max_steering_rate")},
    **NONE_WITHOUT_SLIP,
    "changes": [{"steering_lag": 2.0, "time": 0.5}],
    "vehicle": ["yin", {"base": "van", "steering": {"lag": 0.1, "delay": 0.05, "backlash": 0.1, "feedback": "motor"}}],
    "road": [
        {"kind": "circle", "radius": -12.0},
        {"kind": "turn-off", "lost": 2.0},
        "bypass",
        {"kind": "yard", "count": 8},
    ],
    "speed": [4.0, {"minimum": 1.0, "hold": 2.0, "standstill": 0.3, "lateral_acceleration": 1.5}],
    "start_lateral_error": [0.2],
    "start_course_error": [0.1],
    "lane_width": [2.75],
    "reference_lateral_error": [0.3],
    "reference_steering_rate": [0.3],
    "sensors": ["poor", {"edge_distance": {"delay": 0.08}}],
    "control_step": [0.02],
    "camera": [{"edge": "left"}, {"look_ahead": 2.0, "field_of_view": 1.2}],
    "plan": [4],
    "plan_spacing": [0.7],
    "plan_errors": [{"offset": 0.5, "radius": (-0.1, 0.1)}, {"angle": -0.05, "recognised": (2.0, 5.0)}],
    "set_points": [1.2, {"minimum": 1.0, "maximum": 2.0, "hold": 2.0}],
}
BETWEEN_WALLS = {
    **{key: ON_A_ROAD[key] for key in ("action", "observation", "randomisation", "dtype", "episode_steps")},
    **{key: ON_A_ROAD[key] for key in ("cost_weight", "cost_cap", "max_steering_angle")},
    "vehicle": [
        "pses",
        {
            "base": "knightriders",
            "mass": 6.0,
            "steering": {"lag": 0.05, "delay": 0.02, "backlash": 0.02, "feedback": "motor"},
        },
    ],
    "dynamics": ["dynamic"],
    "world": [{"kind": "circuit", "corridor": 1.5, "glass_share": 0.3}, {"kind": "random-circuits", "count": 3}],
    "speed": [0.5, {"minimum": 0.5, "maximum": 3.0, "hold": 0.9, "standstill": 0.2}],
    "max_steering_rate": [1.0],
    "steering_offset": [0.02, (-0.1, 0.03)],
    "servo": [{"left": 0.35, "right": 0.3, "ticks": 50}, {"angles": (-0.35, -0.2, 0.03, 0.1, 0.3)}],
    "effort": [],  # takes another car with backlash: see test_gear
    "set_distance": [0.7],
    "side_sensor": [0.14],
    "start_lateral_error": [0.05],
    "start_heading_error": [0.2],
    "contact": ["cost", "off"],
    "reference_lateral_error": [0.2],
    "reference_steering_rate": [1.0],
    "scan": ["kinect", {"beams": 9, "noise": 0.02, "jump_errors": 0.5, "period": 0.09}],
    "encoder_ticks": [40],
    "encoder_direction": [False],
    "sensors": ["poor", {"yaw_rate": {"bias": 0.05, "delay": 0.09}}],
    "control_step": [0.03],
}
EVASIVE = {
    **ON_A_ROAD,
    "vehicle": ["yin", {"base": "passat", "mass": 2000.0, "steering": {"lag": 0.05, "delay": 0.07}}],
    "tyre": ["linear"],
    "road": [{"kind": "evasive", "side": "left", "before": 8.0}, {"kind": "circle", "radius": 150.0}],
    "max_steering_angle": [0.3],
    "reference_steering_rate": [0.2],
    "observation": ["measured"],
    "episode_steps": [200],
}
SUPPORTING = {
    **ON_A_ROAD,
    **{
        key: []
        for key in ("action", "max_steering_rate", "reference_lateral_error", "reference_steering_rate", "effort")
    },
    "road": ["yin", {"kind": "circle", "radius": 400.0}],
    "speed": [25.0, {"lateral_acceleration": 1.5, "maximum": 30.0}],
    "lane_width": [3.5],
    "preview": [3],
    "episode_steps": [300],
    "driver": ["attentive", {"lapse_rate": 0.2, "longest_lapse": 2.0}],
    "reference_assistance": [0.05],
}
BACKING_UP = {
    **{key: value for key, value in EVASIVE.items() if key not in ("dynamics", "tyre", "cornering_drag", "friction")},
    **NONE_WITHOUT_SLIP,
    "changes": [{"steering_lag": 2.0, "time": 0.5}],
    "road": [{"kind": "parking", "count": 3, "smallest_radius": 6.0}, {"kind": "circle", "radius": -8.0}],
    "speed": [0.8, {"minimum": 0.3, "maximum": 1.0, "hold": 2.0, "standstill": 0.2}],
    "start_lateral_error": [0.3],
    "lane_width": [2.5],
    "observation": ["full"],
    "episode_steps": [300],
}
DRIVING = {
    **EVASIVE,
    **{key: [] for key in ("dynamics", "cornering_drag")},  # nothing else is allowed
    "tyre": ["load_sensitive"],
    "speed": [18.0, {"lateral_acceleration": 2.0, "maximum": 25.0}],
    "reference_steering_rate": [0.3],
    "road": ["yin", {"kind": "circle", "radius": 150.0}],
    "start_lateral_error": [0.2],
    "observation": ["measured"],
    "episode_steps": [300],
    "powertrain": [{"gears": (3.5, 2.0, 1.2), "pedal_lag": 0.0}, {"creep": 0.0, "brake": 6.0}],
    "traffic": [
        [(0, "speed", 8), (0.2, "lead", 12, 5.0), (0.5, "lead_gone"), (0.6, "stop", 20.0), (0.9, "stop_gone")],
        {"count": 4, "largest_speed": 30.0, "hazards": 1.0},
    ],
    "slope": [0.05, (-0.1, 0.02)],
    "wind": [-8.0, (0.0, 10.0)],
    "reference_speed_error": [1.0],
    "friction_circle": [False],
}
AMONG_OTHERS = {
    **{key: value for key, value in DRIVING.items() if key != "traffic"},
    "road": ["yin", {"kind": "circle", "radius": 400.0}],
    "lane_width": [3.5],
    "lanes": [2, 4],
    "flow": ["braking_lead", "cut_in", {"situation": "merging", "cars": 8, "spacing": 60.0, "speeds": (15.0, 20.0)}],
    "set_speed": [20.0, (15.0, 35.0)],
    "gust_time": [],  # as in Drive
}
IN_A_CIRCUIT = {
    **BETWEEN_WALLS,
    **{key: [] for key in ("speed", "set_distance", "side_sensor", "reference_lateral_error")},  # have no effect
    **{key: [] for key in ("cost_weight", "reference_steering_rate", "cost_cap", "effort")},
    "max_speed": [1.0],
    "max_acceleration": [1.0],
    "laps": [2],
}
AMONG_OBSTACLES = {
    **IN_A_CIRCUIT,
    "world": [
        {"kind": "obstacle-circuit", "boxes": [(3.0, -2.6, 0.3, 0.3, 0.2)]},
        {"kind": "random-obstacle-circuits", "count": 3, "glass_share": 0.2},
    ],
    "scan": ["kinect", {"beams": 9, "noise": 0.02, "jump_errors": 0.5, "period": 0.09}],
    "modes": ["roundtrip", [(0.0, "roundtrip"), (0.9, "obstacles")]],
    **{key: [] for key in ("kerb_distance", "parking_angle", "parking_time")},
}
INTO_A_SPACE = {
    **AMONG_OBSTACLES,
    "world": [
        {"kind": "parking-row", "gaps": (0.5, 1.3)},
        {"kind": "random-parking-rows", "count": 3},
        {"kind": "obstacle-circuit", "gaps": (0.6, 1.2)},
    ],
    "modes": [[(0.0, "roundtrip"), (0.9, "park")]],
    "laps": [],
    "max_speed": [0.8],
    "kerb_distance": [0.1],
    "parking_angle": [0.05],
    "parking_time": [1.0],
}
FOLLOWING = {**BETWEEN_WALLS, "encoder_direction": []}  # nothing else has an effect
#: Every option of a scenario, and of those that have only other defaults, with values beside its default.
TABLES = {
    LaneSupportScenario: SUPPORTING,
    LaneKeepScenario: ON_A_ROAD,
    CameraLaneScenario: BY_CAMERA,
    WallFollowScenario: FOLLOWING,
    CircuitScenario: IN_A_CIRCUIT,
    ObstacleCircuitScenario: AMONG_OBSTACLES,
    ParallelParkScenario: INTO_A_SPACE,
    EvasiveScenario: EVASIVE,
    ReversePathScenario: BACKING_UP,
    DriveScenario: DRIVING,
    TrafficScenario: AMONG_OTHERS,
}
OPTIONS = {
    env_id: next((TABLES[base] for base in row.scenario.__mro__ if base in TABLES), {})
    for env_id, row in lanekeep_env.ENVIRONMENTS.items()
}
#: What options take beside them to have an effect.
BESIDE = {
    "friction": {"tyre": "magic_formula"},
    "patches": {"tyre": "magic_formula"},
    "gust_time": {"gusts": 2.0},
    "cornering_drag": {"tyre": "magic_formula"},
    "max_steering_rate": {"action": "steering_rate"},
    "effort": {"vehicle": {"steering": {"lag": 0.1, "backlash": 0.02}}},
    "preview_interval": {"preview": 4},
}
#: One id a family of worlds, of which all is compiled that options decide.
FAMILIES = ("lanekeep/LaneKeep-v0", "lanekeep/Circuit-v0")
#: Options whose values decide what is compiled: each combination may be a kernel of its own.
DISTURBING = ("bank", "crosswind", "gusts", "patches", "changes")
COMPILED = ("vehicle", "effort", "dynamics", "tyre", "servo", "scan", "sensors", "dtype", *DISTURBING)
#: Those of all ids take a minute an id.
COMPILED_OR_NOT = pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])


def decides_what_is_compiled(key):
    """Whether an option does, or what it takes beside it to have an effect."""
    return not {key, *BESIDE.get(key, {})}.isdisjoint(COMPILED)


def options_of(name, compiled):
    """The options of an id; without ``compiled`` those that decide what is compiled only of one id a family."""
    every = compiled or name in FAMILIES
    return {key: values for key, values in OPTIONS[name].items() if every or not decides_what_is_compiled(key)}


def alone(options, known=None):
    """Each value of each option, with no more beside it than it takes to have an effect; ``known`` are all options."""
    for key, values in options.items():
        beside = {other: value for other, value in BESIDE.get(key, {}).items() if other in (known or options)}
        yield from (beside | {key: value} for value in values)
