/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_adjust.c: how near `adjust` comes to the joint Cramér-Rao bound, and what it costs.
 *
 *     bench_adjust [SCAN LINES.json]...
 *
 * Without arguments: time and memory of simulated scans of 250 to 2,000 frames, 500 lines at most,
 * each line seen in 40 frames. With them: for scans made by exactscan (frames.csv, truth_poses.csv,
 * camera.json, truth.json) and lines measured on them, the rms distance of the lines from the true
 * edges when scale and rigid motion are taken out (the shape), and that of their depth as they are;
 * beside both the bound: the inverse of the joint information of all edges and poses at the truth.
 * An edge's is by the rendered noise, contrast and blur as in exactscan (grey levels known, no edge
 * hidden, ends not trimmed), a pose's by the scan's jitter. The similarity is taken out of both
 * alike.
 */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "adjust/adjust.h"
#include "adjust/input.h"
#include "bytes.h"
#include "camera.h"
#include "frames.h"

enum { EDGES = 200, POINTS = 4000, PATH_SIZE = 4096 };

typedef struct edge {
    double p[3], q[3], contrast;
    bool observable;
} edge;

typedef struct scan {
    arris_camera camera;
    frame_list reported, truth;
    edge edge[EDGES];
    int n;
    double noise, blur, sigma[6];
} scan;

static void die(const char *what, const char *why) {
    fprintf(stderr, "bench_adjust: %s: %s\n", what, why);
    exit(1);
}

/* ---- the scan -------------------------------------------------------------------------------- */

static double about(const json_t *root, const char *key) {
    return json_number_value(json_object_get(json_object_get(root, "about"), key));
}

static void read_truth(scan *s, const char *path) {
    json_error_t e;
    json_t *root = json_load_file(path, 0, &e), *l;
    size_t i;
    if (!root || !json_object_get(root, "about"))
        die(path, "no truth.json of exactscan");
    json_array_foreach(json_object_get(root, "lines"), i, l) {
        if (s->n == EDGES)
            die(path, "too many edges");
        edge *o = &s->edge[s->n++];
        for (size_t k = 0; k < 3; k++) {
            o->p[k] = json_number_value(json_array_get(json_object_get(l, "p"), k));
            o->q[k] = json_number_value(json_array_get(json_object_get(l, "q"), k));
        }
        o->contrast = json_number_value(json_object_get(l, "contrast"));
        o->observable = json_is_true(json_object_get(l, "observable"));
    }
    const char *axis = json_string_value(json_object_get(json_object_get(root, "about"), "axis"));
    double j = fmax(about(root, "jitter"), 1e-6), w = fmax(about(root, "jitter_rot"), 1e-9);
    s->noise = about(root, "noise"), s->blur = hypot(about(root, "blur"), sqrt(1 / 12.0));
    for (int k = 0; k < 6; k++)
        s->sigma[k] = k > 2 ? w : k == (axis && !strcmp(axis, "y")) ? j : 0.35 * j;
    json_decref(root);
}

static void load(scan *s, const char *folder) {
    char path[PATH_SIZE];
    fault f;
    memset(s, 0, sizeof *s);
    snprintf(path, sizeof path, "%s/camera.json", folder);
    if (camera_load(path, &s->camera, &f))
        die(path, f.text);
    s->camera = arris_camera_ideal(&s->camera);
    snprintf(path, sizeof path, "%s/frames.csv", folder);
    if (frames_load(&s->reported, path, 0, &f))
        die(path, f.text);
    snprintf(path, sizeof path, "%s/truth_poses.csv", folder);
    if (frames_load(&s->truth, path, 0, &f))
        die(path, f.text);
    snprintf(path, sizeof path, "%s/truth.json", folder);
    read_truth(s, path);
}

/* ---- the bound ------------------------------------------------------------------------------- */

