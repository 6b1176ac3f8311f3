/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * refit.c: Gauss-Newton on a blurred step along a line (refit.h).
 *
 * Every row gives the step's offset with both levels free (step.h); a line through the offsets, by
 * Huber's M-estimate, is the correction. Contrast (linear along the line) and blur are common to all
 * rows. The covariance is that of the linearised model, grown by chi2 where that is above 1.
 */
#include "refit.h"

#include <math.h>
#include <stdlib.h>

#define TRIM 2.5           /* px at either end, where corners are round */
#define PROBE 4.0          /* px to either side for a first look at the levels */
#define SMOOTHED (4. / 3)  /* px²: a Gaussian of 1 px and central differences */
#define HUBER 2.f          /* sigma */
#define SIGNIFICANT 8.0    /* sigma that a step must stand out of the noise */
#define SLOPED 2.0         /* sigma under which slopes beside the line count for nothing */
#define BENT 0.5           /* sigma of a pixel that linearising may cost */
#define ROUNDING 0.2887    /* sigma of the noise of whole grey levels: 12^-1/2 */
#define ESCAPED 1.5        /* px from the edge points at which a line is not theirs */

enum { MIN_ROWS = 3, MAX_PASSES = 4, HUBER_STEPS = 2 };

struct refitter {
    rows rows;
    crowd crowd;
    step_table steps;
    four *offset, *weight, *t; /* of the rows: px across the line, in sigma^-1, px */
};

/* What is known of the line that is being fitted. */
typedef struct state {
    row_line line;
    double noise;        /* sigma of a pixel */
    double contrast[2];  /* signed along the row: in the middle, and per px along the line */
    double level;        /* before the step */
    double widen;        /* relative excess of the blur over the filters' */
    double lean;         /* share of the slopes beside the line that is taken out */
    double normal[3];    /* sums of the rows' weights, times t, t² */
    double offset, angle; /* px, rad: of the line through the rows' offsets */
    double misfit;       /* squares that this line leaves, sigma² */
    double spread;       /* variance of the offsets over what the noise explains */
} state;

refitter *refitter_new(int width, int height) {
    refitter *f = aligned_alloc(_Alignof(refitter), sizeof *f);
    if (!f)
        return NULL;
    size_t room = ((size_t)(width > height ? width : height) / 4 + 1) * sizeof(four);
    int error = rows_init(&f->rows, width, height) | crowd_init(&f->crowd, width, height);
    f->offset = aligned_alloc(sizeof(four), 3 * room);
    if (error || !f->offset) {
        refitter_free(f);
        return NULL;
    }
    f->weight = f->offset + room / sizeof(four);
    f->t = f->weight + room / sizeof(four);
    step_init(&f->steps);
    f->rows.steps = &f->steps;
    f->rows.crowd = &f->crowd;
    return f;
}

void refitter_free(refitter *f) {
    if (!f)
        return;
    rows_free(&f->rows);
    crowd_free(&f->crowd);
    free(f->offset);
    free(f);
}

void refitter_look(refitter *f, const arris_image *image, const arris_edges *edges,
                   const arris_camera *lens) {
    f->rows.image = image;
    f->rows.lens = lens;
    crowd_fill(&f->crowd, edges, image->width, image->height, lens);
}

void refitter_portable(refitter *f) {
    f->rows.portable = true;
}

/* ---- what is common to the rows ------------------------------------------------------------- */

/* The blur that gives this gradient in the smoothed picture. */
static double blur_guess(double contrast, double gradient) {
    double s = contrast / (sqrt(2 * M_PI) * gradient), square = s * s - SMOOTHED;
    return square > 0.25 ? fmin(sqrt(square), 4) : 0.5;
}

/* Slopes beside the line move the offset. What they add is taken out as far as they stand out of
 * the noise (James and Stein's shrinkage, from SLOPED sigma). */
static void find_slopes(state *s, const row_sums *sum) {
    double kink = (double)sum->answer[STEP_KINK], slope = (double)sum->answer[STEP_SLOPE];
    double z2 = fmax(kink * kink, slope * slope) / (sum->wide * s->noise * s->noise);
    s->lean = z2 > SLOPED * SLOPED ? 1 - SLOPED * SLOPED / z2 : 0;
}

/* Contrast as a linear function of the place along the line; level and blur. False when the step is
 * not one that is brighter on the right and stands out of the noise. */
