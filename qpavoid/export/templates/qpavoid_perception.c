/* Perception for one robot, written by qpavoid $version; see qpavoid_perception.h.
 *
 * Every function below is translated from the function of the same name in the Python
 * package, whose docstring says what it computes and why. */
#include "qpavoid_perception.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Of each beam: direction in the sensor frame; share of the motion during a scan; time
 * after that of the scan, s. */
static const double beams[QPAVOID_BEAMS][$beam_width] = {
$table
};

$perception_functions

/* Numbers that are only read, for a matrix, which could be written to as well. */
static matrix read_only(const double *at, int rows, int columns)
{
    union { const double *given; double *taken; } pointer;
    pointer.given = at;
    const matrix m = {pointer.taken, rows, columns};
    return m;
}

static bool is_pose(double time, const double pose[3])
{
    return isfinite(time) && fabs(pose[0]) < $nearest && fabs(pose[1]) < $nearest
           && isfinite(pose[2]);
}

void qpavoid_perception_init(qpavoid_perception *p)
{
    memset(p, 0, sizeof *p);
    p->stamp = p->time = -INFINITY;
}

int qpavoid_perceive(qpavoid_perception *p, const qpavoid_filter *filter,
                     const double ranges[QPAVOID_BEAMS], double stamp,
                     const double pose[3], const double twist[2])
{
    const double middle = stamp - QPAVOID_DELAY + 0.5 * QPAVOID_SWEEP;
    if (!is_pose(stamp, pose) || !isfinite(twist[0]) || !isfinite(twist[1]))
        return -1;
    if (stamp == p->stamp)
        return 0;
    if (middle < p->time)
        return -1;
    const double way = hypot(pose[0] - p->last[0], pose[1] - p->last[1]);
    if (way > $jump + $fastest * (stamp - p->stamp)) {
        const double counts[2] = {p->counts[0], p->counts[1]};
        qpavoid_perception_init(p);
        memcpy(p->counts, counts, sizeof counts);
    }
    const $started_type a = $started;
    const double begin[3] = {a._0, a._1, a._2};
    memcpy(p->begin, begin, sizeof begin);
    const $started_type b = $ended;
    const double motion[3] = {b._0 - a._0, b._1 - a._1, twist[1] * QPAVOID_SWEEP};
    memcpy(p->motion, motion, sizeof motion);
    for (int k = 0; k < QPAVOID_BEAMS; k++) {
        const double r = ranges[k];
        const bool echo = r > 0.0 && r >= QPAVOID_RANGE_MIN && r < QPAVOID_RANGE_MAX;
        p->rows[k * $ray] = echo || r == INFINITY ? r : NAN;
    }
    p->time = middle;
    const double depth = -$nearest_edge.distance, inner = depth > 0.0 ? depth : 0.0;
    $taken;
    p->stamp = stamp;
    memcpy(p->last, pose, sizeof p->last);
    return 0;
}

/* The greatest distance from the robot, m, within which at most so many rows lie. */
static double reach_of(const double *rows, int n, int width, int most)
{
    double reach = n > most ? 0.0 : INFINITY;
    for (double step = 4096.0; n > most && step > 1e-9; step *= 0.5) {
        int inside = 0;
        for (int i = 0; i < n; i++)
            inside += hypot(rows[i * width], rows[i * width + 1]) < reach + step;
        reach += inside <= most ? step : 0.0;
    }
    return reach;
}

int qpavoid_perceived(qpavoid_perception *p, const qpavoid_filter *filter, double time,
                      const double pose[3], qpavoid_obstacles *obstacles)
{
    if (!is_pose(time, pose))
        return -1;
    obstacles->n_points = obstacles->n_discs = 0;
    if (p->stamp == -INFINITY)
        return 0;
    const $counted_type found = $counted;
    double reach = reach_of(p->points[0], found._0, 2, QPAVOID_POINTS);
    for (int i = 0; i < found._0; i++)
        if (hypot(p->points[i][0], p->points[i][1]) < reach)
            memcpy(obstacles->points[obstacles->n_points++], p->points[i],
                   sizeof obstacles->points[0]);
    reach = reach_of(p->capsules[0], found._1, $capsule_width, QPAVOID_DISCS);
    for (int i = 0; i < found._1; i++) {
        const double *disc = p->capsules[i]; /* twice its centre, radius, velocity */
        const int n = obstacles->n_discs;
        if (hypot(disc[0], disc[1]) < reach) {
            memcpy(obstacles->discs[n], disc + 2, sizeof obstacles->discs[0]);
            memcpy(obstacles->disc_velocities[n], disc + 5, 2 * sizeof *disc);
            obstacles->n_discs++;
        }
    }
    return found._0 + found._1 - obstacles->n_points - obstacles->n_discs;
}
