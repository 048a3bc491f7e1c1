/* The X axis of the demo for comparison: the arithmetic of rds.controllers.tracking, rds.machines and
   rds.models.linear_axis, line for line, in C.

       gcc -O2 -ffp-contract=off axis.c -o axis -lm
       axis SAMPLES REPEATS < input > output

   All numbers are native doubles. In: the constants in the order of `struct axis`, then the reference's positions,
   velocities and accelerations, SAMPLES of each. Out: REPEATS times in ns, then the table of the last repeat, a row
   for each sample: number, reference (3), measured position, command, the observer's velocity, voltage, and the plant's
   velocity. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { COLUMNS = 9 };

struct axis {
    double inverse_gain, inertia, g1, g2, L, F, G, H, limit;  /* controller and observer */
    double T, decay, reach, tau, K, plus, minus;              /* model */
    double step, low, high, resolution;                       /* converter and encoder */
};

static void respond(const struct axis *a, double u, double *x, double *v)
{
    double drive = a->K * u, final, end, stop, gained;
    if (*v > 0.0 || (*v == 0.0 && drive > a->plus)) {
        final = drive - a->plus;
        end = final + (*v - final) * a->decay;
        if (end >= 0.0) {
            *x = *x + final * a->T + (*v - final) * a->reach;
            *v = end;
            return;
        }
        stop = a->tau * log1p(-*v / final);
        *x += final * stop + *v * a->tau;
        if (drive >= a->minus) {
            *v = 0.0;
            return;
        }
        final = drive - a->minus;
    } else if (*v < 0.0 || drive < a->minus) {
        final = drive - a->minus;
        end = final + (*v - final) * a->decay;
        if (end <= 0.0) {
            *x = *x + final * a->T + (*v - final) * a->reach;
            *v = end;
            return;
        }
        stop = a->tau * log1p(-*v / final);
        *x += final * stop + *v * a->tau;
        if (drive <= a->plus) {
            *v = 0.0;
            return;
        }
        final = drive - a->plus;
    } else {
        *v = 0.0;
        return;
    }
    gained = -expm1(-(a->T - stop) / a->tau);
    *x += final * (a->T - stop - a->tau * gained);
    *v = final * gained;
}

static void simulate(const struct axis *a, int samples, const double *p, const double *v, const double *acc, double *row)
{
    double x = 0.0, w = 0.0, z = 0.0, y, u;
    for (int k = 0; k < samples; k++, row += COLUMNS) {
        y = rint(x / a->resolution) * a->resolution;
        if (k == 0)
            z = -a->L * y;
        row[6] = k ? a->L * y + z : 0.0;
        row[8] = w;
        u = a->inertia * (acc[k] + a->g1 * (p[k] - y) + a->g2 * (v[k] - (a->L * y + z))) + a->inverse_gain * v[k];
        if (u > a->limit)
            u = a->limit;
        else if (u < -a->limit)
            u = -a->limit;
        z = a->F * z + a->G * y + a->H * u;
        row[0] = k;
        row[1] = p[k];
        row[2] = v[k];
        row[3] = acc[k];
        row[4] = y;
        row[5] = u;
        u = u < a->low ? a->low : u > a->high ? a->high : u;
        u = rint(u / a->step) * a->step;
        row[7] = u;
        respond(a, u, &x, &w);
    }
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}

int main(int argc, char **argv)
{
    int samples = argc == 3 ? atoi(argv[1]) : 0, repeats = argc == 3 ? atoi(argv[2]) : 0;
    struct axis axis;
    double *reference = malloc(3 * sizeof(double) * samples), *rows = malloc(COLUMNS * sizeof(double) * samples);
    double *times = malloc(sizeof(double) * repeats);
    size_t size = samples;
    if (samples < 1 || repeats < 1 || !reference || !rows || !times || fread(&axis, sizeof axis, 1, stdin) != 1
        || fread(reference, sizeof(double), 3 * size, stdin) != 3 * size) {
        fprintf(stderr, "usage: axis SAMPLES REPEATS < input > output\n");
        return 2;
    }
    for (int i = 0; i < repeats; i++) {
        double started = now();
        simulate(&axis, samples, reference, reference + size, reference + 2 * size, rows);
        times[i] = now() - started;
    }
    fwrite(times, sizeof(double), repeats, stdout);
    fwrite(rows, sizeof(double), COLUMNS * size, stdout);
    return 0;
}