static bool find_step(state *s, const rows *r) {
    const row_sums *sum = &r->sum;
    double w0 = (double)sum->weight[STEP_CONTRAST], w1 = (double)sum->weight_t[STEP_CONTRAST];
    double w2 = (double)sum->weight_tt[STEP_CONTRAST], det = w0 * w2 - w1 * w1;
    double q0 = (double)sum->answer[STEP_CONTRAST] - s->lean * (double)sum->tilt;
    double q1 = (double)sum->answer_t[STEP_CONTRAST], *c = s->contrast;
    c[1] = det > 0 ? (w0 * q1 - w1 * q0) / det : 0;
    c[0] = (q0 - w1 * c[1]) / w0;
    double widen = (double)sum->answer[STEP_BLUR] / ((double)sum->weight[STEP_BLUR] * c[0]);
    s->widen = fmax(-0.5, fmin(0.5, widen));
    s->level = (double)r->base + ((double)sum->answer[STEP_MEAN] - c[0] * (double)sum->step) /
                                     (double)sum->weight[STEP_MEAN];
    double sign = r->item[0].across > 0 ? 1 : -1;
    return sign * c[0] > 0 && sign * q0 > SIGNIFICANT * s->noise * sqrt(w0);
}

/* ---- the line through the rows' offsets ----------------------------------------------------- */

static void find_offsets(refitter *f, const state *s) {
    const rows *r = &f->rows;
    float lean = (float)s->lean, c0 = (float)s->contrast[0], c1 = (float)s->contrast[1];
    float least = 0.2f * fabsf(c0), widen = (float)s->widen, sigma = 1 / (float)s->noise;
    float *offset = (float *)f->offset, *weight = (float *)f->weight, *t = (float *)f->t;
    for (uint32_t i = 0; i < r->n; i++) {
        const row *q = &r->item[i];
        const step_filter *w = q->filter;
        float c = c0 + c1 * q->t, answer = q->answer[STEP_OFFSET];
        if (!(fabsf(c) > least && c * c0 > 0))
            c = copysignf(least, c0);
        float per_px = w->response[STEP_OFFSET] * c * (1 + w->gain * widen), more = sigma;
        if (lean > 0) {
            answer -= lean * (w->kink * q->answer[STEP_KINK] + w->slope * q->answer[STEP_SLOPE]);
            more /= sqrtf(1 + lean * (w->kink * w->kink + w->slope * w->slope));
        }
        t[i] = q->t;
        offset[i] = q->across * (-q->shift - answer / per_px);
        weight[i] = fabsf(per_px / q->across) * more;
    }
    for (uint32_t i = r->n; i % 4; i++)
        t[i] = offset[i] = weight[i] = 0;
}

static void find_normal(const refitter *f, state *s) {
    four w0 = {0}, w1 = {0}, w2 = {0};
    for (uint32_t i = 0; i * 4 < f->rows.n; i++) {
        four ww = f->weight[i] * f->weight[i], wt = ww * f->t[i];
        w0 += ww, w1 += wt, w2 += wt * f->t[i];
    }
    s->normal[0] = (double)four_sum(w0);
    s->normal[1] = (double)four_sum(w1);
    s->normal[2] = (double)four_sum(w2);
}

/* One step towards the line whose residuals, at most `limit` sigma each, are orthogonal to it. */
static void correct(const refitter *f, state *s, float limit) {
    four offset = (four){0} + (float)s->offset, angle = (four){0} + (float)s->angle;
    four most = (four){0} + limit, q0 = {0}, q1 = {0}, square = {0};
    four_bits out = {0};
    for (uint32_t i = 0; i * 4 < f->rows.n; i++) {
        four e = (f->offset[i] - offset - angle * f->t[i]) * f->weight[i];
        four_bits over = e > most, under = e < -most;
        out -= over + under; /* true is -1 */
        e = four_choose(over, most, four_choose(under, -most, e));
        square += e * e;
        e *= f->weight[i];
        q0 += e, q1 += e * f->t[i];
    }
    double n = f->rows.n, share = 1 - (out[0] + out[1] + out[2] + out[3]) / n, *w = s->normal;
    double det = w[0] * w[2] - w[1] * w[1], a = (double)four_sum(q0), b = (double)four_sum(q1);
    s->misfit = (double)four_sum(square);
    s->spread = s->misfit / (n - 2) / (share * share);
    s->offset += (w[2] * a - w[1] * b) / det;
    s->angle += (w[0] * b - w[1] * a) / det;
}

