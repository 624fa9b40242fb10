/* An example: a robot is parked in a square room, and a person walks towards it.
 *
 * Build:  cc -std=c99 -O2 perceive.c qpavoid_perception.c qpavoid_filter.c -lm */
#include <math.h>
#include <stdio.h>

#include "qpavoid_perception.h"

enum { SCANS = 60 };
static const double SCAN_TIME = 0.1, WALL = 5.0, SPEED = 0.8, RADIUS = 0.25; /* s, m, m/s */

/* The range of a beam: the nearer of the walls and the person. */
static double range(const double pose[3], int beam, double time)
{
    const double c = cos(pose[2]), s = sin(pose[2]);
    const double x = pose[0] + c * QPAVOID_MOUNT_X - s * QPAVOID_MOUNT_Y;
    const double y = pose[1] + s * QPAVOID_MOUNT_X + c * QPAVOID_MOUNT_Y;
    const double angle = pose[2] + QPAVOID_BEAM_FIRST + beam * QPAVOID_BEAM_STEP;
    const double dx = cos(angle), dy = sin(angle);
    double r = fmin((copysign(WALL, dx) - x) / dx, (copysign(WALL, dy) - y) / dy);
    const double to_x = 4.5 - SPEED * time - x, to_y = 0.3 - y;
    const double along = to_x * dx + to_y * dy;
    const double inside = RADIUS * RADIUS - to_x * to_x - to_y * to_y + along * along;
    if (inside > 0.0 && along > 0.0)
        r = fmin(r, along - sqrt(inside));
    return r;
}

int main(void)
{
    static qpavoid_perception perception;
    static qpavoid_filter filter;
    static qpavoid_obstacles seen;
    static double scan[QPAVOID_BEAMS];
    double pose[3] = {0.0, 0.0, 0.0}, twist[2] = {0.0, 0.0};
    qpavoid_init(&filter);
    qpavoid_perception_init(&perception);
    for (int k = 0; k < SCANS; k++) {
        const double time = k * SCAN_TIME;
        for (int beam = 0; beam < QPAVOID_BEAMS; beam++)
            scan[beam] = range(pose, beam, time);
        qpavoid_perceive(&perception, &filter, scan, time, pose, twist);
        for (double t = 0.0; t < SCAN_TIME - 0.5 * QPAVOID_DT; t += QPAVOID_DT) {
            qpavoid_decision d;
            qpavoid_perceived(&perception, &filter, time + t, pose, &seen);
            qpavoid_step(&filter, 0.0, 0.0, &seen, &d);
            twist[0] = d.v, twist[1] = d.omega;
            const double turned = QPAVOID_DT * d.omega;
            pose[0] += QPAVOID_DT * d.v * cos(pose[2] + 0.5 * turned);
            pose[1] += QPAVOID_DT * d.v * sin(pose[2] + 0.5 * turned);
            pose[2] += turned;
        }
        printf("%.1f s  %d points  %d discs  %.17g m/s  %.17g rad/s\n", time,
               seen.n_points, seen.n_discs, twist[0], twist[1]);
    }
    return 0;
}
