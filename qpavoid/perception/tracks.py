"""Tracks: bodies followed from scan to scan by a Kalman filter with constant velocity.

The filter is that of :mod:`qpavoid.model.estimate`: white acceleration, one covariance
(P_pp, P_pv, P_vv) for both axes. A track is *confirmed*, and then a moving obstacle,
once it was seen in several scans, in ever-free space or after it left the place where
it began, and has moved farther and faster than noise explains.
"""

import math

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import (
    FREE_COUNT,
    SCORE,
    Cell,
    Moment,
    cell_of,
    is_ever_free,
    row_of,
)
from qpavoid.perception.scan import (
    BEAM_SEGMENT,
    BEAM_TRACK,
    CLAIMED,
    ECHO_BEAM,
    ECHO_X,
    ECHO_Y,
    beam_towards,
    sees_through,
)
from qpavoid.perception.segments import (
    AWAY_X,
    AWAY_Y,
    CENTRE_SIGMA,
    CENTRE_X,
    CENTRE_Y,
    CUT,
    ECHO_COUNT,
    HIDDEN,
    LATER,
    LEFTMOST,
    MIDDLE_X,
    MIDDLE_Y,
    OPEN_SHARE,
    RIGHTMOST,
    SEGMENT_EXTENT,
    SEGMENT_TRACK,
    SPACE,
    View,
)
from qpavoid.types import Array

(
    TRACK_X,  # centre of the body, m
    TRACK_Y,
    TRACK_V_X,  # its velocity, m/s
    TRACK_V_Y,
    P_PP,  # covariance: m², m²/s, m²/s²
    P_PV,
    P_VV,
    LAST_SEEN,  # s, last scan in which it was seen
    BORN_X,  # where it began, m
    BORN_Y,
    SIGHTS,  # scans in which it was seen
    FAST,  # scans in a row in which its speed exceeded its uncertainty
    CONFIRMED,  # 1: it is a moving obstacle
    SIZE,  # m, greatest width
    STILL_TIME,  # s, for how long it has been slower than SLOW_BODY
    PASSED,  # scans in a row that saw through it
    NAME,  # number of the track
    ECHOES,  # mean number of echoes
    COVER,  # m, radius about the centre that holds its echoes
    PARTS,  # segments given to it in this scan
    NARROW,  # 1: the first of them is narrower than a body
) = range(21)
TRACK_WIDTH = 21

MOST_TRACKS = 64
"""More are not begun; their echoes stay points."""

THIN = 0.22
"""m; narrower segments are shins."""

BODY_SIGMA, SHIN_SIGMA, PAIR_SIGMA = 0.05, 0.20, 0.14
"""m; σ of the centre of a body, and of a walker's by one shin and by both."""

BEHIND_SHIN, ARC = 0.05, 0.785
"""m, and radii, by which a centre is behind the mean of the echoes."""

PART_HIDDEN = 0.05
"""m by which a segment is narrower than its body where a part is taken to be hidden."""

FIT_ROUNDS, FIT_WEIGHT, FIT_SHIFT = 3, 0.0125, 0.25
"""Of the fit of a circle: iterations, weight of the first guess per echo, and the
greatest distance from it, m."""

FIT_COUNT = 5.0
"""Echoes from which a circle is fitted."""

GATE, GATE_SIGMA, GATE_SPEED = 0.35, 0.4, 1.5
"""m; the most that 2 σ add to it, m; and m/s that are added for a new track."""

NEW_COST, SHUT_COST = 0.1, 0.15
"""m added to the distance from a new track, and of a segment not in ever-free space."""

LEG_APART, LEG_WIDTH = 0.45, 0.3
"""m; a second shin is nearer to its track, and both are narrower."""

PAIR_APART = 0.4
"""m; two shins that begin a track."""

NEAR_TRACK, DOUBLE, CLAIM = 0.45, 0.25, 0.08
"""m; an echo is near a track; two tracks are one body; around it echoes are its own."""

SLOW_BODY, SURE, TRAVEL = 0.15, 1.2, 0.25
"""m/s, σ of the velocity, and m that a confirmed track exceeds."""

