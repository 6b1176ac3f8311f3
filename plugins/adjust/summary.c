/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * summary.c: what an adjustment found, in words (summary.h).
 */
#include "summary.h"

#include <math.h>
#include <string.h>

#include "invert.h"

/* ---- poses against true ones ----------------------------------------------------------------- */

static void centre(const adj_pose *pose, uint32_t n, double c[3]) {
    for (int k = 0; k < 3; k++) {
        c[k] = 0;
        for (uint32_t i = 0; i < n; i++)
            c[k] += pose[i].C[k] / n;
    }
}

/* The angle between two rotations. */
static double angle(const double A[9], const double B[9]) {
    double trace = 0, sine = 0, E[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            E[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
    for (int i = 0; i < 3; i++)
        trace += E[4 * i];
    sine = sqrt((E[7] - E[5]) * (E[7] - E[5]) + (E[2] - E[6]) * (E[2] - E[6]) +
                (E[3] - E[1]) * (E[3] - E[1]));
    return atan2(sine, trace - 1);
}

/* Adds what a position says of the similarity d = (rotation vector, translation, scale) that takes
 * it to the true one. */
static void normal(const adj_pose *a, const adj_pose *t, const double c[3], double M[7][8]) {
    double y[3];
    for (int i = 0; i < 3; i++)
        y[i] = a->C[i] - c[i];
    double J[3][8] = {{0, y[2], -y[1], 1, 0, 0, y[0], 0},
                      {-y[2], 0, y[0], 0, 1, 0, y[1], 0},
                      {y[1], -y[0], 0, 0, 0, 1, y[2], 0}};
    for (int i = 0; i < 3; i++) {
        J[i][7] = t->C[i] - a->C[i];
        for (int m = 0; m < 7; m++)
            for (int n = 0; n < 8; n++)
                M[m][n] += J[i][m] * J[i][n];
    }
}

/* Solves M d = its last column. All is held by a little, so that what nothing tells (a turn about a
 * straight path) stays as it is. */
static void solve(double M[7][8], double d[7]) {
    for (int i = 0; i < 7; i++)
        M[i][i] = M[i][i] > 0 ? M[i][i] * (1 + 1e-9) : 1;
    bool solved = invert(M[0], 7, 8);
    for (int i = 0; i < 7; i++) {
        d[i] = 0;
        for (int k = 0; solved && k < 7; k++)
            d[i] += M[i][k] * M[k][7];
    }
}

pose_errors summary_compare(const adj_pose *a, const adj_pose *truth, uint32_t n) {
    pose_errors e = {0, 0, 0};
    double M[7][8] = {{0}}, d[7], c[3];
    centre(a, n, c);
    for (uint32_t i = 0; i < n; i++)
        normal(&a[i], &truth[i], c, M);
    solve(M, d);
    for (uint32_t i = 0; i < n; i++) {
        double y[3], turned[3], turn = angle(a[i].R, truth[i].R);
        for (int k = 0; k < 3; k++)
            y[k] = a[i].C[k] - c[k];
        arris_cross(d, y, turned);
        for (int k = 0; k < 3; k++) {
            double off = truth[i].C[k] - a[i].C[k];
            double left = off - turned[k] - d[3 + k] - d[6] * y[k];
            e.position += off * off;
            e.shape += left * left;
        }
        e.rotation += turn * turn;
    }
    e.position = sqrt(e.position / n);
    e.rotation = sqrt(e.rotation / n);
    e.shape = sqrt(e.shape / n);
    return e;
}

/* ---- what is said ---------------------------------------------------------------------------- */

void summary_outliers(const record *r, char *text, size_t n) {
    size_t at = 0;
    bool any = false;
    snprintf(text, n, "none");
    for (uint32_t i = 0; i < r->n_frames; i++) {
        if (!r->frame[i].outlier)
            continue;
        if (at + 32 > n) {
            snprintf(text + at, n - at, " ...");
            return;
        }
        at += (size_t)snprintf(text + at, n - at, any ? ", %lld" : "%lld",
                               (long long)r->frame[i].index);
        any = true;
    }
}

/* The rms over the lines that are measured, px. */
static double rms_of(const arris_lines *lines) {
    double sum = 0, n = 0;
    for (uint32_t i = 0; i < lines->n; i++)
        if (lines->item[i].state == ARRIS_MEASURED) {
            sum += lines->item[i].rms * lines->item[i].rms;
            n++;
        }
    return n > 0 ? sqrt(sum / n) : 0;
}

static uint32_t measured(const arris_lines *lines) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < lines->n; i++)
        n += lines->item[i].state == ARRIS_MEASURED;
    return n;
}

static void print_sigmas(FILE *out, const adj_quality *q) {
    static const char *const axes[6] = {"x", "y", "z", "x", "y", "z"};
    for (int k = 0; k < 6; k++) {
        fprintf(out, k == 0   ? "noise of the positions    "
                     : k == 3 ? "\n  of the rotations        "
                              : "  ");
        if (q->determined[k])
            fprintf(out, "%s %.3g %s", axes[k], q->sigma[k] * (k < 3 ? 1 : 1e3),
                    k < 3 ? "mm" : "mrad");
        else
            fprintf(out, "%s not determined", axes[k]);
    }
    fputc('\n', out);
}

