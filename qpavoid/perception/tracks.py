"""Tracks: bodies followed from scan to scan by a Kalman filter with constant velocity.

The filter is that of :mod:`qpavoid.model.estimate`: white acceleration, one covariance
(P_pp, P_pv, P_vv) for both axes. A track hands out a velocity once it is *confirmed*:
seen in several scans, in ever-free space, faster than a threshold and so far from where
it began that noise does not explain it.
"""

import math

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import FREE_COUNT, SCORE, cell_of, is_ever_free, row_of
from qpavoid.perception.scan import (
    AWAY_X,
    AWAY_Y,
    BESIDE,
    CLAIMED,
    COUNT,
    ECHO_X,
    ECHO_Y,
    GROUP,
    HIDDEN,
    MIDDLE_X,
    MIDDLE_Y,
    ORDER,
    RANGE,
    LATER,
    LEAST,
    MOST,
    SHARE,
    SPACE,
    USED,
    WIDTH,
)
from qpavoid.types import Array

(
    TRACK_X,  # position of the body's centre, m
    TRACK_Y,
    V_X,  # velocity, m/s
    V_Y,
    P_PP,  # covariance: m², m²/s, m²/s²
    P_PV,
    P_VV,
    SEEN,  # s, last scan in which it was seen
    BORN_X,  # where it was seen first, m
    BORN_Y,
    SIGHTS,  # scans in which it was seen
    FAST,  # scans in a row in which its speed exceeded its uncertainty
    CONFIRMED,  # 1: it is a moving obstacle
    SIZE,  # m, width that decays by 10 % a scan
    STILL,  # s, for how long it has been slower than SLOW
    THROUGH,  # scans in a row that saw through it
    NAME,  # number of the track
    ECHOES,  # mean number of echoes
    PARTS,  # segments given to it in this scan
    SUM_X,  # of their centres, m
    SUM_Y,
    SIGMA,  # greatest σ of them, m
    OPEN_SHARE,  # greatest share in ever-free space
    NARROW,  # 1: the first of them is narrower than a body
    COVER,  # m, radius about the position that holds all its echoes
) = range(25)
TRACK_WIDTH = 25
MOST_TRACKS = 64

THIN = 0.22
"""m; narrower segments are shins or slivers."""

BODY_SIGMA, SHIN_SIGMA, PAIR_SIGMA = 0.05, 0.20, 0.14
"""m; σ of a body's centre, of a single shin, of two shins."""

REACH, REACH_SIGMA, REACH_SPEED = 0.35, 0.4, 1.5
"""Gate: m; the most m that two σ add; m/s of an unconfirmed track."""

YOUNG_COST = 0.1
"""m by which a confirmed track is preferred."""

NEAR_TRACK, DOUBLE = 0.45, 0.25
"""m; an echo is near a track; two tracks are one body."""

SIZE_TIME = 10.0
"""s in which a width that is no longer seen decays to 37 %."""

SHUT_COST = 0.15
"""m by which a segment in ever-free space is preferred."""

LEG_APART, LEG_WIDTH = 0.45, 0.3
"""m; the second segment of a body is nearer to its track and both are narrower."""

SLOW, TRAVEL, QUICK = 0.15, 0.25, 3
"""Confirmation: faster than SLOW m/s and TRAVEL m from its beginning, or half of that
and in QUICK scans in a row faster than two σ."""

LEAST_SIGHTS, LEAST_SHARE, LEAST_ECHOES = 3, 0.3, 1.4
"""Confirmation: scans; share of echoes in ever-free space; mean number of echoes."""

COAST, YOUNG_COAST, STAND = 1.0, 0.35, 30.0
"""s for which an unseen track is kept, confirmed or not, and after which a confirmed
track that stands still becomes points."""

SEEN_THROUGH, MOST_THROUGH = 0.4, 3
"""m by which a beam passes a track, and scans in a row after which it is dropped."""

CLAIM = 0.08
"""m around a body whose echoes belong to it."""