LEAST_SIGHTS, LEAST_SHARE, LEAST_ECHOES = 3.0, 0.3, 1.4
"""Of a confirmed track: scans; share in ever-free space; mean number of echoes."""

LEFT_TRAVEL, LEFT_QUICK, LEFT_SCORE = 0.5, 5.0, 0.5
"""m and fast scans in a row that confirm a body outside of ever-free space, and the
score (s) of the place where it began, which has been seen through since then."""

COAST, NEW_COAST, UNSEEN_COAST, MOST_STILL = 1.0, 0.35, 4.0, 30.0
"""s for which an unseen track is kept: confirmed, new, confirmed and outside of the
field of view; s at rest after which a confirmed track becomes points."""

PASSES, MOST_PASSED = 0.4, 3.0
"""m by which a beam passes a track; scans in a row after which it is dropped."""


@compiled
def predict(track: Array, dt: float, acceleration: float) -> None:
    """Predict a track over dt (s) with white acceleration (m/s²)."""
    t, pushed = track, (acceleration * dt) ** 2
    t[TRACK_X] += dt * t[TRACK_V_X]
    t[TRACK_Y] += dt * t[TRACK_V_Y]
    t[P_PP] += dt * (2.0 * t[P_PV] + dt * (t[P_VV] + pushed / 3.0))
    t[P_PV] += dt * (t[P_VV] + 0.5 * pushed)
    t[P_VV] += pushed
    t[PARTS] = 0.0


@compiled
def correct(track: Array, x: float, y: float, sigma: float) -> None:
    """Correct a track by a position with its σ, m."""
    t, noise = track, sigma * sigma
    total = t[P_PP] + noise
    gain, gain_v = t[P_PP] / total, t[P_PV] / total
    d_x, d_y = x - t[TRACK_X], y - t[TRACK_Y]
    t[TRACK_X] += gain * d_x
    t[TRACK_Y] += gain * d_y
    t[TRACK_V_X] += gain_v * d_x
    t[TRACK_V_Y] += gain_v * d_y
    t[P_VV] = max(t[P_VV] - gain_v * t[P_PV], 1e-6)
    t[P_PP], t[P_PV] = gain * noise, gain_v * noise


@compiled_once
def mark_beside(view: View, tracks: Array, count: int) -> None:
    """Write for each echo the confirmed track that it is nearest to, if it is near."""
    for k in range(view.echoes):
        one = view.scan[int(view.scan[k, ECHO_BEAM])]
        best = NEAR_TRACK
        for a in range(count):
            t = tracks[a]
            apart = math.hypot(one[ECHO_X] - t[TRACK_X], one[ECHO_Y] - t[TRACK_Y])
            if t[CONFIRMED] > 0.0 and apart < best:
                best, one[BEAM_TRACK] = apart, a


@compiled_once
def find_centre(
    view: View, segment: Array, group: int, width: float, radius: float
) -> None:
    """Write the centre of a segment's body and its σ.

    A narrow one is a shin. Otherwise the body is a circle, as wide as its track has
    been seen (``width``) and at most of ``radius``, m. It is fitted to the echoes from
    a guess behind their mean; where one side is hidden, the guess is from the other.
    """
    s = segment
    if width < THIN:
        s[CENTRE_X] = s[MIDDLE_X] + BEHIND_SHIN * s[AWAY_X]
        s[CENTRE_Y] = s[MIDDLE_Y] + BEHIND_SHIN * s[AWAY_Y]
        s[CENTRE_SIGMA] = SHIN_SIGMA
        return
    r, aside = min(radius, 0.5 * (width + s[SPACE])), 0.0
    if s[LEFTMOST] - s[RIGHTMOST] < 2.0 * r - PART_HIDDEN:
        if s[HIDDEN] == 1.0:
            aside = s[LEFTMOST] - r
        elif s[HIDDEN] == 2.0:
            aside = s[RIGHTMOST] + r
    x = s[MIDDLE_X] + ARC * r * s[AWAY_X] - aside * s[AWAY_Y]
    y = s[MIDDLE_Y] + ARC * r * s[AWAY_Y] + aside * s[AWAY_X]
    s[CENTRE_X], s[CENTRE_Y] = x, y
    s[CENTRE_SIGMA] = BODY_SIGMA if s[CUT] == 0.0 else SHIN_SIGMA
    if s[ECHO_COUNT] >= FIT_COUNT and s[SEGMENT_EXTENT] > THIN:
        f_x, f_y = fit_circle(view, group, r, (x, y), FIT_WEIGHT * s[ECHO_COUNT])
        if math.hypot(f_x - x, f_y - y) < FIT_SHIFT:
            s[CENTRE_X], s[CENTRE_Y] = f_x, f_y


