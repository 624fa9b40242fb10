/* Hostile calls of an exported filter: COUNT SEED THREADS and the robot's limits, v_min
 * v_max omega_min omega_max acceleration angular_acceleration wheel_speed track. A filter
 * for each thread. Prints calls, invalid ones, answers not finite, answers beyond limits,
 * and the worst time on the processor, ns, with what was called. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "qpavoid_filter.h"

enum { V_MIN, V_MAX, W_MIN, W_MAX, A, B, WHEEL, TRACK, LIMITS, MOST_THREADS = 16 };

typedef struct {
    uint64_t random;
    long count, invalid, not_finite, beyond;
    double worst;
    int worst_counts[4];
    qpavoid_filter filter;
    qpavoid_obstacles seen;
} run;

static double limits[LIMITS];
static run runs[MOST_THREADS];

static const double odd[] = {
    0.0, -0.0, 5e-324, -1e-310, 1e-160, 1e-9, 1e3, -1e5, 1e9, -1e16, 1e50, 9.9e99,
    -9.9e99, 1e101, 1e155, -1e200, 1e308, -1e308, NAN, INFINITY, -INFINITY,
};

static uint64_t next(run *r)
{
    r->random ^= r->random << 13;
    r->random ^= r->random >> 7;
    r->random ^= r->random << 17;
    return r->random;
}

static int below(run *r, int n) { return (int)(next(r) % (uint64_t)n); }

static double uniform(run *r, double low, double high)
{
    return low + (high - low) * (double)(next(r) >> 11) / 9007199254740992.0;
}

static double odd_one(run *r) { return odd[below(r, (int)(sizeof odd / sizeof *odd))]; }

static int some(run *r, int most)
{
    static const int wrong[] = {-1, -2147483647 - 1, 2147483647};
    return below(r, 500) ? below(r, most + 1) : below(r, 2) ? most + 1 : wrong[below(r, 3)];
}

static void fill(run *r, double *numbers, size_t n, double size)
{
    for (size_t i = 0; i < n; i++)
        numbers[i] = uniform(r, -size, size);
    if (n && !below(r, 12))
        numbers[(size_t)below(r, (int)n)] = odd_one(r);
}

static void surround(run *r)
{
    qpavoid_obstacles *o = &r->seen;
    static const double sizes[] = {1.0, 3.0, 10.0};
    const double size = sizes[below(r, 3)];
    int first = 0;
    o->age = below(r, 4) ? 0.0 : below(r, 4) ? uniform(r, 0.0, 0.3) : odd_one(r);
    o->n_points = some(r, below(r, 2) ? 6 : QPAVOID_POINTS);
    o->n_discs = below(r, 2) ? 0 : some(r, QPAVOID_DISCS);
    o->n_walls = below(r, 2) ? 0 : some(r, QPAVOID_WALLS);
    o->n_polygons = below(r, 10) ? 0 : some(r, QPAVOID_POLYGONS);
    fill(r, &o->points[0][0], sizeof o->points / sizeof(double), size);
    fill(r, &o->discs[0][0], sizeof o->discs / sizeof(double), size);
    for (int i = 0; i < QPAVOID_DISCS; i++)
        if (below(r, 30))
            o->discs[i][2] = 0.3 * fabs(o->discs[i][2]);
    fill(r, &o->disc_velocities[0][0], sizeof o->disc_velocities / sizeof(double), 1.0);
    fill(r, &o->walls[0][0], sizeof o->walls / sizeof(double), size);
    fill(r, &o->polygons[0][0], sizeof o->polygons / sizeof(double), 1.0);
    for (int i = 0; i < QPAVOID_POLYGONS; i++) {
        const int n = 3 + below(r, 3);
        const double x = uniform(r, -size, size), y = uniform(r, -size, size);
        if (first + n > QPAVOID_CORNERS)
            break;
        for (int k = 0; k < n; k++) {
            o->corners[first + k][0] = x + 0.4 * cos(6.283185307179586 * k / n);
            o->corners[first + k][1] = y + 0.4 * sin(6.283185307179586 * k / n);
        }
        if (below(r, 20))
            o->polygons[i][0] = n;
        first += n;
    }
    if (!below(r, 30))
        o->corners[below(r, QPAVOID_CORNERS)][below(r, 2)] = odd_one(r);
}

static int is_beyond(const qpavoid_decision *d, const double *last, int knows)
{
    const double e = 1e-9, v = d->v, w = d->omega;
    int bad = v < limits[V_MIN] - e || v > limits[V_MAX] + e || w < limits[W_MIN] - e;
    bad = bad || w > limits[W_MAX] + e;
    bad = bad || fabs(v) + 0.5 * limits[TRACK] * fabs(w) > limits[WHEEL] + e;
    bad = bad || (knows && fabs(v - last[0]) > limits[A] * QPAVOID_DT + e);
    return bad || (knows && fabs(w - last[1]) > limits[B] * QPAVOID_DT + e);
}

static double cpu_time(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static double wish(run *r, double most)
{
    return below(r, 10) ? uniform(r, -most, most) : odd_one(r);
}

static void *call_all(void *which)
{
    run *r = which;
    double last[2] = {0.0, 0.0};
    qpavoid_init(&r->filter);
    for (long i = 0; i < r->count; i++) {
        qpavoid_decision d;
        double begin, took;
        int knows = 1;
        surround(r);
        if (!below(r, 6)) {
            const double v = wish(r, 2.0), omega = wish(r, 4.0);
            if (below(r, 2))
                qpavoid_driven(&r->filter, v, omega);
            else
                qpavoid_reset(&r->filter, v, omega);
            knows = 0;
        }
        memset(&d, 0xFF, sizeof d);
        begin = cpu_time();
        qpavoid_step(&r->filter, wish(r, 2.0), wish(r, 3.0), &r->seen, &d);
        took = cpu_time() - begin;
        r->invalid += d.status == QPAVOID_INVALID;
        r->not_finite += !(isfinite(d.v) && isfinite(d.omega) && isfinite(d.slack));
        r->beyond += is_beyond(&d, last, knows);
        last[0] = d.v;
        last[1] = d.omega;
        if (took > r->worst) {
            const int counts[] = {r->seen.n_points, r->seen.n_discs, r->seen.n_walls,
                                  r->seen.n_polygons};
            r->worst = took;
            memcpy(r->worst_counts, counts, sizeof counts);
        }
    }
    return NULL;
}

int main(int count, char **given)
{
    pthread_t threads[MOST_THREADS];
    if (count != 4 + LIMITS)
        return 2;
    const int n = atoi(given[3]);
    for (int k = 0; k < LIMITS; k++)
        limits[k] = strtod(given[4 + k], NULL);
    for (int k = 0; k < n; k++) {
        runs[k].random = 0x9E3779B97F4A7C15u * (uint64_t)(1 + k + 16 * atoi(given[2]));
        runs[k].count = atol(given[1]) / n;
        if (pthread_create(&threads[k], NULL, call_all, &runs[k]))
            return 3;
    }
    for (int k = 0; k < n; k++) {
        pthread_join(threads[k], NULL);
        printf("%ld %ld %ld %ld %.0f %d %d %d %d\n", runs[k].count, runs[k].invalid,
               runs[k].not_finite, runs[k].beyond, runs[k].worst,
               runs[k].worst_counts[0], runs[k].worst_counts[1], runs[k].worst_counts[2],
               runs[k].worst_counts[3]);
    }
    return 0;
}
