/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * refit.c: Gauss-Newton on a blurred step along a line (refit.h).
 *
 * Every row gives the step's offset with both levels free (step.h); a line through the offsets, by
 * Huber's M-estimate, is the correction. Contrast (linear along the line) and blur are common to
 * all rows. The covariance is that of the linearised model, grown by chi2 where that is above 1.
 */
#include "refit.h"

#include "huber.h"

#include <math.h>
#include <stdlib.h>

#define TRIM 2.5          /* px at either end, where corners are round */
#define SMOOTHED (4. / 3) /* px²: a Gaussian of 1 px and central differences */
#define SIGNIFICANT 8.0   /* sigma that a step must stand out of the noise */
#define SLOPED 2.2        /* sigma under which slopes beside the line count for nothing */
#define CHANCE 1.5        /* sigma from which a variance above the noise's is no chance */
#define CROWDED_BLUR 0.9  /* px, at most, of an edge whose blur cannot be told */
#define CLIPPED 0.25      /* px that an edge may move when its bright side is clipped */
#define BENT 0.5          /* sigma of a pixel that linearising may cost */
#define ROUNDING 0.2887   /* sigma of the noise of whole grey levels: 12^-1/2 */
#define ESCAPED 1.5       /* px from the edge points at which a line is not theirs */
#define BESIDE 6          /* times what it is at the line, a step 1 px aside is another edge's */
#define WEAK 0.2   /* share of an edge's gradient up to which a point does not matter to it */
#define UNSURE 0.7 /* sigma of a pixel, of a difference between means of four */

enum { MIN_ROWS = 3, MAX_PASSES = 4, PROBE = 4 };

struct refitter {
    rows rows;
    crowd crowd;
    step_table steps;
    eight *offset, *weight; /* of the rows: px across the line, and in sigma^-1 */
};

/* What is known of the line that is being fitted. */
typedef struct state {
    row_line *line;
    double noise;       /* sigma of a pixel */
    double contrast[2]; /* signed along the row: in the middle, and per px along the line */
    int base, shift;    /* a level near the step's; levels are measured in units of 2^shift */
    double level;       /* before the step */
    double blur;        /* px */
    int scale;          /* of the filters */
    double widen;       /* relative excess of the blur over the filters' */
    double kink, slope; /* levels per px of the row that come of fading along the line */
    double lean;        /* share of the slopes beside the line that is taken out */
    double left;        /* variance of a pixel that the rows leave over, levels² */
    huber_line step;    /* through the rows' offsets: px, rad */
} state;

refitter *refitter_new(int width, int height) {
    refitter *f = aligned_alloc(_Alignof(refitter), sizeof *f);
    if (!f)
        return NULL;
    size_t room = ((size_t)(width > height ? width : height) / LANES + 2) * sizeof(eight);
    int error = rows_init(&f->rows, width, height) | crowd_init(&f->crowd, width, height);
    f->offset = aligned_alloc(sizeof(eight), 2 * room);
    if (error || !f->offset) {
        refitter_free(f);
        return NULL;
    }
    f->weight = f->offset + room / sizeof(eight);
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
                   const arris_camera *camera) {
    f->rows.image = image;
    if (edges)
        crowd_fill(&f->crowd, edges, image->width, image->height, camera);
}

void refitter_set_lens(refitter *f, const arris_camera *camera) {
    f->rows.bent = camera;
    if (camera)
        f->rows.lens = lens_of(camera);
}

void refitter_portable(refitter *f) {
    f->rows.portable = true;
}

/* ---- what is common to the rows ------------------------------------------------------------- */

/* The blur that gives this gradient in the smoothed picture. */
static double blur_guess(double contrast, double gradient) {
    double s = contrast * (1 / (sqrt(2 * M_PI) * gradient)), square = s * s - SMOOTHED;
    return square > 0.25 ? lesser(sqrt(square), 4) : 0.5;
}

/* Close to its neighbours an edge's blur cannot be told from theirs. */
static bool tells_blur(const rows *r) {
    return r->room >= 4 * r->n;
}

/* A filter's sums over the rows as a straight line along the line. */
static void along(const row_sums *sum, int filter, double *middle, double *per_px) {
    double w0 = (double)sum->weight[filter], w1 = (double)sum->weight_t[filter];
    double w2 = (double)sum->weight_tt[filter], det = w0 * w2 - w1 * w1;
    double q0 = (double)sum->answer[filter], q1 = (double)sum->answer_t[filter];
    *per_px = det > 0 ? (w0 * q1 - w1 * q0) / det : 0;
    *middle = (q0 - w1 * *per_px) / w0;
}