/* What of the edge is in the picture, as a segment. */
static bool segment_of(const scan *s, const edge *o, const arris_pose *pose, arris_segment *out) {
    double x[101], y[101];
    int first = -1, last = -1;
    for (int i = 0; i <= 100; i++) {
        double P[3];
        for (int k = 0; k < 3; k++)
            P[k] = o->p[k] + (o->q[k] - o->p[k]) * i / 100;
        if (!(arris_project(&s->camera, pose, P, &x[i], &y[i]) > 0) || x[i] < 3 || y[i] < 3 ||
            x[i] > s->camera.width - 4 || y[i] > s->camera.height - 4)
            continue;
        first = first < 0 ? i : first;
        last = i;
    }
    double length = first < last ? hypot(x[last] - x[first], y[last] - y[first]) : 0;
    if (last - first < 9 || length < 10)
        return false;
    double variance = (s->noise * s->noise + 1 / 12.0) * 2 * sqrt(3.14159265358979) * s->blur /
                      (length * o->contrast * o->contrast);
    *out = (arris_segment){.x1 = x[first],
                           .y1 = y[first],
                           .x2 = x[last],
                           .y2 = y[last],
                           .cov = {variance, 0, 12 * variance / (length * length)}};
    return true;
}

/* The problem at the truth; which[l] is line l's edge. */
static void at_truth(const scan *s, adj_problem *p, int *which) {
    arris_pose pose;
    uint32_t frames = (uint32_t)s->truth.n;
    if (adj_init(p, frames, EDGES, frames * EDGES))
        die("memory", "none");
    p->camera = s->camera;
    memcpy(p->sigma, s->sigma, sizeof p->sigma);
    for (uint32_t i = 0; i < frames; i++) {
        frames_pose(&s->truth.item[i], &pose);
        adj_add_frame(p, &pose, i);
    }
    for (int e = 0; e < s->n; e++) {
        arris_segment seg;
        int64_t line = -1;
        for (uint32_t i = 0; i < frames; i++) {
            frames_pose(&s->truth.item[i], &pose);
            if (!segment_of(s, &s->edge[e], &pose, &seg))
                continue;
            if (line < 0)
                which[line = adj_add_line(p, s->edge[e].p, s->edge[e].q, 300)] = e;
            adj_add_view(p, i, (uint32_t)line, &seg);
        }
    }
}

/* The covariance of all lines' x: dense, n x n, from the whole information matrix. */
static double *line_covariance(const adj_problem *p, int *size) {
    int poses = 6 * (int)p->n_frames, n = poses + 4 * (int)p->n_lines, m = n - poses;
    double *H = calloc((size_t)n * (size_t)n, sizeof *H),
           *cov = calloc((size_t)(m * m), sizeof *cov);
    if (!H || !cov)
        die("memory", "none");
    for (uint32_t i = 0; i < p->n_frames; i++)
        for (int k = 0; k < 6; k++)
            H[(6 * (int)i + k) * (n + 1)] = adj_precision(p, k, i);
    for (uint32_t l = 0; l < p->n_lines; l++)
        for (int k = 0; k < 4; k++)
            H[(poses + 4 * (int)l + k) * (n + 1)] += 1 / (p->line[l].hold * p->line[l].hold);
    for (uint32_t i = 0; i < p->n_views; i++) {
        const adj_view *v = &p->view[i];
        double r[2], J[2][10], Jp[2][6], Jl[2][4],
            det = v->cov[0] * v->cov[2] - v->cov[1] * v->cov[1];
        double W[2][2] = {{v->cov[2] / det, -v->cov[1] / det}, {-v->cov[1] / det, v->cov[0] / det}};
        if (!adj_residual(p, v, &p->frame[v->frame].pose, &p->line[v->line], r, Jp, Jl))
            continue;
        int at[10];
        for (int k = 0; k < 10; k++) {
            at[k] = k < 6 ? 6 * (int)v->frame + k : poses + 4 * (int)v->line + k - 6;
            for (int q = 0; q < 2; q++)
                J[q][k] = k < 6 ? Jp[q][k] : Jl[q][k - 6];
        }
        for (int a = 0; a < 10; a++)
            for (int b = 0; b < 10; b++)
                for (int q = 0; q < 4; q++)
                    H[at[a] * n + at[b]] += J[q / 2][a] * W[q / 2][q % 2] * J[q % 2][b];
    }
    /* Cholesky in place, below the diagonal, and the inverse's last block by solving */
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++) {
            double sum = H[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= H[i * n + k] * H[j * n + k];
            H[i * n + j] = i == j ? sqrt(sum) : sum / H[j * n + j];
        }
    }
    double *x = calloc((size_t)m, sizeof *x);
    for (int c = 0; c < m; c++) {
        for (int i = 0; i < m; i++) {
            double sum = i == c;
            for (int k = 0; k < i; k++)
                sum -= H[(poses + i) * n + poses + k] * x[k];
            x[i] = sum / H[(poses + i) * (n + 1)];
        }
        for (int i = m - 1; i >= 0; i--) {
            double sum = x[i];
            for (int k = i + 1; k < m; k++)
                sum -= H[(poses + k) * n + poses + i] * cov[k * m + c];
            cov[i * m + c] = sum / H[(poses + i) * (n + 1)];
        }
    }
    free(x);
    free(H);
    *size = m;
    return cov;
}