NARROWED = 0.05
"""m by which a segment is narrower than its body where a part is taken to be hidden."""

FIT_ROUNDS, FIT_WEIGHT, FIT_SHIFT = 3, 0.0625, 0.25
"""Of the fit of a circle: iterations, weight of the first guess, most m from it."""


@compiled
def predict(track: Array, dt: float, acceleration: float) -> None:
    """Predict a track over dt s."""
    t = track
    pushed = (acceleration * dt) ** 2
    t[TRACK_X] += dt * t[V_X]
    t[TRACK_Y] += dt * t[V_Y]
    t[P_PP] += dt * (2.0 * t[P_PV] + dt * (t[P_VV] + pushed / 3.0))
    t[P_PV] += dt * (t[P_VV] + 0.5 * pushed)
    t[P_VV] += pushed


@compiled
def correct(track: Array, x: float, y: float, sigma: float) -> None:
    """Correct a track by a position with σ, m."""
    t = track
    noise = sigma * sigma
    total = t[P_PP] + noise
    gain, gain_v = t[P_PP] / total, t[P_PV] / total
    d_x, d_y = x - t[TRACK_X], y - t[TRACK_Y]
    t[TRACK_X] += gain * d_x
    t[TRACK_Y] += gain * d_y
    t[V_X] += gain_v * d_x
    t[V_Y] += gain_v * d_y
    t[P_VV] = max(t[P_VV] - gain_v * t[P_PV], 1e-6)
    t[P_PP], t[P_PV] = gain * noise, gain_v * noise


@compiled_once
def body_centre(
    scan: Array, segment: Array, group: int, count: int, width: float, most: float
) -> tuple[float, float, float]:
    """Return the centre x, y of the body of a segment, and its σ, m.

    A narrow one is a shin. Otherwise it is a circle of a radius that is fixed, behind
    the visible arc: least squares of the distances, held to a first guess.
    """
    s = segment
    if width < THIN:
        return s[MIDDLE_X] + 0.05 * s[AWAY_X], s[MIDDLE_Y] + 0.05 * s[AWAY_Y], SHIN_SIGMA
    radius = min(most, 0.5 * (width + s[SPACE]))
    aside = 0.0
    if s[MOST] - s[LEAST] < 2.0 * radius - NARROWED:
        # A part of it is hidden: its visible side tells where the middle is.
        if s[HIDDEN] == 1.0:
            aside = s[MOST] - radius
        elif s[HIDDEN] == 2.0:
            aside = s[LEAST] + radius
    first_x = s[MIDDLE_X] + 0.785 * radius * s[AWAY_X] - aside * s[AWAY_Y]
    first_y = s[MIDDLE_Y] + 0.785 * radius * s[AWAY_Y] + aside * s[AWAY_X]
    x, y = first_x, first_y
    if s[COUNT] >= 5.0 and s[WIDTH] > THIN:
        weight = FIT_WEIGHT * s[COUNT] / 5.0
        for _ in range(FIT_ROUNDS):
            xx, xy, yy, b_x, b_y = weight, 0.0, weight, weight * (x - first_x), weight * (y - first_y)
            for k in range(count):
                one = scan[int(scan[k, ORDER])]
                if one[GROUP] == group:
                    e_x, e_y = x - one[ECHO_X], y - one[ECHO_Y]
                    size = max(math.hypot(e_x, e_y), 1e-6)
                    j_x, j_y, off = e_x / size, e_y / size, size - radius
                    xx, xy, yy = xx + j_x * j_x, xy + j_x * j_y, yy + j_y * j_y
                    b_x, b_y = b_x + j_x * off, b_y + j_y * off
            det = xx * yy - xy * xy
            x, y = x - (yy * b_x - xy * b_y) / det, y - (xx * b_y - xy * b_x) / det
        if math.hypot(x - first_x, y - first_y) >= FIT_SHIFT:
            x, y = first_x, first_y
    return x, y, BODY_SIGMA