@compiled_once
def fit_circle(
    view: View, group: int, radius: float, guess: tuple[float, float], weight: float
) -> tuple[float, float]:
    """Return the centre of a circle through a segment's echoes: Gauss-Newton, m."""
    x, y = guess
    for _ in range(FIT_ROUNDS):
        xx, xy, yy = weight, 0.0, weight
        b_x, b_y = weight * (x - guess[0]), weight * (y - guess[1])
        for k in range(view.echoes):
            one = view.scan[int(view.scan[k, ECHO_BEAM])]
            if one[BEAM_SEGMENT] == group:
                e_x, e_y = x - one[ECHO_X], y - one[ECHO_Y]
                size = max(math.hypot(e_x, e_y), 1e-6)
                j_x, j_y = e_x / size, e_y / size
                xx, xy, yy = xx + j_x * j_x, xy + j_x * j_y, yy + j_y * j_y
                b_x += j_x * (size - radius)
                b_y += j_y * (size - radius)
        det = xx * yy - xy * xy
        x, y = x - (yy * b_x - xy * b_y) / det, y - (xx * b_y - xy * b_x) / det
    return x, y


@compiled
def apart_of(track: Array, segment: Array) -> float:
    """Return the distance of a segment's body from a track, m."""
    s, t = segment, track
    return math.hypot(s[CENTRE_X] - t[TRACK_X], s[CENTRE_Y] - t[TRACK_Y])


@compiled_once
def associate(
    tracks: Array, count: int, segments: Array, found: int, dt: float
) -> None:
    """Give segments to tracks: the nearest pair within its gate first."""
    for _ in range(min(count, found)):
        best, pick, to = math.inf, -1, -1
        for a in range(count):
            t = tracks[a]
            new = t[CONFIRMED] == 0.0
            gate = GATE + min(2.0 * math.sqrt(t[P_PP]), GATE_SIGMA)
            gate += GATE_SPEED * dt if new else 0.0
            for b in range(found if t[PARTS] == 0.0 else 0):
                s = segments[b]
                cost = apart_of(t, s) + (NEW_COST if new else 0.0)
                cost += SHUT_COST if s[OPEN_SHARE] < LEAST_SHARE else 0.0
                if s[SEGMENT_TRACK] < 0.0 and cost < min(gate, best):
                    best, pick, to = cost, b, a
        if pick < 0:
            break
        segments[pick, SEGMENT_TRACK], tracks[to, PARTS] = to, 1.0
        tracks[to, NARROW] = 1.0 if segments[pick, SEGMENT_EXTENT] < LEG_WIDTH else 0.0
    add_legs(tracks, count, segments, found)


@compiled_once
def add_legs(tracks: Array, count: int, segments: Array, found: int) -> None:
    """Give a narrow segment that is left to the track of the other shin beside it."""
    for b in range(found):
        s = segments[b]
        if s[SEGMENT_TRACK] >= 0.0 or s[SEGMENT_EXTENT] >= LEG_WIDTH:
            continue
        best, to = LEG_APART, -1
        for a in range(count):
            if apart_of(tracks[a], s) < best:
                best, to = apart_of(tracks[a], s), a
        if to >= 0 and tracks[to, PARTS] > 0.0 and tracks[to, NARROW] > 0.0:
            s[SEGMENT_TRACK] = to
            tracks[to, PARTS] += 1.0


