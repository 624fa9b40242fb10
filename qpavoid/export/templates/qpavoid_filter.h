/* A safety filter for one robot, written by qpavoid $version. Do not edit: export again.
 *
 * Robot: $robot. It looks $filter.
 *
 * Build:  cc -std=c99 -O2 main.c qpavoid_filter.c -lm
 * With -ffp-contract=off the answers are those of the Python package to the last bit,
 * apart from the sines of another libm.
 *
 * SI units and radians. Everything is in the robot frame: the origin is the middle of
 * the axle, x points forwards, y to the left, angles turn counter-clockwise.
 * Nothing is allocated and nothing is shared: one qpavoid_filter per robot, owned by
 * the caller, is all the memory there is.
 */
#ifndef QPAVOID_FILTER_H
#define QPAVOID_FILTER_H

#ifdef __cplusplus
extern "C" {
#endif

/* The control step in s: qpavoid_step must be called so often. */
#define QPAVOID_DT $dt

/* How many obstacles there can be at once. */
#define QPAVOID_POINTS $points
#define QPAVOID_DISCS $discs
#define QPAVOID_WALLS $walls
#define QPAVOID_POLYGONS $polygons
#define QPAVOID_CORNERS $corners /* of all polygons together */

/* Convex parts of the footprint, and corners of all parts, at most. */
#define QPAVOID_PARTS $parts
#define QPAVOID_EDGES $edges

/* Why the twist is what it is; qpavoid_sentence says it in words. */
typedef enum {
$statuses
} qpavoid_status;

/* What is around the robot: the first n of each array. Set every n, or zero it all. */
typedef struct {
    double age;                                /* s since it was measured, 0 to $oldest */
    int n_points, n_discs, n_walls, n_polygons;
    double points[QPAVOID_POINTS + 1][2];      /* x, y, m: sensed points at rest */
    double discs[QPAVOID_DISCS][3];            /* x, y, radius, m */
    double disc_velocities[QPAVOID_DISCS][2];  /* over ground, in robot axes, m/s */
    double walls[QPAVOID_WALLS + 1][4];        /* x1, y1, x2, y2, m: at rest */
    /* Convex polygons, their corners counter-clockwise, one polygon after the other:
     * x, y, m. Of each how many corners it has, the velocity of the centroid of its
     * area over ground, in robot axes, m/s, and its rate of turn, rad/s. */
    double corners[QPAVOID_CORNERS + 1][2];
    double polygons[QPAVOID_POLYGONS + 1][4];
} qpavoid_obstacles;

typedef struct {
    double v;              /* forward speed to drive, m/s */
    double omega;          /* yaw rate to drive, rad/s, counter-clockwise */
    qpavoid_status status; /* why */
    double clearance;      /* distance to the nearest obstacle, m; negative inside */
    double slack;          /* violation that had to be allowed, m/s */
    double residual;       /* greatest residual of the answer's own check */
    double shortfall;      /* by how much the distance wanted will be missed, m */
    int active[2];         /* obstacles that hold the twist, -1: none; counted over
                              points, then discs, walls, polygons */
} qpavoid_decision;

/* A union of convex polygons, which may overlap or be apart; their corners
 * counter-clockwise, one polygon after the other: x, y, m. */
typedef struct {
    int n_parts;
    int n_corners[QPAVOID_PARTS];
    double corners[QPAVOID_EDGES][2];
} qpavoid_footprint;

/* Memory of a run, and scratch. Its fields are of no concern to the caller. */
typedef struct {
    int n_edges;
    double edges[QPAVOID_EDGES][6];
    double robot[$n_limits];
    double state[$state];
    double memory[$memory];
    double capsules[$capsules][$capsule_width];
} qpavoid_filter;

/* Call once, before anything else: the robot stands, with the footprint above. */
void qpavoid_init(qpavoid_filter *filter);

/* Forget what was driven and on which side; the robot now drives (v, omega). */
void qpavoid_reset(qpavoid_filter *filter, double v, double omega);

/* Say what the robot really drives, where it is not what was last decided;
 * accelerations count from it. Beyond the limits it counts as the nearest twist within;
 * numbers that are not finite are ignored. */
void qpavoid_driven(qpavoid_filter *filter, double v, double omega);

/* Change the footprint between two steps; twist and plan are kept. The next step takes the
 * new one, for the retained plan too. Obstacles that a larger one has inside r_min, or
 * overlaps with, are reported in the clearance and only left. A robot that grows at rest
 * never comes nearer to a static obstacle than it is, or than r_min; stop first.
 * Returns 0; else nothing is changed: -1: no part, one of fewer than three corners, or no
 * room for so many; i: part i is not finite, strictly convex and counter-clockwise. */
int qpavoid_set_footprint(qpavoid_filter *filter, const qpavoid_footprint *footprint);

/* Decide what to drive for the next QPAVOID_DT seconds.
 *
 * v, omega: the twist that is wanted, m/s and rad/s.
 * Writes the decision and returns its status. QPAVOID_INVALID: a number is not finite,
 * a radius negative, the age out of range, a polygon not strictly convex and
 * counter-clockwise, or there are too many obstacles; the twist then brakes along the
 * arc last driven. */
qpavoid_status qpavoid_step(qpavoid_filter *filter, double v, double omega,
                            const qpavoid_obstacles *obstacles,
                            qpavoid_decision *decision);

/* The status in a sentence. */
const char *qpavoid_sentence(qpavoid_status status);

#ifdef __cplusplus
}
#endif

#endif
