"""Tracks: bodies followed from scan to scan by a Kalman filter with constant velocity.

The acceleration is white; one covariance (P_pp, P_pv, P_vv) holds for both axes. A
track is *confirmed*, and then a moving obstacle, once it was seen in several scans, in
ever-free space or after it left the place where it began, and has moved farther and
faster than noise explains.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import Cell, Moment, cell_of, is_ever_free, row_of
from qpavoid.perception.scan import beam_towards, sees_through
from qpavoid.perception.segments import View
from qpavoid.types import Row, Table, layout


class Followed(NamedTuple):
    """A track.

    Attributes:
        x: Centre of the body, m.
        y: Of it, m.
        v_x: Its velocity, m/s.
        v_y: Of it, m/s.
        p_pp: Covariance of position, m²,
        p_pv: of position and velocity, m²/s,
        p_vv: of velocity, m²/s².
        last_seen: s, last scan in which it was seen.
        born_x: Where it began, m.
        born_y: Of it, m.
        size: Greatest width, m.
        still_time: s, for how long it has been slower than :data:`SLOW_BODY`.
        echoes: Mean number of echoes.
        cover: Radius about the centre that holds its echoes, m.
        sights: Scans in which it was seen.
        fast: Scans in a row in which its speed exceeded its uncertainty.
        confirmed: 1: it is a moving obstacle.
        passed: Scans in a row that saw through it.
        name: Number of the track.
        parts: Segments given to it in this scan.
        narrow: 1: the first of them is narrower than a body.
    """

    x: float
    y: float
    v_x: float
    v_y: float
    p_pp: float
    p_pv: float
    p_vv: float
    last_seen: float
    born_x: float
    born_y: float
    size: float
    still_time: float
    echoes: float
    cover: float
    sights: int
    fast: int
    confirmed: int
    passed: int
    name: int
    parts: int
    narrow: int


FOLLOWED = layout(Followed)
TRACK_SIZE = FOLLOWED.itemsize // 8
"""Layout of the table of tracks, and numbers of memory per track."""

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

FIT_COUNT = 5
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

LEAST_SIGHTS, LEAST_SHARE, LEAST_ECHOES = 3, 0.3, 1.4
"""Of a confirmed track: scans; share in ever-free space; mean number of echoes."""

LEFT_TRAVEL, LEFT_QUICK, LEFT_SCORE = 0.5, 5, 0.5
"""m and fast scans in a row that confirm a body outside of ever-free space, and the
score (s) of the place where it began, which has been seen through since then."""

COAST, NEW_COAST, UNSEEN_COAST, MOST_STILL = 1.0, 0.35, 4.0, 30.0
"""s for which an unseen track is kept: confirmed, new, confirmed and outside of the
field of view; s at rest after which a confirmed track becomes points."""

PASSES, MOST_PASSED = 0.4, 3
"""m by which a beam passes a track; scans in a row after which it is dropped."""


@compiled
def predict(track: Row, dt: float, acceleration: float) -> None:
    """Predict a track over dt (s) with white acceleration (m/s²)."""
    t, pushed = track, (acceleration * dt) ** 2
    t.x += dt * t.v_x
    t.y += dt * t.v_y
    t.p_pp += dt * (2.0 * t.p_pv + dt * (t.p_vv + pushed / 3.0))
    t.p_pv += dt * (t.p_vv + 0.5 * pushed)
    t.p_vv += pushed
    t.parts = 0


@compiled
def correct(track: Row, x: float, y: float, sigma: float) -> None:
    """Correct a track by a position with its σ, m."""
    t, noise = track, sigma * sigma
    total = t.p_pp + noise
    gain, gain_v = t.p_pp / total, t.p_pv / total
    d_x, d_y = x - t.x, y - t.y
    t.x += gain * d_x
    t.y += gain * d_y
    t.v_x += gain_v * d_x
    t.v_y += gain_v * d_y
    t.p_vv = max(t.p_vv - gain_v * t.p_pv, 1e-6)
    t.p_pp, t.p_pv = gain * noise, gain_v * noise


@compiled_once
def mark_beside(view: View, tracks: Table, count: int) -> None:
    """Write for each echo the confirmed track that it is nearest to, if it is near."""
    for k in range(view.echoes):
        one = view.scan[view.scan[k].echo]
        best = NEAR_TRACK
        for a in range(count):
            t = tracks[a]
            apart = math.hypot(one.x - t.x, one.y - t.y)
            if t.confirmed > 0 and apart < best:
                best, one.track = apart, a


@compiled_once
def find_centre(
    view: View, segment: Row, group: int, width: float, radius: float
) -> None:
    """Write the centre of a segment's body and its σ.

    A narrow one is a shin. Otherwise the body is a circle, as wide as its track has
    been seen (``width``) and at most of ``radius``, m. It is fitted to the echoes from
    a guess behind their mean; where one side is hidden, the guess is from the other.
    """
    s = segment
    if width < THIN:
        s.centre_x = s.mean_x + BEHIND_SHIN * s.away_x
        s.centre_y = s.mean_y + BEHIND_SHIN * s.away_y
        s.sigma = SHIN_SIGMA
        return
    r, aside = min(radius, 0.5 * (width + s.space)), 0.0
    if s.left - s.right < 2.0 * r - PART_HIDDEN:
        if s.hidden == 1:
            aside = s.left - r
        elif s.hidden == 2:
            aside = s.right + r
    x = s.mean_x + ARC * r * s.away_x - aside * s.away_y
    y = s.mean_y + ARC * r * s.away_y + aside * s.away_x
    s.centre_x, s.centre_y = x, y
    s.sigma = BODY_SIGMA if s.cut == 0 else SHIN_SIGMA
    if s.echoes >= FIT_COUNT and s.extent > THIN:
        f_x, f_y = fit_circle(view, group, r, (x, y), FIT_WEIGHT * s.echoes)
        if math.hypot(f_x - x, f_y - y) < FIT_SHIFT:
            s.centre_x, s.centre_y = f_x, f_y


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
            one = view.scan[view.scan[k].echo]
            if one.segment == group:
                e_x, e_y = x - one.x, y - one.y
                size = max(math.hypot(e_x, e_y), 1e-6)
                j_x, j_y = e_x / size, e_y / size
                xx, xy, yy = xx + j_x * j_x, xy + j_x * j_y, yy + j_y * j_y
                b_x += j_x * (size - radius)
                b_y += j_y * (size - radius)
        det = xx * yy - xy * xy
        x, y = x - (yy * b_x - xy * b_y) / det, y - (xx * b_y - xy * b_x) / det
    return x, y


@compiled
def apart_of(track: Row, segment: Row) -> float:
    """Return the distance of a segment's body from a track, m."""
    s, t = segment, track
    return math.hypot(s.centre_x - t.x, s.centre_y - t.y)


