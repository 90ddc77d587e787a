"""Where cars are on their road: the present segment, those crossed, the curvature ahead."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, larger, like
from lanekeep_env.physics.single_track import SMALLEST_PATH_SCALE


@helper
def load_segment(i, segment, block, counted, road):
    """Copy row ``segment`` of the road into the rows of car i."""
    counted[at.SEGMENT, i] = segment
    block[at.SEGMENT_LENGTH, i] = road[segment, at.R_LENGTH]
    block[at.CURVATURE, i] = road[segment, at.R_CURVATURE]
    block[at.CURVATURE_SLOPE, i] = road[segment, at.R_CURVATURE_SLOPE]
    block[at.SPEED_SQUARED, i] = road[segment, at.R_SPEED_SQUARED] * block[at.SPEED_FACTOR, i]
    block[at.SPEED_SQUARED_SLOPE, i] = road[segment, at.R_SPEED_SQUARED_SLOPE] * block[at.SPEED_FACTOR, i]
    block[at.STATION, i] = road[segment, at.R_STATION]


@helper
def cross_segments(k, cars, counters, road):
    """Move cars of block ``k`` that left their segment, forwards or backwards, into the neighbour.

    The sub-step ran on with the old segment's curvature for ``over`` metres; the turn that the new one
    would have given over the same way is put in its place, so headings stay right over any number of jumps. What is
    left after as many segments as there are goes on in the next sub-step: not even inf is looped over for ever.
    """
    first, block = k * cars.shape[2], cars[k]
    along, length = block[at.ALONG], block[at.SEGMENT_LENGTH]
    zero, half, one = like(along[0], 0.0), like(along[0], 0.5), like(along[0], 1.0)
    least = like(along[0], SMALLEST_PATH_SCALE)
    for i in range(block.shape[1]):
        if not (along[i] >= length[i] or along[i] < zero):
            continue  # two loops set up for nothing cost 3 % of a step
        for _ in range(road.shape[0]):
            if not along[i] >= length[i]:
                break
            over = along[i] - length[i]
            slope = block[at.CURVATURE_SLOPE, i]
            old = block[at.CURVATURE, i] + slope * length[i]
            following = np.int64(road[counters[at.SEGMENT, first + i], at.R_NEXT])
            load_segment(i, following, block, counters[:, first:], road)
            new = block[at.CURVATURE, i]
            d = block[at.LATERAL, i]
            way = over * larger(one - d * old, least)  # driven beside the centre line
            after = way / larger(one - d * new, least)
            turned = (old + half * slope * over) * over
            turn = turned - (new + half * block[at.CURVATURE_SLOPE, i] * after) * after
            block[at.HEADING, i] += turn
            block[at.LATERAL, i] = d + half * turn * way
            along[i] = after
        for _ in range(road.shape[0]):
            if not (along[i] < zero and road[counters[at.SEGMENT, first + i], at.R_PREVIOUS] >= zero):
                break
            # Backwards the old segment's start curvature was held: no turn but by that.
            over = along[i]
            old = block[at.CURVATURE, i]
            before = np.int64(road[counters[at.SEGMENT, first + i], at.R_PREVIOUS])
            load_segment(i, before, block, counters[:, first:], road)
            new = block[at.CURVATURE, i] + block[at.CURVATURE_SLOPE, i] * length[i]
            d = block[at.LATERAL, i]
            after = over * larger(one - d * old, least) / larger(one - d * new, least)
            block[at.HEADING, i] += old * over - new * after
            along[i] = length[i] + after


@inline
def _shape(road, segment):
    """Return length, m, curvature at the start, 1/m, and its slope, 1/m², of a segment."""
    return road[segment, at.R_LENGTH], road[segment, at.R_CURVATURE], road[segment, at.R_CURVATURE_SLOPE]


@inline
def _go_on(segment, along, road):
    """Return segment and place on it, m, of a place ``along`` or more metres behind the start of a segment."""
    left = np.int64(road.shape[0])
    while left > 0 and along >= road[segment, at.R_LENGTH]:
        # As long as the next row is the next segment, the processor need not wait for what a row says of it.
        begin = segment
        for following in range(begin + 1, begin + left + 1):
            if not (along >= road[segment, at.R_LENGTH] and road[segment, at.R_NEXT] == like(along, following)):
                break
            along -= road[segment, at.R_LENGTH]
            segment = following
        left -= segment - begin
        if left > 0 and along >= road[segment, at.R_LENGTH]:
            along -= road[segment, at.R_LENGTH]
            segment = np.int64(road[segment, at.R_NEXT])
            left -= 1
    return segment, along


@inline
def _find(segment, along, road):
    """Return segment and place on it, m, of a place ``along`` from the start of a segment, before or behind it."""
    zero = like(along, 0.0)
    segment, along = _go_on(segment, along, road)
    for _ in range(road.shape[0]):
        if not (along < zero and road[segment, at.R_PREVIOUS] >= zero):  # a car that backs up
            break
        segment = np.int64(road[segment, at.R_PREVIOUS])
        along += road[segment, at.R_LENGTH]
    return segment, along


@helper
def look_ahead(first, last, block, counted, road, settings, observation):
    """Write curvature at the car and ahead of it, along the road at the present speed or at fixed distances."""
    column = np.int64(settings[at.FIRST_PREVIEW])
    place = at.CHANNELS + 2 * column
    low, high = settings[place], settings[place + 1]
    samples = np.int64(settings[at.PREVIEW])
    for i in range(first, last if samples > 0 else first):
        segment = counted[at.SEGMENT, i]
        zero = like(low, 0.0)
        along = larger(block[at.ALONG, i], zero)
        spacing = block[at.SPEED, i] * settings[at.PREVIEW_TIME] + settings[at.PREVIEW_DISTANCE]
        length, curvature, slope = _shape(road, segment)
        for k in range(samples):
            if along >= length or along < zero:  # two loops set up for nothing cost half of all this
                segment, along = _find(segment, along, road)
                length, curvature, slope = _shape(road, segment)
            observation[i, column + k] = clip(curvature + slope * larger(along, zero), low, high)
            along += spacing


@helper
def curvature_ahead(i, way, block, counted, road):
    """Return the curvature of the road ``way`` metres ahead of car i, 1/m."""
    along = larger(block[at.ALONG, i], like(way, 0.0)) + way
    segment, along = _go_on(counted[at.SEGMENT, i], along, road)
    return road[segment, at.R_CURVATURE] + road[segment, at.R_CURVATURE_SLOPE] * along
