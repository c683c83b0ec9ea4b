/* Loops over functions that were generated for one chain of JOINTS joints; see compiled.py.
 *
 * chain_position: q -> rotation (9, row by row), position (3)
 * chain_pose:     q -> rotation, position, Jacobian (6 x JOINTS, row by row)
 * ik_step:        q, target (12) -> q after a step, squared errors at q (position, angle)
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)
#define WORK(name) \
    const double *arg[AT_LEAST_ONE(name##_SZ_ARG)]; \
    double *res[AT_LEAST_ONE(name##_SZ_RES)]; \
    casadi_int iw[AT_LEAST_ONE(name##_SZ_IW)]; \
    double w[AT_LEAST_ONE(name##_SZ_W)]

#ifdef chain_pose_SZ_W
void position_rows(const double *q, ptrdiff_t rows, double *rotation, double *position)
{
    WORK(chain_position);
    for (ptrdiff_t i = 0; i < rows; ++i) {
        arg[0] = q + i * JOINTS;
        res[0] = rotation + i * 9;
        res[1] = position + i * 3;
        chain_position(arg, res, iw, w, 0);
    }
}

void pose_rows(const double *q, ptrdiff_t rows, double *rotation, double *position, double *jacobian)
{
    WORK(chain_pose);
    for (ptrdiff_t i = 0; i < rows; ++i) {
        arg[0] = q + i * JOINTS;
        res[0] = rotation + i * 9;
        res[1] = position + i * 3;
        res[2] = jacobian + i * 6 * JOINTS;
        chain_pose(arg, res, iw, w, 0);
    }
}
#endif

#ifdef ik_step_SZ_W
static double nearer(double value, double reference)
{
    return value + 6.283185307179586 * nearbyint((reference - value) / 6.283185307179586);
}

/* Whether numbers of a pose (4, 4) are finite, and its rotation R one: R R^T is 1 but for IMPROPER, its volume positive.
 */
static int proper(const double *pose)
{
    const double *x = pose, *y = pose + 4, *z = pose + 8;
    double off = 0, volume = x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) +
                             x[2] * (y[0] * z[1] - y[1] * z[0]);
    for (int row = 0; row < 3; ++row)
        for (int other = row; other < 3; ++other) {
            const double *a = pose + 4 * row, *b = pose + 4 * other;
            off = fmax(off, fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - (row == other)));
        }
    return volume > 0 && off <= IMPROPER && isfinite(x[3]) && isfinite(y[3]) && isfinite(z[3]);
}

/* For each of m target poses (m, 4, 4) tries s seeds in order until one converges.
 *
 * Seed k of target i is at seeds + i * per_target + k * per_seed. limits: JOINTS lower ones, then upper ones; turning:
 * JOINTS flags of joints without limits. tolerance: squared position, squared angle. Results: q (m, JOINTS), solved (m).
 * Returns the number of the first target that is no pose, at which it ends, or -1.
 */
ptrdiff_t solve_rows(const double *targets, ptrdiff_t m, const double *seeds, ptrdiff_t s, ptrdiff_t per_target,
                     ptrdiff_t per_seed, const double *limits, const unsigned char *turning, const double *tolerance,
                     double *results, unsigned char *solved)
{
    WORK(ik_step);
    double here[JOINTS], next[JOINTS], squares[2], target[12];
    for (ptrdiff_t i = 0; i < m; ++i) {
        const double *seed = seeds + i * per_target;
        double *result = results + i * JOINTS;
        double least = INFINITY;
        if (!proper(targets + i * 16))
            return i;
        for (int row = 0; row < 3; ++row) {
            memcpy(target + 3 * row, targets + i * 16 + 4 * row, 3 * sizeof(double));
            target[9 + row] = targets[i * 16 + 4 * row + 3];
        }
        solved[i] = 0;
        memcpy(result, seed, sizeof here);
        for (ptrdiff_t k = 0; k < s && !solved[i]; ++k, seed += per_seed) {
            double before = INFINITY;
            int slow = 0;
            for (int j = 0; j < JOINTS; ++j)
                here[j] = turning[j] ? seed[j] : fmin(fmax(seed[j], limits[j]), limits[JOINTS + j]);
            for (int step = 0; step <= STEPS; ++step) {
                arg[0] = here;
                arg[1] = target;
                res[0] = next;
                res[1] = squares;
                ik_step(arg, res, iw, w, 0);
                double error = squares[0] + ROTATION_WEIGHT * ROTATION_WEIGHT * squares[1];
                solved[i] = squares[0] <= tolerance[0] && squares[1] <= tolerance[1];
                if (solved[i] || error < least) {
                    least = error;
                    memcpy(result, here, sizeof here);
                }
                if (solved[i])
                    break;
                slow = error > STALLED * before ? slow + 1 : 0;
                if (slow >= MOST_SLOW)
                    break;
                before = error;
                memcpy(here, next, sizeof here);
            }
        }
        for (int j = 0; j < JOINTS; ++j)
            if (turning[j])
                result[j] = nearer(result[j], seeds[i * per_target + j]);
    }
    return -1;
}
#endif