@compiled_once
def associate(
    tracks: Table, count: int, segments: Table, found: int, dt: float
) -> None:
    """Give segments to tracks: the nearest pair within its gate first."""
    for _ in range(min(count, found)):
        best, pick, to = math.inf, -1, -1
        for a in range(count):
            t = tracks[a]
            new = t.confirmed == 0
            gate = GATE + min(2.0 * math.sqrt(t.p_pp), GATE_SIGMA)
            gate += GATE_SPEED * dt if new else 0.0
            for b in range(found if t.parts == 0 else 0):
                s = segments[b]
                cost = apart_of(t, s) + (NEW_COST if new else 0.0)
                cost += SHUT_COST if s.open_share < LEAST_SHARE else 0.0
                if s.track < 0 and cost < min(gate, best):
                    best, pick, to = cost, b, a
        if pick < 0:
            break
        segments[pick].track, tracks[to].parts = to, 1
        tracks[to].narrow = 1 if segments[pick].extent < LEG_WIDTH else 0
    add_legs(tracks, count, segments, found)


@compiled_once
def add_legs(tracks: Table, count: int, segments: Table, found: int) -> None:
    """Give a narrow segment that is left to the track of the other shin beside it."""
    for b in range(found):
        s = segments[b]
        if s.track >= 0 or s.extent >= LEG_WIDTH:
            continue
        best, to = LEG_APART, -1
        for a in range(count):
            if apart_of(tracks[a], s) < best:
                best, to = apart_of(tracks[a], s), a
        if to >= 0 and tracks[to].parts > 0 and tracks[to].narrow > 0:
            s.track = to
            tracks[to].parts += 1


@compiled_once
def measure(
    view: View, segments: Table, found: int, track: Row, row: int, radius: float
) -> tuple[float, float]:
    """Correct a track by its segments; return their echoes and greatest open share."""
    t, x, y, sigma, total, share = track, 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(found):
        if segments[b].track == row:
            t.size = max(t.size, segments[b].extent)
    for b in range(found):
        s = segments[b]
        if s.track == row:
            find_centre(view, s, b, t.size if t.parts == 1 else 0.0, radius)
            # Brought to the time of the scan.
            x += s.centre_x - t.v_x * s.later
            y += s.centre_y - t.v_y * s.later
            sigma, total = max(sigma, s.sigma), total + s.echoes
            share = max(share, s.open_share)
    sigma = PAIR_SIGMA if t.parts > 1 else sigma
    correct(t, x / t.parts, y / t.parts, sigma)
    return total, share