/* Moves the line, and its ends along with it. */
static void move(row_line *l, double offset, double angle) {
    double c = 1 / sqrt(1 + angle * angle), d = angle * c, h = l->length / 2;
    double x = l->x + h * l->dx - offset * l->dy, y = l->y + h * l->dy + offset * l->dx;
    double dx = c * l->dx - d * l->dy, dy = d * l->dx + c * l->dy;
    *l = (row_line){x - h * dx, y - h * dy, dx, dy, l->length};
}

/* ---- together ------------------------------------------------------------------------------- */

/* What the rows leave over, per degree of freedom, in sigma²; 0 without freedom. */
static double shape(const state *s, const row_sums *sum) {
    double rest = (double)(four_sum(sum->squares) - eight_sum(&sum->explained));
    return sum->dof > 0 && rest > 0 ? rest / ((double)sum->dof * s->noise * s->noise) : 0;
}

static bool pass(refitter *f, state *s, double blur, double base) {
    rows *r = &f->rows;
    rows_measure(r, &s->line, TRIM, (float)blur, (float)base);
    if (r->n < MIN_ROWS)
        return false;
    find_slopes(s, &r->sum);
    if (!find_step(s, r))
        return false;
    find_offsets(f, s);
    find_normal(f, s);
    s->offset = s->angle = 0;
    correct(f, s, INFINITY);
    for (int k = 0; k < HUBER_STEPS; k++)
        correct(f, s, HUBER);
    return isfinite(s->offset) && isfinite(s->angle);
}

/* What the linear model is wrong by, in sigma of a pixel: second order in the move and the blur. */
static double bent(const state *s, const row_sums *sum, double blur) {
    double end = s->angle * s->line.length / 2;
    double moved = (s->offset * s->offset + end * end / 3) / (blur * blur);
    double error = fabs(s->contrast[0]) * (0.12 * moved + 0.15 * s->widen * s->widen);
    return error / (s->noise * sqrt(fmax(1, shape(s, sum))));
}

static void result(const refitter *f, const state *s, double blur, arris_segment *out) {
    const row_line *l = &s->line;
    const row_sums *sum = &f->rows.sum;
    double c = s->contrast[0], w0 = s->normal[0], w1 = s->normal[1], w2 = s->normal[2];
    double det = w0 * w2 - w1 * w1, dof = (double)sum->dof;
    double grow = fmax(1, fmax(s->spread, shape(s, sum)));
    out->x1 = l->x, out->y1 = l->y;
    out->x2 = l->x + l->length * l->dx, out->y2 = l->y + l->length * l->dy;
    out->cov[0] = grow * w2 / det, out->cov[1] = -grow * w1 / det, out->cov[2] = grow * w0 / det;
    out->lo = (float)fmin(s->level, s->level + c);
    out->hi = (float)fmax(s->level, s->level + c);
    out->blur = (float)blur;
    out->chi2 = (float)((shape(s, sum) * dof + s->misfit) / (dof + f->rows.n - 2));
}

bool refit(refitter *f, const refit_start *start, arris_segment *out) {
    double dx = start->x2 - start->x1, dy = start->y2 - start->y1, length = sqrt(dx * dx + dy * dy);
    double left, right, moved = 0;
    state s = {.line = {start->x1, start->y1, dx / length, dy / length, length}};
    bool known = start->noise > 0;
    s.noise = known ? start->noise : ROUNDING;
    rows_probe(&f->rows, &s.line, PROBE, &left, &right);
    double blur = blur_guess(right - left, start->gradient), base = (left + right) / 2;
    for (int k = 0; k < MAX_PASSES; k++) {
        if (!pass(f, &s, blur, base))
            return false;
        move(&s.line, s.offset, s.angle);
        moved += fabs(s.offset) + fabs(s.angle) * length / 2;
        blur = step_blur(step_scale((float)blur * f->rows.slant)) / f->rows.slant * (1 + s.widen);
        if (moved > ESCAPED)
            return false;
        if (!known)
            s.noise *= fmax(1, sqrt(shape(&s, &f->rows.sum)));
        if (bent(&s, &f->rows.sum, blur) < BENT)
            break;
    }
    result(f, &s, blur, out);
    return true;
}
