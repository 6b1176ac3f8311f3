/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * derive.c: distances, angles and corners of measured edges. Their uncertainty follows from the
 * lines' covariances by numeric derivatives (JCGM 100, 5.1.3, note 2).
 */
#include "derive.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"

static const double PI = 3.14159265358979323846;
static const double PARALLEL = 0.14, MEET = 0.1; /* rad; the sine of what still is, and no longer */

/* Two lines by their ends: p and q of a, p and q of b. */
typedef struct pair {
    double x[12];
} pair;

static void direction(const double *pq, double u[3]) {
    for (int i = 0; i < 3; i++)
        u[i] = pq[3 + i] - pq[i];
    arris_unit(u);
}

/* From 0 to 180°. */
static double angle(const pair *l) {
    double u[3], v[3], w[3];
    direction(l->x, u);
    direction(l->x + 6, v);
    arris_cross(u, v, w);
    return atan2(sqrt(arris_dot(w, w)), arris_dot(u, v));
}

/* From the point of b that is nearest to `middle`, square to a; d is from a to there. */
static double distance(const pair *l, const double middle[3], double d[3]) {
    double u[3], v[3], w[3];
    direction(l->x, u);
    direction(l->x + 6, v);
    for (int i = 0; i < 3; i++)
        w[i] = middle[i] - l->x[6 + i];
    double s = arris_dot(w, v);
    for (int i = 0; i < 3; i++)
        d[i] = l->x[6 + i] + s * v[i] - l->x[i];
    s = arris_dot(d, u);
    for (int i = 0; i < 3; i++)
        d[i] -= s * u[i];
    return sqrt(arris_dot(d, d));
}

/* The middle between the points at which the lines are nearest to each other. */
static void corner(const pair *l, double X[3]) {
    double u[3], v[3], w[3];
    direction(l->x, u);
    direction(l->x + 6, v);
    for (int i = 0; i < 3; i++)
        w[i] = l->x[i] - l->x[6 + i];
    double b = arris_dot(u, v), d = arris_dot(u, w), e = arris_dot(v, w), D = 1 - b * b;
    double s = (b * e - d) / D, t = (e - b * d) / D;
    for (int i = 0; i < 3; i++)
        X[i] = (l->x[i] + s * u[i] + l->x[6 + i] + t * v[i]) / 2;
}

static pair nominal_pair(const nominal *m, const place *where, uint32_t a, uint32_t b) {
    pair l;
    const double *ends[4] = {m->edge[a].p, m->edge[a].q, m->edge[b].p, m->edge[b].q};
    for (int i = 0; i < 4; i++)
        if (where)
            place_point(where, ends[i], l.x + 3 * i);
        else
            memcpy(l.x + 3 * i, ends[i], 3 * sizeof(double));
    return l;
}

static void middle_of_b(const pair *l, double X[3]) {
    for (int i = 0; i < 3; i++)
        X[i] = (l->x[6 + i] + l->x[9 + i]) / 2;
}

/* ---- the words ------------------------------------------------------------------------------- */

static int edge_named(const nominal *m, const char *name, size_t n) {
    for (uint32_t i = 0; i < m->n_edges; i++)
        if (strlen(m->edge[i].id) == n && !memcmp(m->edge[i].id, name, n))
            return (int)i;
    return -1;
}

static bool trailing(const char **at, char mark, double *value) {
    char *end;
    if (**at != mark)
        return true;
    *value = strtod(*at + 1, &end);
    bool good = end != *at + 1 && isfinite(*value) && *value > 0;
    *at = end;
    return good;
}

static int parse_one(const char *text, size_t n, const nominal *m, derived *d, fault *f) {
    static const char *const kinds[] = {"distance(", "angle(", "corner("};
    static const char hint[] = "for example distance(a,b)=260:0.5; angle(a,b):0.2; corner(a,b)";
    const char *at = text, *comma = memchr(text, ',', n), *close = memchr(text, ')', n);
    int kind = 0;
    while (kind < 3 && strncmp(text, kinds[kind], strlen(kinds[kind])) != 0)
        kind++;
    if (kind == 3 || !comma || !close || close < comma)
        return fault_set(f, ARRIS_E_USAGE, hint, "'%.*s' is no derived feature", (int)n, text);
    *d = (derived){.kind = (enum derived_kind)kind};
    at += strlen(kinds[kind]);
    int a = edge_named(m, at, (size_t)(comma - at));
    int b = edge_named(m, comma + 1, (size_t)(close - comma) - 1);
    if (a < 0 || b < 0 || a == b)
        return fault_set(f, ARRIS_E_USAGE, "`arris inspect --edges MODEL` lists them",
                         "'%.*s' does not name two edges of the model", (int)n, text);
    d->a = (uint32_t)a;
    d->b = (uint32_t)b;
    snprintf(d->id, sizeof d->id, "%.*s", (int)(close + 1 - text), text);
    at = close + 1;
    if (!trailing(&at, '=', &d->nominal) || !trailing(&at, ':', &d->tolerance) || at != text + n)
        return fault_set(f, ARRIS_E_USAGE, hint, "in '%.*s' a number is wrong", (int)n, text);
    double unit = kind == DERIVED_ANGLE ? PI / 180 : 1, unused[3], middle[3];
    d->nominal *= unit;
    d->tolerance *= unit;
    pair l = nominal_pair(m, NULL, d->a, d->b);
    d->obtuse = angle(&l) > PI / 2;
    double acute = d->obtuse ? PI - angle(&l) : angle(&l);
    middle_of_b(&l, middle);
    if (kind == DERIVED_DISTANCE && acute > PARALLEL)
        return fault_set(f, ARRIS_E_USAGE, "a distance is that of parallel edges",
                         "the edges of '%.*s' are turned by %.0f degrees", (int)n, text,
                         acute * 180 / PI);
    if (kind == DERIVED_ANGLE && d->tolerance <= 0)
        return fault_set(f, ARRIS_E_USAGE, "for example angle(a,b):0.2, in degrees",
                         "'%.*s' has no tolerance of its own", (int)n, text);
    if (kind == DERIVED_CORNER && sin(acute) < MEET)
        return fault_set(f, ARRIS_E_USAGE, NULL, "the edges of '%.*s' are parallel", (int)n, text);
    if (d->nominal <= 0)
        d->nominal = kind == DERIVED_DISTANCE ? distance(&l, middle, unused) : acute;
    return 0;
}