@compiled_once
def measure(
    view: View, segments: Array, found: int, track: Array, row: int, radius: float
) -> tuple[float, float]:
    """Correct a track by its segments; return their echoes and greatest open share."""
    t, x, y, sigma, total, share = track, 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(found):
        if segments[b, SEGMENT_TRACK] == row:
            t[SIZE] = max(t[SIZE], segments[b, SEGMENT_EXTENT])
    for b in range(found):
        s = segments[b]
        if s[SEGMENT_TRACK] == row:
            find_centre(view, s, b, t[SIZE] if t[PARTS] == 1.0 else 0.0, radius)
            # Brought to the time of the scan.
            x += s[CENTRE_X] - t[TRACK_V_X] * s[LATER]
            y += s[CENTRE_Y] - t[TRACK_V_Y] * s[LATER]
            sigma, total = max(sigma, s[CENTRE_SIGMA]), total + s[ECHO_COUNT]
            share = max(share, s[OPEN_SHARE])
    sigma = PAIR_SIGMA if t[PARTS] > 1.0 else sigma
    correct(t, x / t[PARTS], y / t[PARTS], sigma)
    return total, share


@compiled_once
def confirm(
    track: Array, echoes: float, share: float, cells: Array, now: Moment
) -> None:
    """Note that a track was seen; confirm it, or end it as a body at rest."""
    t = track
    t[SIGHTS] += 1.0
    t[LAST_SEEN], t[PASSED] = now.time, 0.0
    t[ECHOES] += 0.3 * (echoes - t[ECHOES])
    speed = math.hypot(t[TRACK_V_X], t[TRACK_V_Y])
    t[FAST] = t[FAST] + 1.0 if speed > max(2.0 * math.sqrt(t[P_VV]), SLOW_BODY) else 0.0
    moved = math.hypot(t[TRACK_X] - t[BORN_X], t[TRACK_Y] - t[BORN_Y])
    known = t[SIGHTS] >= LEAST_SIGHTS and t[ECHOES] >= LEAST_ECHOES
    moves = moved > TRAVEL and speed > max(SLOW_BODY, SURE * math.sqrt(t[P_VV]))
    opened = share > LEAST_SHARE
    if not opened and moved > LEFT_TRAVEL and t[FAST] >= LEFT_QUICK:
        cell = cells[row_of(cell_of(t[BORN_X]), cell_of(t[BORN_Y]))]
        opened = cell[FREE_COUNT] >= 2.0 and cell[SCORE] < LEFT_SCORE
    if known and opened and moves:
        t[CONFIRMED] = 1.0
    t[STILL_TIME] = t[STILL_TIME] + now.dt if speed < SLOW_BODY else 0.0
    if t[CONFIRMED] > 0.0 and t[STILL_TIME] > MOST_STILL:
        t[CONFIRMED], t[SIGHTS], t[FAST], t[STILL_TIME] = 0.0, 1.0, 0.0, 0.0
        t[BORN_X], t[BORN_Y] = t[TRACK_X], t[TRACK_Y]


@compiled_once
def claim(
    view: View, segments: Array, tracks: Array, count: int, radius: float
) -> None:
    """Mark the echoes of the segments of confirmed tracks; write the tracks' COVER."""
    for a in range(count):
        if tracks[a, PARTS] > 0.0:
            tracks[a, COVER] = radius
    for k in range(view.echoes):
        one = view.scan[int(view.scan[k, ECHO_BEAM])]
        row = (
            int(segments[int(one[BEAM_SEGMENT]), SEGMENT_TRACK])
            if one[BEAM_SEGMENT] >= 0.0
            else -1
        )
        if row >= 0 and tracks[row, CONFIRMED] > 0.0:
            t = tracks[row]
            one[CLAIMED] = 1.0
            apart = math.hypot(one[ECHO_X] - t[TRACK_X], one[ECHO_Y] - t[TRACK_Y])
            t[COVER] = max(t[COVER], apart)


