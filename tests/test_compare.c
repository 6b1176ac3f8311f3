/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_compare.c: nominal edges from files, which line measured which, the alignment, the
 * judgement, by known geometry and known noise.
 */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "arris_geometry.h"
#include "chance.h"
#include "compare/align.h"
#include "compare/derive.h"
#include "compare/judge.h"
#include "compare/sight.h"
#include "scratch.h"

static const double RAD = M_PI / 180;

/* ---- a box, as files and as lines ------------------------------------------------------------ */

static const double corner_of[8][3] = {{0, 0, 0},  {200, 0, 0},  {200, 100, 0},  {0, 100, 0},
                                       {0, 0, 50}, {200, 0, 50}, {200, 100, 50}, {0, 100, 50}};
/* Outward by the right hand. */
static const int face_of[6][4] = {{3, 2, 1, 0}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                  {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

/* An OBJ whose faces are cut into n x n quads, each corner a vertex of its own. */
static const char *box_obj(const char *name, int n) {
    FILE *f = fopen(scratch(name), "w");
    assert_non_null(f);
    for (int i = 0; i < 6; i++) {
        const double *c[4];
        for (int k = 0; k < 4; k++)
            c[k] = corner_of[face_of[i][k]];
        for (int q = 0; q < n * n; q++) {
            double at[4][2] = {
                {q % n, q / n}, {q % n + 1, q / n}, {q % n + 1, q / n + 1}, {q % n, q / n + 1}};
            for (int k = 0; k < 4; k++) {
                double s = at[k][0] / n, t = at[k][1] / n, v[3];
                for (int d = 0; d < 3; d++)
                    v[d] = c[0][d] + s * (c[1][d] - c[0][d]) + t * (c[3][d] - c[0][d]);
                fprintf(f, "v %.6f %.6f %.6f\n", v[0], v[1], v[2]);
            }
            fprintf(f, "f -4 -3 -2 -1\n");
        }
    }
    fclose(f);
    return scratch(name);
}

static nominal read_good(const char *path, double crease, double min_length) {
    nominal m;
    fault f = {.hint = NULL};
    if (nominal_read(&m, path, crease * RAD, min_length, &f))
        fail_msg("%s: %s", path, f.text);
    return m;
}

static double length_of(const nominal_edge *e) {
    return hypot(hypot(e->q[0] - e->p[0], e->q[1] - e->p[1]), e->q[2] - e->p[2]);
}

/* ---- files ----------------------------------------------------------------------------------- */

static void a_box_has_twelve_edges(void **state) {
    (void)state;
    for (int n = 1; n <= 7; n += 3) { /* however its faces are cut */
        nominal m = read_good(box_obj("box.obj", n), 25, 0);
        double sum = 0;
        assert_int_equal(m.n_edges, 12);
        for (int i = 0; i < 12; i++) {
            const nominal_edge *e = &m.edge[i];
            double d[3], middle[3];
            sum += length_of(e);
            for (int k = 0; k < 3; k++) {
                middle[k] = (e->p[k] + e->q[k]) / 2 - (double[]){100, 50, 25}[k];
                d[k] = e->q[k] - e->p[k];
            }
            assert_true(fabs(arris_dot(d, e->normal)) < 1e-6);
            assert_true(arris_dot(middle, e->normal) > 10); /* outwards */
            assert_true(fabs(arris_dot(e->normal, e->normal) - 1) < 1e-9);
        }
        assert_true(fabs(sum - 4 * 350) < 1e-3);
        nominal_free(&m);
        m = read_good(scratch("box.obj"), 25, 60);
        assert_int_equal(m.n_edges, 8);
        nominal_free(&m);
        m = read_good(scratch("box.obj"), 89, 0);
        assert_int_equal(m.n_edges, 12);
        nominal_free(&m);
    }
    fault f;
    nominal m;
    assert_int_equal(nominal_read(&m, scratch("box.obj"), 91 * RAD, 0, &f), ARRIS_E_INPUT);
    assert_non_null(strstr(f.text, "there is no edge in it"));
    nominal_free(&m);
}

/* A cylinder of 36 facets: its rims are edges, but short ones, and its side has none. */
static void a_cylinder_has_no_straight_edge(void **state) {
    (void)state;
    FILE *f = fopen(scratch("cylinder.obj"), "w");
    for (int i = 0; i < 36; i++)
        for (int k = 0; k < 2; k++)
            fprintf(f, "v %.6f %.6f %d\n", 50 * cos(i * 10 * RAD), 50 * sin(i * 10 * RAD), 80 * k);
    for (int i = 0; i < 36; i++)
        fprintf(f, "f %d %d %d %d\n", 2 * i + 1, (2 * i + 2) % 72 + 1, (2 * i + 3) % 72 + 1,
                2 * i + 2);
    fclose(f);
    nominal m = read_good(scratch("cylinder.obj"), 25, 0);
    assert_int_equal(m.n_edges, 72);
    nominal_free(&m);
    m = read_good(scratch("cylinder.obj"), 5, 15);
    assert_int_equal(m.n_edges, 36);
    nominal_free(&m);
    fault why;
    assert_int_equal(nominal_read(&m, scratch("cylinder.obj"), 25 * RAD, 15, &why), ARRIS_E_INPUT);
    nominal_free(&m);
}

static void put_triangle(FILE *f, const float v[9]) {
    static const float normal[3];
    static const uint16_t attribute;
    fwrite(normal, sizeof normal, 1, f);
    fwrite(v, 9 * sizeof *v, 1, f);
    fwrite(&attribute, sizeof attribute, 1, f);
}

/* A plate of 200 by 100 mm in 2 n² triangles, and some without area. */
static const char *plate_stl(int n, int degenerate) {
    FILE *f = fopen(scratch("plate.stl"), "wb");
    static const char head[80] = "a plate";
    uint32_t count = (uint32_t)(2 * n * n + degenerate);
    fwrite(head, sizeof head, 1, f);
    fwrite(&count, sizeof count, 1, f);
    for (int i = 0; i < n * n; i++) {
        float x = 200.F * (float)(i % n) / (float)n, y = 100.F * (float)(i / n) / (float)n;
        float X = 200.F * (float)(i % n + 1) / (float)n, Y = 100.F * (float)(i / n + 1) / (float)n;
        put_triangle(f, (float[]){x, y, 7, X, y, 7, X, Y, 7});
        put_triangle(f, (float[]){x, y, 7, X, Y, 7, x, Y, 7});
    }
    for (int i = 0; i < degenerate; i++)
        put_triangle(f, i % 3 == 0   ? (float[]){9, 9, 7, 9, 9, 7, 9, 9, 7}
                        : i % 3 == 1 ? (float[]){0, 0, 7, 100, 50, 7, 200, 100, 7}
                                     : (float[]){NAN, 0, 7, 100, INFINITY, 7, 200, 100, 7});
    fclose(f);
    return scratch("plate.stl");
}

static void an_stl_may_be_degenerate_or_huge(void **state) {
    (void)state;
    nominal m = read_good(plate_stl(10, 30), 25, 15);
    assert_int_equal(m.n_edges, 4);
    nominal_free(&m);
    m = read_good(plate_stl(708, 0), 25, 15); /* a million triangles */
    assert_int_equal(m.n_edges, 4);
    assert_true(m.n_triangles > 1000000);
    nominal_free(&m);
}

/* The same edges from a DXF, whose axes assimp turns, as from the OBJ. */
static void a_dxf_stays_upright(void **state) {
    (void)state;
    FILE *f = fopen(scratch("box.dxf"), "w");
    fprintf(f, "0\nSECTION\n2\nENTITIES\n");
    fprintf(f, "0\nLINE\n8\n0\n10\n1\n20\n2\n30\n3\n11\n101\n21\n52\n31\n33\n");
    fprintf(f, "0\nENDSEC\n0\nEOF\n");
    fclose(f);
    nominal m = read_good(scratch("box.dxf"), 25, 15);
    assert_int_equal(m.n_edges, 1);
    const double *p = m.edge[0].p, *q = m.edge[0].q;
    bool turned = p[0] > q[0];
    for (int k = 0; k < 3; k++) {
        assert_true(fabs((turned ? q : p)[k] - (double[]){1, 2, 3}[k]) < 1e-3);
        assert_true(fabs((turned ? p : q)[k] - (double[]){101, 52, 33}[k]) < 1e-3);
    }
    nominal_free(&m);
}

static void a_list_of_edges(void **state) {
    (void)state;
    nominal m = read_good(
        scratch_write("a.json",
                      "{\"unit\": \"mm\", \"lines\": [{\"id\": \"a\", \"p\": [0,0,0], \"q\": "
                      "[100,0,0], \"normal\": [0,0,-2], \"tolerance\": 0.5}, {\"id\": \"paint\", "
                      "\"p\": [0,8,0], \"q\": [100,8,0], \"in_cad\": false}, {\"id\": \"short\", "
                      "\"p\": [0,0,0], \"q\": [0,1,0]}]}"),
        25, 15);
    assert_int_equal(m.n_edges, 2);
    assert_string_equal(m.edge[0].id, "a");
    assert_true(m.edge[0].tolerance == 0.5 && m.edge[0].normal[2] == -1 && !m.edge[0].mark);
    assert_true(m.edge[1].mark);
    nominal_free(&m);
}

static void bad_models_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *name, *text, *says;
    } bad[] = {
        {"none.json", NULL, "cannot open"},
        {"none.obj", NULL, "cannot open"},
        {"a.json", "", ":1:"},
        {"a.json", "{\"unit\": \"mm\"}", "there are no \"lines\""},
        {"a.json", "{\"unit\": \"inch\", \"lines\": []}", "the unit is 'inch', not mm"},
        {"a.json", "{\"lines\": []}", "the unit is missing"},
        {"a.json", "{\"unit\": \"mm\", \"lines\": []}", "there is no edge in it"},
        {"a.json", "{\"unit\": \"mm\", \"lines\": [{\"p\": [0,0,0], \"q\": [1,0,0]}]}", "no id"},
        {"a.json", "{\"unit\": \"mm\", \"lines\": [{\"id\": \"a\", \"p\": [0,0], \"q\": [1,0,0]}]}",
         "no ends"},
        {"a.json",
         "{\"unit\": \"mm\", \"lines\": [{\"id\": \"a\", \"p\": [0,0,0], \"q\": [0,0,0]}]}",
         "are one point"},
        {"a.json",
         "{\"unit\": \"mm\", \"lines\": [{\"id\": \"a\", \"p\": [0,0,0], \"q\": [90,0,0], "
         "\"tolerance\": 0}]}",
         "no number above 0"},
        {"a.json",
         "{\"unit\": \"mm\", \"lines\": [{\"id\": \"a\", \"p\": [0,0,0], \"q\": [90,0,0]}, "
         "{\"id\": "
         "\"a\", \"p\": [0,0,0], \"q\": [0,90,0]}]}",
         "two lines are called 'a'"},
        {"a.obj", "", "a.obj"},
        {"a.stl", "", "cannot read"},
        {"a.stl", "solid nothing\nendsolid nothing\n", "a.stl"},
        {"a.ply", "ply\nformat ascii 1.0\nelement vertex 99999999\n", "a.ply"},
        {"a.txt", "edges", "cannot read"},
        {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "there is no edge in it"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        nominal m;
        fault f = {.hint = NULL};
        const char *path =
            bad[i].text ? scratch_write(bad[i].name, "%s", bad[i].text) : scratch(bad[i].name);
        int r = nominal_read(&m, path, 25 * RAD, 15, &f);
        if (r >= 0 || !strstr(f.text, bad[i].says))
            fail_msg("%s '%s': %d, says '%s', not '%s'", bad[i].name, bad[i].text, r, f.text,
                     bad[i].says);
        nominal_free(&m);
    }
}

/* ---- noise and lines ------------------------------------------------------------------------- */

/* Deep is uncertain, as it is under a moving camera: sigma of x and y, of z, and along the line. */
static const double SIGMA[3] = {0.05, 0.05, 0.2}, END = 2;

/* A line from p to q, measured with noise and the covariance that is true of it. */
static arris_line measured(int id, const double p[3], const double q[3], bool noisy) {
    arris_line l = {.id = id, .state = ARRIS_MEASURED, .into = -1};
    double u[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    arris_unit(u);
    double *ends[2] = {l.p, l.q}, full[6][6] = {{0}};
    for (int k = 0; k < 2; k++) {
        double along = noisy ? END * normal() : 0;
        for (int i = 0; i < 3; i++) {
            ends[k][i] = (k ? q : p)[i] + along * u[i] + (noisy ? SIGMA[i] * normal() : 0);
            for (int j = 0; j < 3; j++)
                full[3 * k + i][3 * k + j] =
                    END * END * u[i] * u[j] + (i == j) * SIGMA[i] * SIGMA[i];
        }
    }
    for (int i = 0, n = 0; i < 6; i++)
        for (int j = i; j < 6; j++)
            l.cov[n++] = full[i][j];
    return l;
}

typedef struct room {
    piece e[64];
    candidates c[64];
    int32_t owner[64];
    arris_line item[64];
    arris_lines lines;
} room;

static room *room_new(void) {
    room *r = calloc(1, sizeof *r);
    r->lines = (arris_lines){.max = 64, .item = r->item};
    return r;
}

static void lay_all(room *r, const nominal *m, const place *w) {
    for (uint32_t i = 0; i < m->n_edges; i++)
        piece_place(&r->e[i], &m->edge[i], w);
}

/* ---- which is which -------------------------------------------------------------------------- */

/* Every edge's own line is found in any order, next to decoys that are farther, turned, too short
 * or no results; no line has two edges. */
static void edges_find_their_lines(void **state) {
    (void)state;
    nominal m = read_good(box_obj("box.obj", 1), 25, 0);
    place w;
    room *r = room_new();
    place_identity(&w, &m);
    for (int i = 0; i < 12; i++) {
        const nominal_edge *e = &m.edge[i];
        double p[3], q[3], turned[3], near[3];
        for (int k = 0; k < 3; k++) {
            p[k] = e->p[k] + 1 * e->normal[k];
            q[k] = e->q[k] + 1 * e->normal[k];
            near[k] = e->p[k] + 0.1 * (e->q[k] - e->p[k]);
            turned[k] = e->q[k] + 0.3 * length_of(e) * e->normal[k];
        }
        r->item[r->lines.n++] = measured(100 + i, e->p, turned, false);
        r->item[r->lines.n++] = measured(i, q, p, false);
        r->item[r->lines.n++] = measured(200 + i, e->p, near, false);
        r->item[r->lines.n] = measured(300 + i, e->p, e->q, false);
        r->item[r->lines.n++].state = ARRIS_WEAK;
    }
    lay_all(r, &m, &w);
    match(r->e, 12, &r->lines, 15, r->c, r->owner);
    for (int i = 0; i < 12; i++) {
        assert_in_range(r->e[i].line, 0, 47);
        assert_int_equal(r->item[r->e[i].line].id, i);
        assert_true(r->e[i].outward);
        for (int k = 0; k < 2; k++) {
            assert_true(fabs(r->e[i].d[2 * k] - 1) < 1e-6);
            assert_true(fabs(r->e[i].d[2 * k + 1]) < 1e-6);
        }
    }
    nominal_free(&m);
    free(r);
}

/* Two nominal edges, one line between them, nearer to the second: the first has none. With its
 * paint 8 mm inside, a lowered edge is still found by its own line. */
static void a_line_has_one_edge(void **state) {
    (void)state;
    room *r = room_new();
    nominal_edge edges[2] = {{.id = "a", .p = {0, 0, 0}, .q = {100, 0, 0}},
                             {.id = "b", .p = {0, 6, 0}, .q = {100, 6, 0}}};
    nominal m = {.n_edges = 2, .edge = edges};
    place w;
    place_identity(&w, &m);
    r->item[r->lines.n++] = measured(7, (double[]){0, 4, 0}, (double[]){100, 4, 0}, false);
    lay_all(r, &m, &w);
    match(r->e, 2, &r->lines, 15, r->c, r->owner);
    assert_true(r->e[0].line == -1 && r->e[1].line == 0 && r->owner[0] == 1);
    m.n_edges = 1;
    r->item[0] = measured(1, (double[]){0, 8, -12}, (double[]){100, 8, -12}, false);
    r->item[r->lines.n++] = measured(2, (double[]){0, 0, -12}, (double[]){100, 0, -12}, false);
    lay_all(r, &m, &w);
    match(r->e, 1, &r->lines, 15, r->c, r->owner);
    assert_int_equal(r->e[0].line, 1);
    match(r->e, 1, &r->lines, 11, r->c, r->owner);
    assert_int_equal(r->e[0].line, -1);
    free(r);
}

/* ---- the alignment --------------------------------------------------------------------------- */

/* The box stands elsewhere, turned; one edge of it is off by 9 mm. The motion is found by the
 * others, over 300 measurements with a covariance that is true: so are the edges' deviations. */
static void a_part_is_found_where_it_lies(void **state) {
    (void)state;
    nominal m = read_good(box_obj("box.obj", 1), 25, 0);
    place truth, w;
    double nees = 0, worst = 0;
    int n = 0;
    place_identity(&truth, &m);
    arris_rotation(0.01, -0.015, 0.02, truth.R);
    memcpy(truth.t, (double[]){3, -4, 2}, sizeof truth.t);
    for (int run = 0; run < 300; run++) {
        room *r = room_new();
        for (int i = 0; i < 12; i++) {
            double p[3], q[3];
            place_point(&truth, m.edge[i].p, p);
            place_point(&truth, m.edge[i].q, q);
            for (int k = 0; k < 3 && i == 4; k++) {
                p[k] += 9 * m.edge[i].normal[k];
                q[k] += 9 * m.edge[i].normal[k];
            }
            r->item[r->lines.n++] = measured(i, p, q, true);
        }
        place_identity(&w, &m);
        lay_all(r, &m, &w);
        assert_int_equal(align(&w, &m, r->e, NULL, &r->lines, 25, r->c, r->owner), 12);
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(w.t[k] - truth.t[k]));
        for (int i = 0; i < 12; i++) {
            arris_feature f = {0};
            assert_int_equal(r->e[i].line, i);
            align_spread(&w, &r->e[i]);
            judge_piece(&r->e[i], 2, 3, &f);
            assert_true((i == 4) == (f.verdict == ARRIS_FAIL));
            if (i == 4) {
                assert_true(fabs(f.deviation - 9) < 1);
                continue;
            }
            for (int k = 0; k < 4; k++)
                nees += r->e[i].d[k] * r->e[i].d[k] / r->e[i].cov[k][k];
            n += 4;
        }
        free(r);
    }
    assert_true(worst < 0.4);
    nees /= n;
    if (!(nees > 0.85 && nees < 1.15))
        fail_msg("the deviations' normalised squares are %.2f", nees);
    nominal_free(&m);
}

/* Three parallel edges leave the motion along them open: it is not made, and its variance is great,
 * so that an edge across them cannot pass. */
static void what_the_datum_leaves_open_is_uncertain(void **state) {
    (void)state;
    nominal m = read_good(box_obj("box.obj", 1), 25, 0);
    place w;
    room *r = room_new();
    bool use[12] = {false};
    int across = -1;
    for (int i = 0; i < 12; i++) {
        use[i] = fabs(m.edge[i].p[0] - m.edge[i].q[0]) > 1;
        across = fabs(m.edge[i].p[1] - m.edge[i].q[1]) > 1 ? i : across;
        r->item[r->lines.n++] = measured(i, m.edge[i].p, m.edge[i].q, true);
    }
    place_identity(&w, &m);
    lay_all(r, &m, &w);
    assert_int_equal(align(&w, &m, r->e, use, &r->lines, 15, r->c, r->owner), 4);
    assert_true(fabs(w.t[0]) < 0.5);
    arris_feature f = {0};
    align_spread(&w, &r->e[across]);
    judge_piece(&r->e[across], 2, 3, &f);
    assert_true(f.verdict == ARRIS_INDETERMINATE && isfinite(f.U));
    for (int i = 0; i < 12; i++)
        if (use[i]) {
            align_spread(&w, &r->e[i]);
            judge_piece(&r->e[i], 2, 3, &f);
            assert_int_equal(f.verdict, ARRIS_PASS);
        }
    nominal_free(&m);
    free(r);
}

/* ---- the judgement --------------------------------------------------------------------------- */

static void the_rule_of_iso_14253(void **state) {
    (void)state;
    assert_int_equal(judge(0.12, 0.08, 1), ARRIS_PASS);
    assert_int_equal(judge(-0.9, 0.1, 1), ARRIS_PASS);
    assert_int_equal(judge(-0.95, 0.1, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge(1.05, 0.1, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge(1.11, 0.1, 1), ARRIS_FAIL);
    assert_int_equal(judge(0, 2, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge(NAN, 0.1, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge(0.1, NAN, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge(INFINITY, INFINITY, 1), ARRIS_INDETERMINATE);
    assert_int_equal(judge_both(ARRIS_PASS, ARRIS_PASS), ARRIS_PASS);
    assert_int_equal(judge_both(ARRIS_PASS, ARRIS_INDETERMINATE), ARRIS_INDETERMINATE);
    assert_int_equal(judge_both(ARRIS_INDETERMINATE, ARRIS_FAIL), ARRIS_FAIL);
}

/* U = 2 u holds the true deviation in 95 % of 4,000 measurements; no edge that is off passes. */
static void the_uncertainty_holds(void **state) {
    (void)state;
    int inside = 0, wrong = 0;
    enum { RUNS = 4000 };
    room *r = room_new();
    for (int i = 0; i < RUNS; i++) {
        double off = 3 * uniform(), angle = 2 * M_PI * uniform();
        nominal_edge e = {.id = "a",
                          .p = {0, off * cos(angle), off * sin(angle)},
                          .q = {150, off * cos(angle), off * sin(angle)}};
        nominal m = {.n_edges = 1, .edge = &e};
        place w;
        arris_feature f = {0};
        r->lines.n = 1;
        r->item[0] = measured(0, (double[]){-5, 0, 0}, (double[]){140, 0, 0}, true);
        place_identity(&w, &m);
        lay_all(r, &m, &w);
        match(r->e, 1, &r->lines, 15, r->c, r->owner);
        assert_int_equal(r->e[0].line, 0);
        judge_piece(&r->e[0], 2, 1.5, &f);
        inside += fabs(f.deviation - off) <= f.U;
        wrong += (f.verdict == ARRIS_PASS && off > 1.5) || (f.verdict == ARRIS_FAIL && off <= 1.5);
    }
    if (inside < 0.93 * RUNS || inside > 0.97 * RUNS || wrong > 0.01 * RUNS)
        fail_msg("inside U %d, wrong %d of %d", inside, wrong, RUNS);
    free(r);
}

/* The mean of a tilted edge is good, its end is not: it does not pass. */
static void the_worst_point_counts(void **state) {
    (void)state;
    nominal_edge e = {.id = "a", .p = {0, 0, 0}, .q = {100, 0, 0}, .normal = {0, 0, 1}};
    nominal m = {.n_edges = 1, .edge = &e};
    place w;
    room *r = room_new();
    arris_feature f = {0};
    place_identity(&w, &m);
    r->item[r->lines.n++] = measured(0, (double[]){0, 0, -4}, (double[]){100, 0, 4}, false);
    lay_all(r, &m, &w);
    match(r->e, 1, &r->lines, 15, r->c, r->owner);
    judge_piece(&r->e[0], 2, 2, &f);
    assert_true(fabs(f.deviation) < 1e-9 && fabs(fabs(f.worst) - 4) < 1e-9);
    assert_int_equal(f.verdict, ARRIS_FAIL);
    free(r);
}

/* A wrong focal length moves depths: at 1 m, 0.1 % of it is 1 mm along the axis and nothing across.
 */
static void the_calibration_is_part_of_it(void **state) {
    (void)state;
    nominal_edge deep = {.id = "a", .p = {0, 0, 1000}, .q = {100, 0, 1000}, .normal = {0, 0, -1}};
    place w = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .size = 1};
    calibration c = {.focal = 0.001, .centre = {0, 2e-4}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    piece e = {0};
    piece_place(&e, &deep, &w);
    e.to = e.length;
    calibration_spread(&c, &e);
    assert_true(fabs(e.cov[0][0] - 1) < 1e-9 && fabs(e.cov[0][2] - 1) < 1e-9);
    assert_true(fabs(e.cov[1][1] - 0.04) < 1e-9 && fabs(e.cov[0][1]) < 1e-9);
    fault f;
    const char *path = scratch_write(
        "camera.json", "{\"width\":320,\"height\":240,\"fx\":400,\"fy\":400,\"skew\":0,\"cx\":160,"
                       "\"cy\":120,\"k1\":0,\"k2\":0,\"p1\":0,\"p2\":0,\"k3\":0,\"calibration\":"
                       "{\"sigma\":{\"fx\":0.4,\"fy\":0.2,\"cx\":0.8,\"cy\":1.2}}}");
    assert_int_equal(calibration_read(&c, path, &f), 0);
    assert_true(fabs(c.focal - 0.001) < 1e-12 && fabs(c.centre[1] - 0.003) < 1e-12);
    path = scratch_write(
        "camera.json", "{\"width\":320,\"height\":240,\"fx\":400,\"fy\":400,\"skew\":0,\"cx\":160,"
                       "\"cy\":120,\"k1\":0,\"k2\":0,\"p1\":0,\"p2\":0,\"k3\":0}");
    assert_int_equal(calibration_read(&c, path, &f), ARRIS_E_INPUT);
}

/* ---- derived features ------------------------------------------------------------------------ */

static void distances_angles_corners(void **state) {
    (void)state;
    nominal_edge edges[3] = {{.id = "a", .p = {0, 0, 0}, .q = {100, 0, 0}},
                             {.id = "b", .p = {0, 60, 0}, .q = {100, 60, 0}},
                             {.id = "c", .p = {0, 0, 0}, .q = {0, 60, 0}}};
    nominal m = {.n_edges = 3, .edge = edges};
    derived d[DERIVED_MAX];
    fault f;
    assert_int_equal(derived_parse("distance(a,b)=59:0.4; angle(a,c):0.5 corner(a,c)", &m, d, &f),
                     3);
    assert_true(d[0].nominal == 59 && d[0].tolerance == 0.4 && d[2].tolerance == 0);
    assert_true(fabs(d[1].nominal - M_PI / 2) < 1e-9 && fabs(d[1].tolerance - 0.5 * RAD) < 1e-12);
    double sum[3] = {0}, squares[3] = {0}, stated[3] = {0};
    enum { RUNS = 2000 };
    room *r = room_new();
    place w;
    calibration c = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    place_identity(&w, &m);
    for (int run = 0; run < RUNS; run++) {
        r->lines.n = 3;
        for (int i = 0; i < 3; i++)
            r->item[i] = measured(i, edges[i].p, edges[i].q, true);
        lay_all(r, &m, &w);
        match(r->e, 3, &r->lines, 15, r->c, r->owner);
        for (int i = 0; i < 3; i++) {
            arris_feature got = {0};
            derived_judge(&d[i], &m, &w, &c, r->e, &r->lines, 2, 1, &got);
            sum[i] += got.deviation;
            squares[i] += got.deviation * got.deviation;
            stated[i] += got.U * got.U / 4;
        }
    }
    assert_true(fabs(sum[0] / RUNS - 1) < 0.02); /* 60, not 59 */
    assert_true(fabs(sum[1] / RUNS) < 0.1 * RAD);
    for (int i = 0; i < 3; i++) {
        double mean = i == 2 ? 0 : sum[i] / RUNS; /* a corner's is a distance */
        double ratio = (squares[i] / RUNS - mean * mean) / (stated[i] / RUNS);
        if (i < 2 ? fabs(ratio - 1) > 0.15 : ratio < 0.8 || ratio > 2.5)
            fail_msg("derived %d: variance %.2f of the stated", i, ratio);
    }
    free(r);
}

static void wrong_words_are_refused(void **state) {
    (void)state;
    nominal_edge edges[2] = {{.id = "a", .p = {0, 0, 0}, .q = {100, 0, 0}},
                             {.id = "b", .p = {0, 60, 0}, .q = {50, 160, 0}}};
    nominal m = {.n_edges = 2, .edge = edges};
    static const char *const bad[] = {
        "distance(a,b)", "distance(a,a)",  "angle(a,b)",    "angle(a,x):1",  "corner(a)",
        "corner(a,b",    "angle(a,b):-1",  "angle(a,b):1x", "distanse(a,b)", "angle(a,b)=x:1",
        "corner a,b",    "angle(a,b):nan", "corner)a,b("};
    derived d[DERIVED_MAX];
    fault f;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (derived_parse(bad[i], &m, d, &f) != ARRIS_E_USAGE)
            fail_msg("'%s' is taken", bad[i]);
    assert_int_equal(derived_parse(" ; ", &m, d, &f), 0);
}

/* ---- what the path can see ------------------------------------------------------------------- */

/* From above, 600 mm up, moving along x: of the box (its top is z = 0) the bottom's far edges are
 * hidden, and the edges along x are not to be measured. */
static void a_box_hides_its_bottom(void **state) {
    (void)state;
    nominal m = read_good(box_obj("box.obj", 1), 25, 0);
    arris_camera c = {.width = 320, .height = 240, .fx = 380, .fy = 380, .cx = 159.5, .cy = 119.5};
    sight s = {0};
    place w;
    room *r = room_new();
    uint32_t seen[12];
    for (int i = 0; i < 500; i++) {
        arris_pose pose = {.valid = true, .C = {100 + 0.4 * (i - 250), 50, -600}};
        arris_rotation(0, 0, 0, pose.R);
        sight_add(&s, &pose);
    }
    assert_in_range(s.n, SIGHT_POSES / 2, SIGHT_POSES);
    place_identity(&w, &m);
    lay_all(r, &m, &w);
    assert_int_equal(sight_count(&s, &c, &m, &w, r->e, seen), 0);
    for (int i = 0; i < 12; i++) {
        const nominal_edge *e = &m.edge[i];
        bool top = e->p[2] < 1 && e->q[2]<1, bottom = e->p[2]> 49 && e->q[2] > 49;
        bool along = fabs(e->p[0] - e->q[0]) > 1, upright = !top && !bottom;
        if (top)
            assert_int_equal(seen[i], s.n);
        if (bottom && along)
            assert_int_equal(seen[i], 0);
        if (!upright)
            assert_true((sight_swing(&s, &r->e[i]) < 0.02) == along);
    }
    nominal_free(&m);
    free(r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_box_has_twelve_edges),
        cmocka_unit_test(a_cylinder_has_no_straight_edge),
        cmocka_unit_test(an_stl_may_be_degenerate_or_huge),
        cmocka_unit_test(a_dxf_stays_upright),
        cmocka_unit_test(a_list_of_edges),
        cmocka_unit_test(bad_models_are_refused),
        cmocka_unit_test(edges_find_their_lines),
        cmocka_unit_test(a_line_has_one_edge),
        cmocka_unit_test(a_part_is_found_where_it_lies),
        cmocka_unit_test(what_the_datum_leaves_open_is_uncertain),
        cmocka_unit_test(the_rule_of_iso_14253),
        cmocka_unit_test(the_uncertainty_holds),
        cmocka_unit_test(the_worst_point_counts),
        cmocka_unit_test(the_calibration_is_part_of_it),
        cmocka_unit_test(distances_angles_corners),
        cmocka_unit_test(wrong_words_are_refused),
        cmocka_unit_test(a_box_hides_its_bottom),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
