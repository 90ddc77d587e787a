"""Why a quantity comes out otherwise than a work says: a sentence by work and by how the quantity begins."""

from __future__ import annotations

DIFFERENCES: dict[str, dict[str, str]] = {
    "traechtler": {
        "limit cycle": "checked with finer steps: at 10 ms it is 0.043 m at 4 m/s and 0.061 m at 6 m/s here as well",
    },
    "knightriders": {},
    "werling": {
        "error after 3 s": "2 mm, 0.3 % of the start's 0.8 m; where they come from is not known",
        "largest error backwards": "a range was checked, of which the middle stands here; it lies inside",
        "gap over L + τ v": "the gap goes to its set-point exponentially and is 0.2 % from it after 15 s",
        "standstill": "read off Figure 10 to a second",
        "avoidable contacts": (
            "measured: hard braking, cut-ins and late stop points take more than 3.5 m/s²; the claim holds without such"
            " hazards, or with a second level, which the article has not"
        ),
        "way to the set position": "the law takes its pace along the path as constant, and is told of braking late",
        "lateral error in that": "the article's law takes the speed as constant; the car brakes with 3 m/s²",
    },
    "yin": {
        "(b) smallest radius": "both are printed: 1/91.8 m is 0.010893 1/m, which rounds to 0.0109",
        "(b) RMS deviation": "checked over 30 s from places along the road, here over all of it from its start",
        "RMS deviation, sine": (
            "checked in linear path coordinates; a car that runs wide drives the wider bend (at a tenth of curvature"
            " and start, where that is little, ten times the RMS is equal)"
        ),
    },
}