/* ---- distances ------------------------------------------------------------------------------- */

/* A direction across an edge at a point of it: distances are along these. */
typedef struct probe {
    double X[3], t[3];
} probe;

static int probe_edge(const edge *o, double step, probe *out, int max) {
    double u[3], a[3], b[3], length = 0;
    int n = 0;
    for (int k = 0; k < 3; k++)
        u[k] = o->q[k] - o->p[k];
    length = arris_unit(u);
    double e[3] = {fabs(u[0]) < 0.7, fabs(u[0]) >= 0.7, 0};
    arris_cross(u, e, a), arris_unit(a), arris_cross(u, a, b);
    for (double s = 0; s <= length && n + 2 <= max; s += step)
        for (int side = 0; side < 2; side++, n++)
            for (int k = 0; k < 3; k++) {
                out[n].X[k] = o->p[k] + s * u[k];
                out[n].t[k] = side ? b[k] : a[k];
            }
    return n;
}

/* An orthonormal basis (7 columns of n) of what a similarity does to the probes; its rank. */
static int similarity_basis(const probe *at, int n, double (*basis)[POINTS]) {
    double c[3] = {0, 0, 0};
    int rank = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            c[k] += at[i].X[k] / n;
    for (int g = 0; g < 7; g++) {
        double *v = basis[rank], norm = 0, first = 0;
        for (int i = 0; i < n; i++) {
            double d[3] = {at[i].X[0] - c[0], at[i].X[1] - c[1], at[i].X[2] - c[2]}, e[3] = {0},
                   m[3];
            e[g % 3] = 1;
            if (g < 3)
                arris_cross(e, d, m);
            v[i] = arris_dot(at[i].t, g < 3 ? m : g < 6 ? e : d);
            first += v[i] * v[i];
        }
        for (int pass = 0; pass < 2; pass++)
            for (int b = 0; b < rank; b++) {
                double dot = 0;
                for (int i = 0; i < n; i++)
                    dot += v[i] * basis[b][i];
                for (int i = 0; i < n; i++)
                    v[i] -= dot * basis[b][i];
            }
        for (int i = 0; i < n; i++)
            norm += v[i] * v[i];
        if (!(norm > 1e-10 * first))
            continue;
        for (int i = 0; i < n; i++)
            v[i] /= sqrt(norm);
        rank++;
    }
    return rank;
}

static double basis[7][POINTS];
static probe probes[POINTS];
static double row[POINTS][4];
static int line_of[POINTS];

/* Of shape and depth, mm, as variances. */
typedef struct spread {
    double shape, depth;
} spread;