/* Level and contrast as linear functions of the place along the line. Where they fade along it, a
 * row that cuts the line aslant sees slopes. */
static void find_levels(state *s, const rows *r) {
    const row_sums *sum = &r->sum;
    double mean, fading, phi = (double)(sum->total[STEP_SUM] / sum->weight[STEP_MEAN]);
    along(sum, STEP_CONTRAST, &s->contrast[0], &s->contrast[1]);
    along(sum, STEP_MEAN, &mean, &fading);
    s->level = s->base + mean - s->contrast[0] * phi;
    fading += s->contrast[1] * (0.5 - phi); /* of the mean of the two sides */
    double aslant = ((double[]){s->line->dx, s->line->dy})[r->columns];
    s->kink = s->contrast[1] / 2 * aslant;
    s->slope = fading * aslant;
}

/* Slopes beside the line move the offset. What they add is taken out as far as they stand out of
 * the noise beyond what fading explains (shrinkage, from SLOPED sigma). */
static void find_slopes(state *s, const row_sums *sum) {
    double wk = (double)sum->weight[STEP_KINK], ws = (double)sum->weight[STEP_SLOPE];
    double kink = (double)sum->answer[STEP_KINK] - s->kink * wk;
    double slope = (double)sum->answer[STEP_SLOPE] - s->slope * ws;
    s->lean = 0;
    if (!(wk > 0))
        return;
    double square = greater(kink * kink / wk, ws > 0 ? slope * slope / ws : 0);
    double limit = SLOPED * s->noise * SLOPED * s->noise / square;
    double tilt = (double)(sum->total[STEP_TILT] / sum->weight[STEP_CONTRAST]);
    if (limit >= 1 || tilt / s->contrast[0] > 0.5) /* that would explain the step away */
        return;
    s->lean = 1 - limit * limit;
    s->contrast[0] -= s->lean * tilt;
}

/* What the sums tell. False when the step is not one that is brighter on the right and stands out
 * of the noise. */
static bool find_step(state *s, const rows *r) {
    const row_sums *sum = &r->sum;
    find_levels(s, r);
    find_slopes(s, sum);
    double wider = (double)sum->answer[STEP_BLUR] - s->lean * (double)sum->total[STEP_FLARE];
    wider /= (double)sum->weight[STEP_BLUR] * s->contrast[0];
    s->widen = tells_blur(r) ? greater(-0.5, lesser(0.5, wider)) : 0;
    double contrast = s->contrast[0] * (double)copysignf(1, (*r->across)[0]);
    return contrast > SIGNIFICANT * s->noise / sqrt((double)sum->weight[STEP_CONTRAST]);
}

/* ---- the line through the rows' offsets ----------------------------------------------------- */

/* Turns the filters' answers into offsets across the line, and fills up the last eight. Of the blur
 * of a contrast that fades along the line, a ramp in a row that is aslant, only the part across the
 * line is there. */
INLINE void offsets(refitter *f, const state *s) {
    const rows *r = &f->rows;
    float c0 = (float)s->contrast[0], c1 = (float)s->contrast[1], lean = (float)s->lean;
    float widen = (float)s->widen, noise = (float)s->noise;
    float kink = (float)(s->kink * (1 - s->lean)), slope = (float)(s->slope * (1 - s->lean));
    float ramp = (float)(2 * s->kink * s->blur * s->blur) * r->slant * r->slant;
    eight least = (eight){0} + 0.2f * fabsf(c0), sign = (eight){0} + copysignf(1, c0);
    for (uint32_t i = 0; LANES * i < r->n; i++) {
        eight a[LANES], o[LANES];
        eight_transpose(r->answers + LANES * i, a);
        eight_transpose(r->offset + LANES * i, o);
        eight size = (c0 + c1 * r->t[i]) * sign; /* the contrast may fade, but not vanish */
        size = EIGHT_CHOOSE(size > least, size, least) * sign;
        eight response = o[STEP_RESPONSE];
        eight whole = response * size * (1 + o[STEP_GAIN] * widen);
        eight across = r->across[i] / whole;
        eight slopes = o[STEP_PER_KINK] * a[STEP_KINK] + o[STEP_PER_SLOPE] * a[STEP_SLOPE];
        eight answer = a[STEP_OFFSET] + ramp * response - lean * slopes - kink * o[STEP_BY_KINK] -
                       slope * o[STEP_BY_SLOPE];
        f->offset[i] = -r->across[i] * r->shift[i] - across * answer;
        f->weight[i] =
            EIGHT_ABS(whole) / (EIGHT_ABS(r->across[i]) * (noise + noise * lean * o[STEP_UNSURE]));
    }
    uint32_t last = (r->n - 1) / LANES;
    eight_ints in = (eight_ints){0, 1, 2, 3, 4, 5, 6, 7} < (int32_t)(r->n - last * LANES);
    r->t[last] = (eight)((eight_ints)r->t[last] & in);
    f->offset[last] = (eight)((eight_ints)f->offset[last] & in);
    f->weight[last] = (eight)((eight_ints)f->weight[last] & in);
}