static void print_states(FILE *out, const adjusted *a) {
    static const struct {
        unsigned bit;
        int n;
        const char *what;
    } groups[] = {{ADJ_SCALE, 1, "scale, relative          "},
                  {ADJ_DRIFT, 6, "drift, mm and rad        "},
                  {ADJ_HAND_EYE, 6, "hand-eye, mm and rad     "},
                  {ADJ_DELAY, 1, "delay, s                 "},
                  {ADJ_LENS, ADJ_LENS_TERMS, "lens, px at the edge     "}};
    const double *v = a->state;
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++) {
        if (!(a->common & groups[i].bit))
            continue;
        fprintf(out, "%s", groups[i].what);
        for (int k = 0; k < groups[i].n; k++)
            fprintf(out, " %.3g", *v++);
        fputc('\n', out);
    }
}

static void print_truth(FILE *out, const summary *s) {
    const pose_errors *a = &s->reported, *b = &s->adjusted;
    fprintf(out, "poses against the true     reported    adjusted\n");
    fprintf(out, "  position, mm            %9.4f   %9.4f\n", a->position, b->position);
    fprintf(out, "  but for a similarity    %9.4f   %9.4f\n", a->shape, b->shape);
    fprintf(out, "  rotation, mrad          %9.4f   %9.4f\n", a->rotation * 1e3, b->rotation * 1e3);
}

void summary_print(FILE *out, const summary *s) {
    const adj_quality *q = &s->result->q;
    char text[400];
    summary_outliers(s->record, text, sizeof text);
    fprintf(out, "%u frames, %u lines with %u segments, by %s\n", s->record->n_frames,
            s->result->lines, s->result->views, s->solver);
    fprintf(out, "measured lines, before    %u, rms %.4f px\n", measured(s->before),
            rms_of(s->before));
    fprintf(out, "  after                   %u, rms %.4f px\n", measured(s->after),
            rms_of(s->after));
    print_sigmas(out, q);
    print_states(out, s->result);
    fprintf(out, "sigma of the scale        %.3g (%.3f mm in 1 m)\n", q->scale_sigma,
            q->scale_sigma * 1e3);
    fprintf(out, "chi-square                %.1f, %.0f degrees of freedom, p = %.2g\n", q->chi2,
            q->dof, q->significance);
    fprintf(out, "noise factor              %.3f\n", q->factor);
    fprintf(out, "outlier frames            %s\n", text);
    if (*s->result->undetermined)
        fprintf(out, "not determined            %s\n", s->result->undetermined);
    if (s->compared)
        print_truth(out, s);
}

static void number(FILE *out, const char *key, double v) {
    if (isfinite(v))
        fprintf(out, ", \"%s\": %.9g", key, v);
    else
        fprintf(out, ", \"%s\": null", key);
}

static void errors(FILE *out, const char *key, const pose_errors *e) {
    fprintf(out, ", \"%s\": {\"position\": %.9g, \"shape\": %.9g, \"rotation\": %.9g}", key,
            e->position, e->shape, e->rotation);
}

void summary_json(FILE *out, const summary *s) {
    const adj_quality *q = &s->result->q;
    const char *comma = "";
    fprintf(out, "{\"frames\": %u, \"lines\": %u, \"segments\": %u, \"solver\": \"%s\"",
            s->record->n_frames, s->result->lines, s->result->views, s->solver);
    number(out, "rms_px_before", rms_of(s->before));
    number(out, "rms_px_after", rms_of(s->after));
    number(out, "scale_sigma", q->scale_sigma);
    number(out, "chi2", q->chi2);
    number(out, "dof", q->dof);
    number(out, "significance", q->significance);
    number(out, "noise_factor", q->factor);
    fprintf(out, ", \"sigma\": [");
    for (int k = 0; k < 6; k++, comma = ", ")
        if (q->determined[k])
            fprintf(out, "%s%.9g", comma, q->sigma[k]);
        else
            fprintf(out, "%snull", comma);
    fprintf(out, "], \"states\": [");
    comma = "";
    for (int k = 0; k < s->result->n_states; k++, comma = ", ")
        fprintf(out, "%s%.9g", comma, s->result->state[k]);
    fprintf(out, "], \"outliers\": [");
    comma = "";
    for (uint32_t i = 0; i < s->record->n_frames; i++)
        if (s->record->frame[i].outlier) {
            fprintf(out, "%s%lld", comma, (long long)s->record->frame[i].index);
            comma = ", ";
        }
    fprintf(out, "], \"undetermined\": \"%s\"", s->result->undetermined);
    if (s->compared) {
        errors(out, "poses_reported", &s->reported);
        errors(out, "poses_adjusted", &s->adjusted);
    }
    fprintf(out, "}\n");
}