static spread bound_of(const scan *s) {
    adj_problem p;
    int which[EDGES], n = 0, m;
    at_truth(s, &p, which);
    double *cov = line_covariance(&p, &m);
    for (uint32_t l = 0; l < p.n_lines; l++) {
        const edge *o = &s->edge[which[l]];
        if (!o->observable)
            continue;
        int added = probe_edge(o, 5, probes + n, POINTS - n);
        for (int i = n; i < n + added; i++) {
            double d[3];
            for (int k = 0; k < 3; k++)
                d[k] = probes[i].X[k] - p.line[l].X[k];
            double w = (1 + arris_dot(d, p.line[l].u) / p.line[l].h) / 2;
            for (int k = 0; k < 4; k++)
                row[i][k] =
                    (k < 2 ? 1 - w : w) * arris_dot(probes[i].t, k % 2 ? p.line[l].b : p.line[l].a);
            line_of[i] = (int)l;
        }
        n += added;
    }
    int rank = similarity_basis(probes, n, basis);
    spread out = {0, 0};
    for (int i = 0; i < n; i++)
        for (int a = 0; a < 4; a++)
            for (int b = 0; b < 4; b++) {
                double v =
                    row[i][a] * cov[(4 * line_of[i] + a) * m + 4 * line_of[i] + b] * row[i][b];
                out.shape += v;
                out.depth += v * probes[i].t[2] * probes[i].t[2];
            }
    for (int g = 0; g < rank; g++) { /* minus what lies in the similarity */
        double *y = calloc((size_t)m, sizeof *y);
        for (int i = 0; i < n; i++)
            for (int a = 0; a < 4; a++)
                y[4 * line_of[i] + a] += basis[g][i] * row[i][a];
        for (int a = 0; a < m; a++)
            for (int b = 0; b < m; b++)
                out.shape -= y[a] * cov[a * m + b] * y[b];
        free(y);
    }
    out.shape = out.shape / (n / 2);
    out.depth = out.depth / (n / 2);
    free(cov);
    adj_free(&p);
    return out;
}

/* The distance of the probe from the line along its direction; NAN when that is not its edge. */
static double off(const probe *at, const edge *o, const arris_line *l) {
    double u[3], d[3], e[3], away = 0;
    for (int k = 0; k < 3; k++)
        u[k] = l->q[k] - l->p[k], d[k] = at->X[k] - l->p[k], e[k] = o->q[k] - o->p[k];
    double length = arris_unit(u), along = arris_dot(u, d);
    arris_unit(e);
    double turn = arris_dot(u, e), s;
    for (int k = 0; k < 3; k++)
        d[k] = l->p[k] + along * u[k] - at->X[k];
    s = -arris_dot(d, e) / turn; /* on to where the line meets the plane across the edge */
    for (int k = 0; k < 3; k++)
        d[k] += s * u[k], away += d[k] * d[k];
    if (fabs(turn) < 0.99 || along < -3 || along > length + 3 || away > 9)
        return (double)NAN;
    return arris_dot(d, at->t);
}

static spread measured_of(const scan *s, const char *path) {
    static double e[POINTS];
    arris_lines lines = {0};
    bytes text = {0};
    fault f;
    int n = 0;
    if (bytes_read(&text, path, 1 << 28, &f) ||
        input_lines((const char *)text.data, text.n, path, &lines, &f))
        die(path, f.text);
    for (int k = 0; k < s->n; k++) {
        static probe all[POINTS];
        int max = s->edge[k].observable ? probe_edge(&s->edge[k], 5, all, POINTS) : 0;
        for (int i = 0; i < max && n < POINTS; i += 2)
            for (uint32_t l = 0; l < lines.n; l++) {
                double a = off(&all[i], &s->edge[k], &lines.item[l]);
                if (lines.item[l].state != ARRIS_MEASURED || !isfinite(a))
                    continue;
                probes[n] = all[i], probes[n + 1] = all[i + 1];
                e[n] = a, e[n + 1] = off(&all[i + 1], &s->edge[k], &lines.item[l]);
                n += 2;
                break;
            }
    }
    int rank = similarity_basis(probes, n, basis);
    spread out = {0, 0};
    for (int i = 0; i < n; i++) {
        out.shape += e[i] * e[i];
        out.depth += e[i] * e[i] * probes[i].t[2] * probes[i].t[2];
    }
    for (int g = 0; g < rank; g++) {
        double dot = 0;
        for (int i = 0; i < n; i++)
            dot += basis[g][i] * e[i];
        out.shape -= dot * dot;
    }
    free(lines.item);
    free(text.data);
    out.shape /= fmax(n / 2, 1), out.depth /= fmax(n / 2, 1);
    return out;
}