@compiled_once
def mark_beside(scan: Array, echoes: int, tracks: Array, count: int) -> None:
    """Write for each echo the confirmed track that it is nearest to, if it is near."""
    for k in range(echoes):
        one = scan[int(scan[k, ORDER])]
        best, one[BESIDE] = NEAR_TRACK, -1.0
        for a in range(count):
            t = tracks[a]
            if t[CONFIRMED] > 0.0:
                apart = math.hypot(one[ECHO_X] - t[TRACK_X], one[ECHO_Y] - t[TRACK_Y])
                if apart < best:
                    best, one[BESIDE] = apart, a


@compiled_once
def drop_doubles(tracks: Array, count: int) -> int:
    """Drop the younger of two tracks at one place; return how many stay."""
    a = 0
    while a < count:
        b = a + 1
        while b < count:
            apart = math.hypot(tracks[a, TRACK_X] - tracks[b, TRACK_X], tracks[a, TRACK_Y] - tracks[b, TRACK_Y])
            if apart < DOUBLE:
                keep = a
                if tracks[b, CONFIRMED] > tracks[a, CONFIRMED]:
                    for k in range(TRACK_WIDTH):
                        tracks[keep, k] = tracks[b, k]
                count -= 1
                for k in range(TRACK_WIDTH):
                    tracks[b, k] = tracks[count, k]
            else:
                b += 1
        a += 1
    return count


@compiled_once
def associate(
    tracks: Array, count: int, segments: Array, found: int, centres: Array, dt: float
) -> None:
    """Give segments to tracks, the nearest pair first; then second legs.

    Args:
        tracks: Predicted; ``count`` of them.
        segments: ``found`` of them.
        centres: (found, 4) x, y, σ of each, as a body of its own width; and the track
            that it is given to, −1 for none.
        dt: s since the last scan.
    """
    for b in range(found):
        centres[b, 3] = -1.0
    for _ in range(min(count, found)):
        best, pick, to = math.inf, -1, -1
        for a in range(count):
            t = tracks[a]
            if t[PARTS] > 0.0:
                continue
            young = t[CONFIRMED] == 0.0
            gate = REACH + min(2.0 * math.sqrt(t[P_PP]), REACH_SIGMA)
            gate += REACH_SPEED * dt if young else 0.0
            for b in range(found):
                if segments[b, USED] > 0.0:
                    continue
                apart = math.hypot(centres[b, 0] - t[TRACK_X], centres[b, 1] - t[TRACK_Y])
                cost = apart + (YOUNG_COST if young else 0.0)
                cost += SHUT_COST if segments[b, SHARE] < LEAST_SHARE else 0.0
                if cost < gate and cost < best:
                    best, pick, to = cost, b, a
        if pick < 0:
            break
        segments[pick, USED], tracks[to, PARTS], centres[pick, 3] = 1.0, 1.0, to
        tracks[to, NARROW] = 1.0 if segments[pick, WIDTH] < LEG_WIDTH else 0.0
    for b in range(found):
        if segments[b, USED] > 0.0 or segments[b, WIDTH] >= LEG_WIDTH:
            continue
        best, to = LEG_APART, -1
        for a in range(count):
            t = tracks[a]
            apart = math.hypot(centres[b, 0] - t[TRACK_X], centres[b, 1] - t[TRACK_Y])
            if apart < best:
                best, to = apart, a
        if to >= 0 and tracks[to, PARTS] > 0.0 and tracks[to, NARROW] > 0.0:
            segments[b, USED], centres[b, 3] = 1.0, to
            tracks[to, PARTS] += 1.0