@compiled_once
def claim_around(
    view: View, tracks: Array, count: int, cells: Array, centre: Cell, time: float
) -> None:
    """Mark other echoes around confirmed tracks, but those of known obstacles."""
    for k in range(view.echoes):
        one = view.scan[int(view.scan[k, ECHO_BEAM])]
        for a in range(count if one[CLAIMED] == 0.0 else 0):
            t = tracks[a]
            apart = math.hypot(one[ECHO_X] - t[TRACK_X], one[ECHO_Y] - t[TRACK_Y])
            own = (
                t[CONFIRMED] > 0.0 and t[LAST_SEEN] == time and apart < t[COVER] + CLAIM
            )
            if own and is_ever_free(cells, one[ECHO_X], one[ECHO_Y], centre, 0):
                one[CLAIMED] = 1.0
                t[COVER] = max(t[COVER], apart)
                break


@compiled_once
def begin_tracks(
    tracks: Array, count: int, segments: Array, found: int, time: float
) -> int:
    """Begin tracks of segments that no track has; return the number of tracks.

    Two shins side by side begin one. A new track is at rest with σ = 1 m/s.
    """
    for b in range(found):
        s = segments[b]
        if s[SEGMENT_TRACK] >= 0.0 or count >= MOST_TRACKS:
            continue
        t, x, y, other = tracks[count], s[CENTRE_X], s[CENTRE_Y], -1
        best = PAIR_APART if s[SEGMENT_EXTENT] < THIN else 0.0
        for c in range(b + 1, found):
            o = segments[c]
            apart = math.hypot(o[CENTRE_X] - x, o[CENTRE_Y] - y)
            if o[SEGMENT_TRACK] < 0.0 and o[SEGMENT_EXTENT] < THIN and apart < best:
                best, other = apart, c
        s[SEGMENT_TRACK] = count
        if other >= 0:
            o = segments[other]
            o[SEGMENT_TRACK] = count
            x, y = 0.5 * (x + o[CENTRE_X]), 0.5 * (y + o[CENTRE_Y])
        for k in range(TRACK_WIDTH):
            t[k] = 0.0
        t[TRACK_X], t[TRACK_Y], t[BORN_X], t[BORN_Y] = x, y, x, y
        t[P_PP], t[P_VV], t[SIZE] = s[CENTRE_SIGMA] ** 2, 1.0, s[SEGMENT_EXTENT]
        t[LAST_SEEN], t[SIGHTS], t[ECHOES], t[NAME] = time, 1.0, 1.0, -1.0
        count += 1
    return count


@compiled
def move_track(tracks: Array, source: int, target: int) -> None:
    """Copy a track to another row."""
    for k in range(TRACK_WIDTH):
        tracks[target, k] = tracks[source, k]


@compiled_once
def drop_doubles(tracks: Array, count: int) -> int:
    """Drop the newer or unconfirmed of two tracks of one body; return how many stay."""
    a = 0
    while a < count:
        b = a + 1
        while b < count:
            t, o = tracks[a], tracks[b]
            if math.hypot(t[TRACK_X] - o[TRACK_X], t[TRACK_Y] - o[TRACK_Y]) >= DOUBLE:
                b += 1
                continue
            if o[CONFIRMED] > t[CONFIRMED]:
                move_track(tracks, b, a)
            count -= 1
            move_track(tracks, count, b)
        a += 1
    return count


@compiled_once
def drop_lost(view: View, tracks: Array, count: int, time: float) -> int:
    """Drop tracks that are seen through, or unseen for too long; return the rest."""
    kept = 0
    for a in range(count):
        t = tracks[a]
        keep = True
        if t[LAST_SEEN] < time:
            passed = sees_through(
                view.scan, view.sensor, t[TRACK_X], t[TRACK_Y], PASSES
            )
            t[PASSED] += 1.0 if passed else 0.0
            beam = beam_towards(view.scan, view.sensor, t[TRACK_X], t[TRACK_Y])
            coast = COAST if beam >= 0 else UNSEEN_COAST
            coast = coast if t[CONFIRMED] > 0.0 else NEW_COAST
            keep = t[PASSED] < MOST_PASSED and time - t[LAST_SEEN] <= coast + 1e-6
        if keep:
            move_track(tracks, a, kept)
            kept += 1
    return kept