static void compare(int n, char **argv) {
    static scan s;
    spread bound = {0, 0}, found = {0, 0};
    printf("shape (without scale and rigid motion) and depth, um; each beside its bound\n");
    for (int i = 0; i + 1 < n; i += 2) {
        load(&s, argv[i]);
        spread b = bound_of(&s), m = measured_of(&s, argv[i + 1]);
        printf("%-28.28s shape %6.1f, bound %6.1f   depth %6.1f, bound %6.1f\n",
               argv[i] + (strlen(argv[i]) > 28 ? strlen(argv[i]) - 28 : 0), 1e3 * sqrt(m.shape),
               1e3 * sqrt(b.shape), 1e3 * sqrt(m.depth), 1e3 * sqrt(b.depth));
        bound.shape += b.shape, bound.depth += b.depth;
        found.shape += m.shape, found.depth += m.depth;
        frames_free(&s.reported);
        frames_free(&s.truth);
    }
    printf("pooled: shape %.2f times its bound, depth %.2f times\n",
           sqrt(found.shape / bound.shape), sqrt(found.depth / bound.depth));
}

/* ---- cost ------------------------------------------------------------------------------------ */

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static double noise(void) {
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) / 4503599627370496.0 - 1;
}

/* A long sweep: line l is seen in `life` frames from l frames / lines on. */
static void sweep(adj_problem *p, uint32_t frames, uint32_t lines, uint32_t life) {
    arris_pose pose = {.valid = true};
    if (adj_init(p, frames, lines, lines * life))
        die("memory", "none");
    p->camera =
        (arris_camera){.width = 320, .height = 240, .fx = 380, .fy = 380, .cx = 160, .cy = 120};
    arris_rotation(0, 0, 0, pose.R);
    for (uint32_t i = 0; i < frames; i++) {
        pose.C[0] = 4.0 * i;
        adj_add_frame(p, &pose, i);
    }
    for (uint32_t l = 0; l < lines; l++) {
        uint32_t from = (uint32_t)((uint64_t)l * (frames - life) / lines);
        double x = 4.0 * (from + life / 2), z = 850 + 150 * noise(), y = 60 * noise();
        double P[3] = {x, y - 50, z}, Q[3] = {x + 30 * noise(), y + 50, z + 10};
        adj_add_line(p, P, Q, 250);
        for (uint32_t i = from; i < from + life; i++) {
            arris_segment s = {.cov = {4e-4, 0, 1e-6}};
            memcpy(pose.C, p->frame[i].pose.C, sizeof pose.C);
            arris_project(&p->camera, &pose, P, &s.x1, &s.y1);
            arris_project(&p->camera, &pose, Q, &s.x2, &s.y2);
            s.x1 += 0.1 * noise(), s.x2 += 0.1 * noise();
            adj_add_view(p, i, l, &s);
        }
    }
    for (int k = 0; k < 6; k++)
        p->sigma[k] = k < 3 ? 0.2 : 2e-4;
    p->robust = 4;
}

static void cost(void) {
    printf("frames  lines  solve, ms  a frame, us  marginals, ms  memory, MB\n");
    for (uint32_t frames = 250; frames <= 2000; frames *= 2) {
        adj_problem p;
        struct rusage use;
        double cov[16];
        sweep(&p, frames, frames / 4, 40);
        adj_work *w = adj_work_new(&p, &adj_cholmod);
        double t0 = seconds();
        if (!w || adj_minimise(&p, w, 20, 1e-6) < 0)
            die("sweep", "not solved");
        double t1 = seconds();
        if (adj_marginals(&p, w))
            die("sweep", "no marginals");
        for (uint32_t l = 0; l < p.n_lines; l++)
            adj_line_covariance(w, l, cov);
        double t2 = seconds();
        getrusage(RUSAGE_SELF, &use);
        printf("%6u %6u %10.1f %12.1f %14.1f %11.1f\n", frames, p.n_lines, 1e3 * (t1 - t0),
               1e6 * (t1 - t0) / frames, 1e3 * (t2 - t1), (double)use.ru_maxrss / 1024);
        adj_work_free(w);
        adj_free(&p);
    }
}

int main(int argc, char **argv) {
    if (argc > 1)
        compare(argc - 1, argv + 1);
    else
        cost();
    return 0;
}
