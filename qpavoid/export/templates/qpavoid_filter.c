/* A safety filter for one robot, written by qpavoid $version; see qpavoid_filter.h.
 *
 * Every function below is translated from the function of the same name in the Python
 * package, whose docstring says what it computes and why. */
#include "qpavoid_filter.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Edges of the exported footprint: start (m), outward unit normal, length (m), and the
 * row after the last edge of its convex part. */
static const double own_edges[$n_edges][6] = {
$own_edges
};

/* v_min, v_max, omega_min, omega_max, acceleration, angular_acceleration, wheel_speed,
 * track, and the footprint's circumradius; m/s, rad/s and m. */
static const double own_limits[$n_limits] = $limits;

static const struct {
$fields
} settings = {
$values
};

$functions

/* Slow down along the arc last driven: the answer to what cannot be trusted. */
static qpavoid_status brake(qpavoid_filter *filter, qpavoid_status status,
                            qpavoid_decision *decision)
{
    const qpavoid_decision nothing = {0.0, 0.0, status, INFINITY, 0.0, 0.0, 0.0, {-1, -1}};
    const $twist twist = $braking;
    *decision = nothing;
    decision->v = filter->state[0] = twist._0;
    decision->omega = filter->state[1] = twist._1;
    return status;
}

void qpavoid_reset(qpavoid_filter *filter, double v, double omega)
{
    static const double fresh[$state] = $fresh;
    for (int i = 0; i < $state; i++)
        filter->state[i] = fresh[i];
    if (isfinite(v) && isfinite(omega)) {
        const $twist twist = $driven;
        $set_driven;
    }
}

void qpavoid_init(qpavoid_filter *filter)
{
    memcpy(filter->edges, own_edges, sizeof own_edges);
    memcpy(filter->robot, own_limits, sizeof own_limits);
    filter->n_edges = $n_edges;
    qpavoid_reset(filter, 0.0, 0.0);
}

void qpavoid_driven(qpavoid_filter *filter, double v, double omega)
{
    if (isfinite(v) && isfinite(omega)) {
        const $twist twist = $driven;
        filter->state[0] = twist._0;
        filter->state[1] = twist._1;
    }
}

/* Numbers that are only read, for a matrix, which could be written to as well. */
static matrix read_only(const double *at, int rows, int columns)
{
    union { const double *given; double *taken; } pointer;
    pointer.given = at;
    const matrix m = {pointer.taken, rows, columns};
    return m;
}

int qpavoid_set_footprint(qpavoid_filter *filter, const qpavoid_footprint *footprint)
{
    int corners = 0, begin = 0, end;
    if (footprint->n_parts < 1 || footprint->n_parts > QPAVOID_PARTS)
        return -1;
    for (int i = 0; i < footprint->n_parts; i++) {
        if (footprint->n_corners[i] < 3 || footprint->n_corners[i] > QPAVOID_EDGES - corners)
            return -1;
        corners += footprint->n_corners[i];
    }
    const matrix given = read_only(&footprint->corners[0][0], corners, 2);
    for (int i = 0; i < footprint->n_parts; i++, begin = end) {
        end = begin + footprint->n_corners[i];
        if (!$is_convex)
            return i + 1;
    }
    filter->n_edges = corners;
    filter->robot[$n_limits - 1] = 0.0;
    begin = 0;
    for (int i = 0; i < footprint->n_parts; i++, begin = end) {
        end = begin + footprint->n_corners[i];
        const double radius = $fill_edges;
        if (radius > filter->robot[$n_limits - 1])
            filter->robot[$n_limits - 1] = radius;
    }
    return 0;
}

/* How many corners the polygons have in all; -1 if that cannot be, or is too many. */
static int count_corners(const qpavoid_obstacles *obstacles)
{
    int corners = 0;
    if (obstacles->n_polygons < 0 || obstacles->n_polygons > QPAVOID_POLYGONS)
        return -1;
    for (int i = 0; i < obstacles->n_polygons; i++) {
        const double own = obstacles->polygons[i][0];
        if (!(own >= 3.0 && own <= QPAVOID_CORNERS - corners))
            return -1;
        corners += (int)own;
    }
    return corners;
}

qpavoid_status qpavoid_step(qpavoid_filter *filter, double v, double omega,
                            const qpavoid_obstacles *obstacles,
                            qpavoid_decision *decision)
{
    const double age = obstacles->age;
    const int n = obstacles->n_points, m = obstacles->n_discs, k = obstacles->n_walls;
    const int p = obstacles->n_polygons, c = count_corners(obstacles);
    if (!(isfinite(v) && isfinite(omega) && age >= 0.0 && age <= $oldest
          && n >= 0 && n <= QPAVOID_POINTS && m >= 0 && m <= QPAVOID_DISCS
          && k >= 0 && k <= QPAVOID_WALLS && c >= 0))
        return brake(filter, QPAVOID_INVALID, decision);
    const matrix points = read_only(&obstacles->points[0][0], n, 2);
    const matrix discs = read_only(&obstacles->discs[0][0], m, 3);
    const matrix disc_velocities = read_only(&obstacles->disc_velocities[0][0], m, 2);
    const matrix walls = read_only(&obstacles->walls[0][0], k, 4);
    static const double rest[QPAVOID_WALLS + 1][2] = {{0.0, 0.0}};
    const matrix at_rest = read_only(&rest[0][0], k, 2);
    const matrix corners = read_only(&obstacles->corners[0][0], c, 2);
    const matrix polygons = read_only(&obstacles->polygons[0][0], p, 4);
    const matrix capsules = {&filter->capsules[0][0], m + k + c, $capsule_width};
    if ($fill >= 0)
        return brake(filter, QPAVOID_INVALID, decision);
    const double last_v = filter->state[0], last_omega = filter->state[1];
    const $answer a = $step;
    if (a.code == QPAVOID_INVALID)
        return brake(filter, QPAVOID_INVALID, decision);
    if (!(isfinite(a.v) && isfinite(a.omega))) {
        qpavoid_reset(filter, last_v, last_omega);
        return brake(filter, QPAVOID_STOPPED, decision);
    }
    decision->status = (qpavoid_status)a.code;
    decision->v = a.v;
    decision->omega = a.omega;
    decision->clearance = a.clearance;
    decision->slack = a.slack;
    decision->residual = a.residual;
    decision->shortfall = a.shortfall;
    decision->active[0] = a.first;
    decision->active[1] = a.second == a.first ? -1 : a.second;
    return decision->status;
}

const char *qpavoid_sentence(qpavoid_status status)
{
    switch (status) {
$sentences
    default:
        return "The data are not valid; the robot brakes.";
    }
}