@compiled_once
def measure(
    scan: Array, echoes: int, segments: Array, found: int, centres: Array, track: Array, a: int, radius: float, dt: float
) -> float:
    """Correct a track by its segments; return how many echoes they have."""
    t, total, widest = track, 0.0, 0.0
    for b in range(found):
        if centres[b, 3] == a:
            widest = max(widest, segments[b, WIDTH])
    t[SIZE] = max(t[SIZE] * math.exp(-dt / SIZE_TIME), widest)
    x = y = sigma = share = 0.0
    for b in range(found):
        if centres[b, 3] == a:
            width = t[SIZE] if t[PARTS] == 1.0 else 0.0
            c_x, c_y, s = body_centre(scan, segments[b], b, echoes, width, radius)
            # Bring it to the time of the scan.
            x += c_x - t[V_X] * segments[b, LATER]
            y += c_y - t[V_Y] * segments[b, LATER]
            sigma = max(sigma, s)
            share = max(share, segments[b, SHARE])
            total += segments[b, COUNT]
    if t[PARTS] > 1.0:
        sigma = PAIR_SIGMA
    correct(t, x / t[PARTS], y / t[PARTS], sigma)
    t[OPEN_SHARE] = share
    return total


VACATED = 0.5
"""m that a body outside of ever-free space has to move."""


@compiled
def vacated(track: Array, cells: Array, now: float) -> bool:
    """Return whether the place where a track began has been seen through since then."""
    cell = cells[row_of(cell_of(track[BORN_X]), cell_of(track[BORN_Y]))]
    return bool(cell[FREE_COUNT] >= 2.0 and cell[SCORE] < 0.5)


@compiled_once
def cover(scan: Array, echoes: int, centres: Array, track: Array, a: int, radius: float) -> None:
    """Write the radius of a track that holds all its echoes, at least a person's."""
    most = radius
    for k in range(echoes):
        one = scan[int(scan[k, ORDER])]
        group = int(one[GROUP])
        if group >= 0 and centres[group, 3] == a:
            most = max(most, math.hypot(one[ECHO_X] - track[TRACK_X], one[ECHO_Y] - track[TRACK_Y]))
    track[COVER] = most


@compiled_once
def confirm(track: Array, echoes: float, cells: Array, now: float, dt: float) -> None:
    """Confirm a track that was seen, or let one that stands for long become points."""
    t = track
    t[SIGHTS] += 1.0
    t[SEEN], t[THROUGH] = now, 0.0
    t[ECHOES] += 0.3 * (echoes - t[ECHOES])
    speed = math.hypot(t[V_X], t[V_Y])
    fast = speed > max(2.0 * math.sqrt(t[P_VV]), SLOW)
    t[FAST] = t[FAST] + 1.0 if fast else 0.0
    moved = math.hypot(t[TRACK_X] - t[BORN_X], t[TRACK_Y] - t[BORN_Y])
    known = t[SIGHTS] >= LEAST_SIGHTS and t[ECHOES] >= LEAST_ECHOES
    far = moved > TRAVEL or (t[FAST] >= QUICK and moved > 0.5 * TRAVEL)
    is_open = t[OPEN_SHARE] > LEAST_SHARE
    if not is_open and moved > VACATED:
        is_open = t[FAST] >= 5.0 and vacated(t, cells, now)
    if known and is_open and speed > SLOW and far:
        t[CONFIRMED] = 1.0
    t[STILL] = t[STILL] + dt if speed < SLOW else 0.0
    if t[CONFIRMED] > 0.0 and t[STILL] > STAND:
        t[CONFIRMED], t[SIGHTS], t[FAST], t[STILL] = 0.0, 1.0, 0.0, 0.0
        t[BORN_X], t[BORN_Y] = t[TRACK_X], t[TRACK_Y]


