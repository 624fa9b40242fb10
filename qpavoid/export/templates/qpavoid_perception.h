/* Static and moving obstacles from the scans of one LiDAR, written by qpavoid $version.
 * Do not edit: export again.
 *
 * Build:  cc -std=c99 -O2 perceive.c qpavoid_perception.c qpavoid_filter.c -lm
 *
 * SI units and radians. Poses are odometry: x, y, heading in a frame at rest. Nothing is
 * allocated; one qpavoid_perception per robot, some 3 MB, is all the memory there is.
 */
#ifndef QPAVOID_PERCEPTION_H
#define QPAVOID_PERCEPTION_H

#include "qpavoid_filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The scanner: beams from right to left; direction of the first beam, and place of the
 * scanner, in the robot frame. */
#define QPAVOID_BEAMS $beams
#define QPAVOID_BEAM_FIRST $beam_first
#define QPAVOID_BEAM_STEP $beam_step
#define QPAVOID_MOUNT_X $mount_x
#define QPAVOID_MOUNT_Y $mount_y
#define QPAVOID_RANGE_MIN $range_min
#define QPAVOID_RANGE_MAX $range_max
#define QPAVOID_SWEEP $sweep /* s from the first to the last beam */
#define QPAVOID_DELAY $delay /* s by which a stamp is later than the first beam */

/* Map and tracks, the last scan, and what was found. Its fields are of no concern to
 * the caller. */
typedef struct {
    double stamp, last[3], time, begin[3], motion[3];
$memory_fields
$found_fields
} qpavoid_perception;

/* Call once, before anything else, and to forget everything. */
void qpavoid_perception_init(qpavoid_perception *perception);

/* Take a scan.
 *
 * filter: its footprint may be changed at any time; what is known is kept.
 * ranges: m; INFINITY: no echo; NAN, 0 and what is beyond the limits: unknown.
 * stamp, pose, twist: time, s; pose and v, omega of the robot then.
 * Returns 0; or -1, and nothing is changed: a number is not finite, the pose is too far
 * from its origin, or time runs backwards. The stamp of the last scan again changes
 * nothing. After a pose that jumped the map begins anew. */
int qpavoid_perceive(qpavoid_perception *perception, const qpavoid_filter *filter,
                     const double ranges[QPAVOID_BEAMS], double stamp,
                     const double pose[3], const double twist[2]);

/* Write the points and discs known at a time (s) and pose into the obstacles; their
 * other fields are left as they are. Points in the filter's footprint are left out.
 *
 * Moving obstacles are predicted to the time. Returns how many points and discs are left
 * out because there is no room for them: those farthest away; or -1: a number is not
 * finite, and nothing is written. */
int qpavoid_perceived(qpavoid_perception *perception, const qpavoid_filter *filter,
                      double time, const double pose[3], qpavoid_obstacles *obstacles);

#ifdef __cplusplus
}
#endif

#endif