int derived_parse(const char *text, const nominal *m, derived *out, fault *f) {
    int n = 0;
    while (*text) {
        size_t length = strcspn(text, "; \t\n");
        if (length && n == DERIVED_MAX)
            return fault_set(f, ARRIS_E_USAGE, NULL, "there are more than %d derived features",
                             DERIVED_MAX);
        if (length && parse_one(text, length, m, &out[n], f))
            return ARRIS_E_USAGE;
        n += length > 0;
        text += length + (text[length] != 0);
    }
    return n;
}

/* ---- judging --------------------------------------------------------------------------------- */

/* The values whose deviations are judged: one number, or a corner's three along e. */
static double value(const derived *d, const pair *l, const double middle[3], const double e[3]) {
    double v[3];
    if (d->kind == DERIVED_DISTANCE)
        return distance(l, middle, v);
    if (d->kind == DERIVED_ANGLE)
        return d->obtuse ? PI - angle(l) : angle(l);
    corner(l, v);
    return arris_dot(v, e);
}

static double variance(const derived *d, const pair *l, const double middle[3], const double e[3],
                       const arris_line *const line[2], const bool turned[2]) {
    static const double H = 1e-3; /* mm */
    double slope[12], sum = 0;
    for (int i = 0; i < 12; i++) {
        pair low = *l, high = *l;
        low.x[i] -= H;
        high.x[i] += H;
        slope[i] = (value(d, &high, middle, e) - value(d, &low, middle, e)) / (2 * H);
    }
    for (int k = 0; k < 2; k++)
        for (int i = 0, n = 0; i < 6; i++)
            for (int j = i; j < 6; j++, n++)
                sum += (i == j ? 1 : 2) * slope[6 * k + (turned[k] ? (i + 3) % 6 : i)] *
                       slope[6 * k + (turned[k] ? (j + 3) % 6 : j)] * line[k]->cov[n];
    return sum;
}

/* What the alignment leaves open of a point along e. */
static double variance_of_place(const place *w, const double X[3], const double e[3]) {
    double rho[3], row[6], sum = 0;
    for (int i = 0; i < 3; i++)
        rho[i] = X[i] - w->c[i] - w->t[i];
    arris_cross(rho, e, row);
    for (int i = 0; i < 3; i++) {
        row[i] /= w->size;
        row[3 + i] = e[i];
    }
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 6; k++)
            sum += row[i] * w->cov[i][k] * row[k];
    return sum;
}

/* Exchanges the ends of a line that runs against the nominal edge. True when it did. */
static bool turn_along(double *pq, const double *like) {
    double u[3], v[3];
    direction(pq, u);
    direction(like, v);
    for (int i = 0; i < 3 && arris_dot(u, v) < 0; i++) {
        double p = pq[i];
        pq[i] = pq[3 + i];
        pq[3 + i] = p;
    }
    return arris_dot(u, v) < 0;
}

void derived_judge(const derived *d, const nominal *m, const place *where, const calibration *cal,
                   const piece *e, const arris_lines *lines, double k, double tolerance,
                   arris_feature *f) {
    const arris_line *line[2] = {&lines->item[e[d->a].line], &lines->item[e[d->b].line]};
    pair l, ideal = nominal_pair(m, where, d->a, d->b);
    double middle[3], along[3] = {0}, X[3], N[3], more = 0;
    bool turned[2];
    for (int i = 0; i < 2; i++) {
        memcpy(l.x + 6 * i, line[i]->p, 3 * sizeof(double));
        memcpy(l.x + 6 * i + 3, line[i]->q, 3 * sizeof(double));
        turned[i] = turn_along(l.x + 6 * i, ideal.x + 6 * i);
    }
    middle_of_b(&ideal, middle);
    if (d->kind == DERIVED_CORNER) {
        corner(&l, X);
        corner(&ideal, N);
        for (int i = 0; i < 3; i++)
            along[i] = X[i] - N[i];
        f->deviation = arris_unit(along);
        for (int i = 0; i < 3; i++)
            N[i] -= cal->C[i];
        more = variance_of_place(where, X, along) +
               pow(cal->focal * arris_dot(cal->R + 6, N) * arris_dot(cal->R + 6, along), 2);
    } else {
        f->deviation = value(d, &l, middle, along) - d->nominal;
        if (d->kind == DERIVED_DISTANCE) {
            distance(&l, middle, X);
            more = pow(cal->focal * arris_dot(cal->R + 6, X), 2);
        }
    }
    f->U = k * sqrt(variance(d, &l, middle, along, line, turned) + more);
    f->worst = f->deviation;
    f->worst_U = f->U;
    f->is_angle = d->kind == DERIVED_ANGLE;
    f->tolerance = d->tolerance > 0 ? d->tolerance : tolerance;
    f->verdict = judge(f->deviation, f->U, f->tolerance);
}