static void offsets_portable(refitter *f, const state *s) {
    offsets(f, s);
}

AVX2_PATH static void offsets_avx2(refitter *f, const state *s) {
    offsets(f, s);
}

static void find_offsets(refitter *f, const state *s) {
    (HAS_AVX2 && !f->rows.portable ? offsets_avx2 : offsets_portable)(f, s);
}

static huber_data data_of(const refitter *f) {
    return (huber_data){f->rows.n, f->rows.t, f->offset, f->weight, f->rows.portable};
}

/* Moves the line, and its ends along with it. */
static void move(row_line *l, double offset, double angle) {
    double c = 1 / sqrt(1 + angle * angle), d = angle * c, h = l->length / 2;
    double x = l->x + h * l->dx - offset * l->dy, y = l->y + h * l->dy + offset * l->dx;
    double dx = c * l->dx - d * l->dy, dy = d * l->dx + c * l->dy;
    *l = (row_line){x - h * dx, y - h * dy, dx, dy, l->length};
}

/* ---- together ------------------------------------------------------------------------------- */

/* What the rows leave over, per degree of freedom; 0 without freedom. */
static double left_over(const row_sums *sum) {
    eight parts = sum->explained;
    parts[STEP_BEFORE] = parts[STEP_BEHIND] = 0;
    double rest = (double)(eight_sum(&sum->squares) - eight_sum(&parts));
    return sum->total[STEP_DOF] > 0 && rest > 0 ? rest / (double)sum->total[STEP_DOF] : 0;
}

/* The same in units of the noise's variance, and the greater of the two. */
static double shape(const state *s) {
    return s->left / (s->noise * s->noise);
}

static double variance(const state *s) {
    double noise = s->noise * s->noise;
    return s->left > noise ? s->left : noise;
}

/* Levels and blur, before anything is measured. False when the grey levels step beside the line
 * rather than at it, and no noise explains that: what would be measured is another edge. */
static bool first_look(state *s, const rows *r, double gradient) {
    double level[ROWS_PROBED];
    rows_probe(r, PROBE, level);
    double before = level[0], behind = level[ROWS_PROBED - 1], at = fabs(level[3] - level[2]);
    double beside = greater(fabs(level[2] - level[1]), fabs(level[4] - level[3]));
    if (beside > BESIDE * (at + UNSURE * s->noise))
        return false;
    s->base = (int)((before + behind) / 2);
    while (fabs(behind - before) > STEP_MOST << s->shift)
        s->shift++;
    s->blur = blur_guess(fabs(behind - before), gradient);
    if (!tells_blur(r))
        s->blur = lesser(s->blur, CROWDED_BLUR);
    return true;
}

/* What the linear model is wrong by, in sigma of a pixel: second order in the move, whose mean
 * square in blurs is `square`, and in the blur as far as other filters suit it better. */
static double bent(const state *s, const rows *r, double square) {
    bool better = step_scale((float)s->blur * r->slant) != s->scale;
    double error = 0.12 * square + (better ? 0.15 * s->widen * s->widen : 0);
    return fabs(s->contrast[0]) * error / sqrt(variance(s));
}

/* Measures the rows by the filters for the blur. */
static bool measure(state *s, rows *r) {
    s->scale = step_scale((float)s->blur * r->slant);
    rows_measure(r, s->scale);
    s->left = left_over(&r->sum);
    bool found = find_step(s, r);
    s->blur = (double)(step_blur(s->scale) / r->slant) * (1 + s->widen);
    return found;
}

/* Whether the same rows would tell more by filters for the blur that was found: it is another, and
 * not one that takes more room from neighbours. */
