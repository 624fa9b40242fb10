/* Answers recorded problems: reads them from standard input, writes decisions with the
 * time that each took. The argument says how often each is answered: times are means. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "qpavoid_filter.h"

typedef struct {
    double v, omega;        /* wanted */
    double last_v, last_omega; /* driven, where anew is set */
    int anew;               /* 1: the run begins anew; 2: it goes on */
    qpavoid_obstacles obstacles;
} problem;

typedef struct {
    qpavoid_decision decision;
    double nanoseconds;
} answer;

int main(int count, char **arguments)
{
    static qpavoid_filter filter;
    static problem p;
    const int repeat = count > 1 ? atoi(arguments[1]) : 1;
    qpavoid_init(&filter);
    while (fread(&p, sizeof p, 1, stdin) == 1) {
        double state[sizeof filter.state / sizeof filter.state[0]];
        struct timespec begin, end;
        answer a;
        memset(&a, 0, sizeof a);
        if (p.anew == 1)
            qpavoid_reset(&filter, p.last_v, p.last_omega);
        if (p.anew == 2)
            qpavoid_driven(&filter, p.last_v, p.last_omega);
        memcpy(state, filter.state, sizeof state);
        clock_gettime(CLOCK_MONOTONIC, &begin);
        for (int i = 0; i < repeat; i++) {
            memcpy(filter.state, state, sizeof state);
            qpavoid_step(&filter, p.v, p.omega, &p.obstacles, &a.decision);
        }
        clock_gettime(CLOCK_MONOTONIC, &end);
        a.nanoseconds = (1e9 * (double)(end.tv_sec - begin.tv_sec)
                         + (double)(end.tv_nsec - begin.tv_nsec)) / repeat;
        if (fwrite(&a, sizeof a, 1, stdout) != 1)
            return 1;
    }
    return 0;
}
