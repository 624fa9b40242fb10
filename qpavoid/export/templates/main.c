/* An example: the robot drives to a goal among discs that stand and one that moves.
 *
 * Build:  cc -std=c99 -O2 main.c qpavoid_filter.c -lm */
#include <math.h>
#include <stdio.h>

#include "qpavoid_filter.h"

enum { DISCS = 3 < QPAVOID_DISCS ? 3 : QPAVOID_DISCS };

static double least(double a, double b)
{
    return a < b ? a : b;
}

int main(void)
{
    static qpavoid_filter filter;
    static qpavoid_obstacles seen;
    double discs[3][5] = {/* x, y, radius (m) and velocity (m/s) in the world */
                          {2.5, 0.3, 0.3, 0.0, 0.0},
                          {5.0, -0.5, 0.4, 0.0, 0.0},
                          {7.0, 3.0, 0.2, 0.0, -0.2}};
    const double goal = 9.0; /* m, straight ahead of the start */
    double x = 0.0, y = 0.0, heading = 0.0, clearance = INFINITY;
    qpavoid_init(&filter);
    for (int step = 0; step * QPAVOID_DT < 60.0 && hypot(goal - x, y) > 0.2; step++) {
        const double c = cos(heading), s = sin(heading);
        seen.n_discs = DISCS;
        for (int i = 0; i < DISCS; i++) {
            const double *disc = discs[i];
            seen.discs[i][0] = c * (disc[0] - x) + s * (disc[1] - y);
            seen.discs[i][1] = c * (disc[1] - y) - s * (disc[0] - x);
            seen.discs[i][2] = disc[2];
            seen.disc_velocities[i][0] = c * disc[3] + s * disc[4];
            seen.disc_velocities[i][1] = c * disc[4] - s * disc[3];
            discs[i][0] += QPAVOID_DT * disc[3];
            discs[i][1] += QPAVOID_DT * disc[4];
        }
        const double ahead = c * (goal - x) - s * y, left = -c * y - s * (goal - x);
        const double wanted = least(0.8, 0.5 * hypot(ahead, left));
        qpavoid_decision decision;
        qpavoid_step(&filter, wanted, 1.5 * atan2(left, ahead), &seen, &decision);
        clearance = least(clearance, decision.clearance);
        if (step % 100 == 0)
            printf("%5.1f s  x %5.2f  y %5.2f m  clearance %5.2f m  %s\n",
                   step * QPAVOID_DT, x, y, decision.clearance,
                   qpavoid_sentence(decision.status));
        const double turned = QPAVOID_DT * decision.omega;
        x += QPAVOID_DT * decision.v * cos(heading + 0.5 * turned);
        y += QPAVOID_DT * decision.v * sin(heading + 0.5 * turned);
        heading += turned;
    }
    printf("%.2f m from the goal, least clearance %.2f m\n", hypot(goal - x, y), clearance);
    return clearance > 0.0 ? 0 : 1;
}