static bool mistook_blur(const state *s, const rows *r) {
    return rows_clear(r, (float)s->blur) <= r->clear && bent(s, r, 0) >= BENT;
}

/* One Gauss-Newton step: moves the line and corrects the blur. */
static bool improve(refitter *f, state *s, double gradient) {
    rows *r = &f->rows;
    rows_trace(r, s->line, TRIM, s->blur > 0 ? (float)s->blur : 1);
    if (r->n < MIN_ROWS)
        return false;
    if (!(s->blur > 0) && !first_look(s, r, gradient))
        return false;
    rows_fetch(r, s->base, s->shift);
    if (!measure(s, r) || (mistook_blur(s, r) && !measure(s, r)))
        return false;
    find_offsets(f, s);
    huber_data d = data_of(f);
    huber_fit(&d, &s->step);
    move(s->line, s->step.offset, s->step.slope);
    return isfinite(s->step.offset) && isfinite(s->step.slope) && isfinite(s->step.spread);
}

/* The mean square of the line's move, in blurs. */
static double square_move(const state *s) {
    double offset = s->step.offset, end = s->step.slope * s->line->length / 2;
    return (offset * offset + end * end / 3) / (s->blur * s->blur);
}

/* Variance, px², of what the rows cannot tell as they have it in common. */
static double common_error(const rows *r, double hi) {
    double top = r->image->format == ARRIS_GREY16 ? UINT16_MAX : UINT8_MAX;
    double pull = (double)r->pull / r->n, clipped = hi > 0.99 * top ? CLIPPED : 0;
    return pull * pull + clipped * clipped;
}

/* What is left on the dark side, before the step, or on the bright one; in sigma. */
static double beside(const state *s, const row_sums *sum, int side) {
    int filter = STEP_BEFORE + ((s->contrast[0] > 0) ^ (side == 0));
    double weight = (double)sum->weight[filter], answer = (double)sum->answer[filter];
    return weight > 0 ? answer / sqrt(weight * variance(s)) : 0;
}

static void result(const refitter *f, const state *s, arris_segment *out) {
    const row_line *l = s->line;
    const row_sums *sum = &f->rows.sum;
    const double c = s->contrast[0], *w = s->step.normal, det = w[0] * w[2] - w[1] * w[1];
    double dof = (double)sum->total[STEP_DOF], lines_dof = f->rows.n - 2;
    huber_data d = data_of(f);
    double grow =
        greater(huber_beyond_chance(s->step.spread, lines_dof, CHANCE),
                greater(huber_beyond_chance(shape(s), dof, CHANCE), huber_waves(&d, &s->step)));
    out->x1 = l->x, out->y1 = l->y;
    out->x2 = l->x + l->length * l->dx, out->y2 = l->y + l->length * l->dy;
    out->lo = (float)lesser(s->level, s->level + c);
    out->hi = (float)greater(s->level, s->level + c);
    out->cov[0] = grow * w[2] / det + common_error(&f->rows, (double)out->hi);
    out->cov[1] = -grow * w[1] / det;
    out->cov[2] = grow * w[0] / det;
    out->blur = tells_blur(&f->rows) ? (float)s->blur : 0;
    for (int k = 0; k < 2; k++)
        out->beside[k] = (float)beside(s, sum, k);
    out->chi2 = (float)((shape(s) * dof + s->step.misfit) / (dof + lines_dof));
}

bool refit(refitter *f, refit_start *start, arris_segment *out) {
    bool known = start->noise > 0;
    double moved = 0;
    state s; /* the rest is found before it is asked for; clearing it would take its time */
    s.line = &start->line;
    s.noise = known ? start->noise : ROUNDING;
    s.shift = 0, s.blur = 0;
    f->rows.whole = start->whole;
    f->rows.moved[0] = (int)lrint(start->dx), f->rows.moved[1] = (int)lrint(start->dy);
    f->rows.clear_only = WEAK * start->gradient >= (double)f->crowd.clear;
    for (int k = 0; k < MAX_PASSES; k++) {
        if (!improve(f, &s, start->gradient))
            return false;
        moved += fabs(s.step.offset) + fabs(s.step.slope) * s.line->length / 2;
        if (moved > ESCAPED)
            return false;
        if (!known)
            s.noise = sqrt(variance(&s));
        if ((known || k > 0) && bent(&s, &f->rows, square_move(&s)) < BENT)
            break;
    }
    result(f, &s, out);
    if (!known)
        out->chi2 = 0;
    return true;
}
