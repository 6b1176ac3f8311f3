/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * report.c: what a scan of the box has measured: `report lines.json truth.json` prints the measured
 * lines with their uncertainty, and the depth of the box's top edges beside the true one. It exits
 * with 1 when no top edge was measured, with 2 when a file cannot be read.
 */
#include <jansson.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* A line of lines.json (arris-lines/1). */
struct line {
    double p[3], q[3];
    double cov[21]; /* of (p, q), upper triangle row by row, mm² */
    double rms;     /* px */
    int id, views;
};

static json_t *load(const char *path, json_t **lines) {
    json_error_t e;
    json_t *root = json_load_file(path, 0, &e);
    *lines = json_object_get(root, "lines");
    if (json_is_array(*lines))
        return root;
    fprintf(stderr, "report: %s: %s\n", path, root ? "it has no array 'lines'" : e.text);
    exit(2);
}

static void wrong(const char *path, const json_error_t *e) {
    fprintf(stderr, "report: %s: a line of it is not as it should be: %s\n", path, e->text);
    exit(2);
}

/* ---- the measured lines --------------------------------------------------------------------- */

static struct line read_line(json_t *o, const char *path) {
    struct line l;
    json_error_t e;
    json_t *cov;
    if (json_unpack_ex(o, &e, 0, "{s:i, s:[FFF!], s:[FFF!], s:o, s:i, s:F}", "id", &l.id, "p",
                       &l.p[0], &l.p[1], &l.p[2], "q", &l.q[0], &l.q[1], &l.q[2], "cov", &cov,
                       "views", &l.views, "rms_px", &l.rms))
        wrong(path, &e);
    for (size_t i = 0; i < 21; i++)
        l.cov[i] = json_number_value(json_array_get(cov, i));
    return l;
}

static bool is_measured(json_t *o) {
    const char *state = json_string_value(json_object_get(o, "state"));
    return state && strcmp(state, "measured") == 0;
}

/* Element (i, j) of the 6x6 covariance. */
static double cov_at(const struct line *l, int i, int j) {
    int a = i < j ? i : j, b = i < j ? j : i;
    return l->cov[a * 6 - a * (a - 1) / 2 + b - a];
}

/* How far the line lies from the true one at an end, as an RMS, mm: the root of the trace of V
 * without what is along the line, tr V - u'Vu. */
static double across(const struct line *l, int end) {
    double u[3], n = 0, var = 0;
    for (int i = 0; i < 3; i++) {
        u[i] = l->q[i] - l->p[i];
        n += u[i] * u[i];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            var += ((i == j) - u[i] * u[j] / n) * cov_at(l, 3 * end + i, 3 * end + j);
    return sqrt(var);
}

static void print_lines(json_t *lines, const char *path) {
    size_t i;
    json_t *o;
    printf("  id        p: x, y, z / mm             q: x, y, z / mm        +- across p, q"
           "  views  rms/px\n");
    json_array_foreach(lines, i, o) {
        if (!is_measured(o))
            continue;
        struct line l = read_line(o, path);
        printf("%4d  %8.2f %8.2f %8.2f   %8.2f %8.2f %8.2f   %7.2f %6.2f  %5d  %6.3f\n", l.id,
               l.p[0], l.p[1], l.p[2], l.q[0], l.q[1], l.q[2], across(&l, 0), across(&l, 1),
               l.views, l.rms);
    }
}

/* ---- the top edges -------------------------------------------------------------------------- */

/* Whether `l` lies on the edge pq as seen from above, its depth being free within 5 %: parallel to
 * 8 degrees, its middle beside the edge, and nearer than half the width of the box's paint, whose
 * inner limit is a line too. */
static bool lies_on(const struct line *l, const double p[3], const double q[3]) {
    double dx = q[0] - p[0], dy = q[1] - p[1], n = hypot(dx, dy);
    double lx = l->q[0] - l->p[0], ly = l->q[1] - l->p[1];
    double x = (l->p[0] + l->q[0]) / 2 - p[0], y = (l->p[1] + l->q[1]) / 2 - p[1];
    double z = (l->p[2] + l->q[2] - p[2] - q[2]) / 2, along = (x * dx + y * dy) / n;
    return fabs(lx * dx + ly * dy) > cos(8 * M_PI / 180) * n * hypot(lx, ly) && along > 0 &&
           along < n && fabs(x * dy - y * dx) / n < 4 && fabs(z) < 0.05 * p[2];
}

static double length(const struct line *l) {
    return hypot(hypot(l->q[0] - l->p[0], l->q[1] - l->p[1]), l->q[2] - l->p[2]);
}

/* The longest measured line on an edge; its id is -1 when there is none. */
static struct line longest(json_t *lines, const char *path, const double p[3], const double q[3]) {
    struct line best = {.id = -1};
    size_t i;
    json_t *o;
    json_array_foreach(lines, i, o) {
        if (!is_measured(o))
            continue;
        struct line l = read_line(o, path);
        if (lies_on(&l, p, q) && length(&l) > length(&best))
            best = l;
    }
    return best;
}

static void print_depth(const char *id, double truth, const struct line *l) {
    double z = (l->p[2] + l->q[2]) / 2;
    double sigma = sqrt(cov_at(l, 2, 2) + 2 * cov_at(l, 2, 5) + cov_at(l, 5, 5)) / 2;
    if (l->id < 0)
        printf("  %-10s %8.2f   not measured\n", id, truth);
    else
        printf("  %-10s %8.2f   %8.2f +- %.2f   %+6.2f mm  %+7.3f %%   line %d\n", id, truth, z,
               sigma, z - truth, 100 * (z - truth) / truth, l->id);
}

/* The top edges are the physical edges in the truth that this scan could measure. Returns how many
 * it did. */
static int print_top(json_t *lines, const char *path, json_t *edges, const char *truth_path) {
    int found = 0;
    size_t i;
    json_t *o;
    json_array_foreach(edges, i, o) {
        const char *id;
        double p[3], q[3];
        int observable, in_cad;
        json_error_t e;
        if (json_unpack_ex(o, &e, 0, "{s:s, s:[FFF!], s:[FFF!], s:b, s:b}", "id", &id, "p", &p[0],
                           &p[1], &p[2], "q", &q[0], &q[1], &q[2], "observable", &observable,
                           "in_cad", &in_cad))
            wrong(truth_path, &e);
        if (!observable || !in_cad)
            continue;
        struct line l = longest(lines, path, p, q);
        print_depth(id, (p[2] + q[2]) / 2, &l);
        found += l.id >= 0;
    }
    return found;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: report lines.json truth.json\n");
        return 2;
    }
    json_t *lines, *edges, *measured = load(argv[1], &lines), *truth = load(argv[2], &edges);
    print_lines(lines, argv[1]);
    printf(
        "\ndepth of the box's top edges, mm\n  edge           true   measured            error\n");
    int found = print_top(lines, argv[1], edges, argv[2]);
    json_decref(measured);
    json_decref(truth);
    return found ? 0 : 1;
}