@compiled_once
def confirm(track: Row, echoes: float, share: float, cells: Table, now: Moment) -> None:
    """Note that a track was seen; confirm it, or end it as a body at rest."""
    t = track
    t.sights += 1
    t.last_seen, t.passed = now.time, 0
    t.echoes += 0.3 * (echoes - t.echoes)
    speed = math.hypot(t.v_x, t.v_y)
    t.fast = t.fast + 1 if speed > max(2.0 * math.sqrt(t.p_vv), SLOW_BODY) else 0
    moved = math.hypot(t.x - t.born_x, t.y - t.born_y)
    known = t.sights >= LEAST_SIGHTS and t.echoes >= LEAST_ECHOES
    moves = moved > TRAVEL and speed > max(SLOW_BODY, SURE * math.sqrt(t.p_vv))
    opened = share > LEAST_SHARE
    if not opened and moved > LEFT_TRAVEL and t.fast >= LEFT_QUICK:
        cell = cells[row_of(cell_of(t.born_x), cell_of(t.born_y))]
        opened = cell.free_count >= 2 and cell.score < LEFT_SCORE
    if known and opened and moves:
        t.confirmed = 1
    t.still_time = t.still_time + now.dt if speed < SLOW_BODY else 0.0
    if t.confirmed > 0 and t.still_time > MOST_STILL:
        t.confirmed, t.sights, t.fast, t.still_time = 0, 1, 0, 0.0
        t.born_x, t.born_y = t.x, t.y


@compiled_once
def claim(
    view: View, segments: Table, tracks: Table, count: int, radius: float
) -> None:
    """Mark the echoes of the segments of confirmed tracks; write the tracks' COVER."""
    for a in range(count):
        if tracks[a].parts > 0:
            tracks[a].cover = radius
    for k in range(view.echoes):
        one = view.scan[view.scan[k].echo]
        row = segments[one.segment].track if one.segment >= 0 else -1
        if row >= 0 and tracks[row].confirmed > 0:
            t = tracks[row]
            one.claimed = 1
            apart = math.hypot(one.x - t.x, one.y - t.y)
            t.cover = max(t.cover, apart)


@compiled_once
def claim_around(
    view: View, tracks: Table, count: int, cells: Table, centre: Cell, time: float
) -> None:
    """Mark other echoes around confirmed tracks, but those of known obstacles."""
    for k in range(view.echoes):
        one = view.scan[view.scan[k].echo]
        for a in range(count if one.claimed == 0 else 0):
            t = tracks[a]
            apart = math.hypot(one.x - t.x, one.y - t.y)
            own = t.confirmed > 0 and t.last_seen == time and apart < t.cover + CLAIM
            if own and is_ever_free(cells, one.x, one.y, centre, 0):
                one.claimed = 1
                t.cover = max(t.cover, apart)
                break


@compiled_once
def begin_tracks(
    tracks: Table, count: int, segments: Table, found: int, time: float
) -> int:
    """Begin tracks of segments that no track has; return the number of tracks.

    Two shins side by side begin one. A new track is at rest with σ = 1 m/s.
    """
    for b in range(found):
        s = segments[b]
        if s.track >= 0 or count >= MOST_TRACKS:
            continue
        x, y, other = s.centre_x, s.centre_y, -1
        best = PAIR_APART if s.extent < THIN else 0.0
        for c in range(b + 1, found):
            o = segments[c]
            apart = math.hypot(o.centre_x - x, o.centre_y - y)
            if o.track < 0 and o.extent < THIN and apart < best:
                best, other = apart, c
        s.track = count
        if other >= 0:
            o = segments[other]
            o.track = count
            x, y = 0.5 * (x + o.centre_x), 0.5 * (y + o.centre_y)
        p_pp, z = s.sigma**2, 0.0
        # fmt: off
        tracks[count] = Followed(x, y, z, z, p_pp, z, 1.0, time, x, y, s.extent, z, 1.0,
                                 z, 1, 0, 0, 0, 0, 0, 0)
        # fmt: on
        count += 1
    return count


@compiled_once
def drop_doubles(tracks: Table, count: int) -> int:
    """Drop the newer or unconfirmed of two tracks of one body; return how many stay."""
    a = 0
    while a < count:
        b = a + 1
        while b < count:
            t, o = tracks[a], tracks[b]
            if math.hypot(t.x - o.x, t.y - o.y) >= DOUBLE:
                b += 1
                continue
            if o.confirmed > t.confirmed:
                tracks[a] = tracks[b]
            count -= 1
            tracks[b] = tracks[count]
        a += 1
    return count


@compiled_once
def drop_lost(view: View, tracks: Table, count: int, time: float) -> int:
    """Drop tracks that are seen through, or unseen for too long; return the rest."""
    kept = 0
    for a in range(count):
        t = tracks[a]
        keep = True
        if t.last_seen < time:
            passed = sees_through(view.scan, view.sensor, t.x, t.y, PASSES)
            t.passed += 1 if passed else 0
            beam = beam_towards(view.scan, view.sensor, t.x, t.y)
            coast = COAST if beam >= 0 else UNSEEN_COAST
            coast = coast if t.confirmed > 0 else NEW_COAST
            keep = t.passed < MOST_PASSED and time - t.last_seen <= coast + 1e-6
        if keep:
            tracks[kept] = tracks[a]
            kept += 1
    return kept