@compiled_once
def claim(
    scan: Array, echoes: int, tracks: Array, count: int, centres: Array, cells: Array,
    centre: tuple[int, int], now: float, radius: float,
) -> None:
    """Mark the echoes that belong to confirmed tracks.

    They are those of its segments, and others around it that are not on cells known to
    be static.
    """
    for k in range(echoes):
        one = scan[int(scan[k, ORDER])]
        group = int(one[GROUP])
        if group >= 0 and centres[group, 3] >= 0.0:
            if tracks[int(centres[group, 3]), CONFIRMED] > 0.0:
                one[CLAIMED] = 1.0
        for a in range(count):
            t = tracks[a]
            if one[CLAIMED] == 0.0 and t[CONFIRMED] > 0.0 and t[SEEN] == now:
                d_x, d_y = one[ECHO_X] - t[TRACK_X], one[ECHO_Y] - t[TRACK_Y]
                near = d_x * d_x + d_y * d_y < (radius + CLAIM) ** 2
                if near and is_ever_free(cells, one[ECHO_X], one[ECHO_Y], centre, 0):
                    one[CLAIMED] = 1.0


@compiled
def begin_track(track: Array, x: float, y: float, sigma: float, now: float) -> None:
    """Begin a track at a place, at rest with σ = 1 m/s."""
    for k in range(TRACK_WIDTH):
        track[k] = 0.0
    t = track
    t[TRACK_X], t[TRACK_Y], t[BORN_X], t[BORN_Y] = x, y, x, y
    t[P_PP], t[P_VV] = max(sigma, BODY_SIGMA) ** 2, 1.0
    t[SEEN], t[SIGHTS], t[ECHOES] = now, 1.0, 1.0


@compiled_once
def begin_tracks(
    tracks: Array, count: int, segments: Array, found: int, centres: Array, now: float, named: float
) -> int:
    """Begin tracks for segments that no track has; return the number of tracks.

    Two thin segments side by side are one body.
    """
    for b in range(found):
        if segments[b, USED] > 0.0:
            continue
        segments[b, USED] = 1.0
        x, y, sigma = centres[b, 0], centres[b, 1], centres[b, 2]
        if segments[b, WIDTH] < THIN:
            best, pick = 0.4, -1
            for c in range(b + 1, found):
                if segments[c, USED] == 0.0 and segments[c, WIDTH] < THIN:
                    d_x = segments[c, MIDDLE_X] - segments[b, MIDDLE_X]
                    d_y = segments[c, MIDDLE_Y] - segments[b, MIDDLE_Y]
                    if math.hypot(d_x, d_y) < best:
                        best, pick = math.hypot(d_x, d_y), c
            if pick >= 0:
                segments[pick, USED] = 1.0
                x, y = 0.5 * (x + centres[pick, 0]), 0.5 * (y + centres[pick, 1])
        if count < MOST_TRACKS:
            begin_track(tracks[count], x, y, sigma, now)
            tracks[count, SIZE], tracks[count, NAME] = segments[b, WIDTH], named + count
            count += 1
    return count


@compiled
def beam_towards(
    x: float, y: float, scan: Array, first_angle: float, step: float
) -> int:
    """Return the beam that points to a place; −1: outside of the view."""
    n = scan.shape[0]
    angle = math.atan2(y, x) - first_angle + 0.5 * step
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    k = int(math.floor(angle / step))
    return k if k < n else -1


@compiled_once
def drop_tracks(
    tracks: Array, count: int, scan: Array, origin: tuple[float, float], first_angle: float, step: float, now: float
) -> int:
    """Drop tracks that are seen through or unseen for too long; return how many stay."""
    kept = 0
    for a in range(count):
        t = tracks[a]
        keep = True
        if t[SEEN] < now:
            x, y = t[TRACK_X] - origin[0], t[TRACK_Y] - origin[1]
            beam = beam_towards(x, y, scan, first_angle, step)
            seen = beam >= 0 and scan[beam, RANGE] > math.hypot(x, y) + SEEN_THROUGH
            t[THROUGH] += 1.0 if seen else 0.0
            coast = COAST if t[CONFIRMED] > 0.0 else YOUNG_COAST
            keep = t[THROUGH] < MOST_THROUGH and now - t[SEEN] <= coast + 1e-6
        if keep:
            if kept < a:
                for k in range(TRACK_WIDTH):
                    tracks[kept, k] = t[k]
            kept += 1
    return kept
