/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * svg.c: the views of the lines along the axes, with the cameras that saw them.
 */
#include <math.h>
#include <string.h>

#include "writers.h"

/* px; a view is a square of SIDE with its labels around it */
enum { SIDE = 420, LEFT = 58, TOP = 36, BOTTOM = 46, RIGHT = 16, LEGEND = 30 };
static const double FAR = 1e7; /* mm; what lies beyond is no part of a picture */

/* One view: the axis to the right, the one up or down, and how mm become px. */
typedef struct view {
    const char *name, *seen;
    int across, along; /* 0, 1, 2: x, y, z */
    double down;       /* 1: `along` grows downwards, -1: upwards */
    double middle[2];  /* mm */
    double scale;      /* px per mm */
    double x, y;       /* px, of the middle */
} view;

static const view views_of[] = {
    {.name = "xy", .seen = "as the camera looks", .across = 0, .along = 1, .down = 1},
    {.name = "yz", .seen = "from the side", .across = 2, .along = 1, .down = 1},
    {.name = "zx", .seen = "from above", .across = 0, .along = 2, .down = -1},
};

/* ---- the cameras ---------------------------------------------------------------------------- */

void svg_add_camera(svg_cameras *c, const arris_pose *pose) {
    if (!pose->valid || !all_finite(pose->C, 3) || !all_finite(pose->R, 9))
        return;
    if (c->n == SVG_CAMERAS) {
        c->n /= 2;
        c->every *= 2;
        for (uint32_t i = 0; i < c->n; i++)
            c->at[i] = c->at[2 * i];
    }
    c->every = c->every ? c->every : 1;
    if (c->seen++ % c->every)
        return;
    memcpy(c->at[c->n].C, pose->C, sizeof pose->C);
    memcpy(c->at[c->n++].axis, pose->R + 6, sizeof c->at->axis);
}

/* ---- the range ------------------------------------------------------------------------------ */

static bool near(const double p[3]) {
    return fabs(p[0]) < FAR && fabs(p[1]) < FAR && fabs(p[2]) < FAR;
}

static bool drawable(const arris_line *l, enum arris_line_state state) {
    return line_stands(l) && line_state(l) == state && near(l->p) && near(l->q);
}

typedef struct box {
    double low[3], high[3];
} box;

static void include(box *b, const double p[3]) {
    for (int k = 0; k < 3 && near(p); k++) {
        b->low[k] = fmin(b->low[k], p[k]);
        b->high[k] = fmax(b->high[k], p[k]);
    }
}

static void include_lines(box *b, const arris_lines *lines, enum arris_line_state state) {
    for (uint32_t i = 0; i < lines->n; i++)
        if (drawable(&lines->item[i], state)) {
            include(b, lines->item[i].p);
            include(b, lines->item[i].q);
        }
}

/* Of the measured lines and the cameras; weak lines may lie anywhere and count only without them.
 */
static box range(const arris_lines *lines, const svg_cameras *cameras) {
    box b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    include_lines(&b, lines, ARRIS_MEASURED);
    if (!(b.low[0] <= b.high[0]))
        include_lines(&b, lines, ARRIS_WEAK);
    for (uint32_t i = 0; i < cameras->n; i++)
        include(&b, cameras->at[i].C);
    if (!(b.low[0] <= b.high[0]))
        b = (box){{-1, -1, -1}, {1, 1, 1}};
    return b;
}

static void fit(view *v, const box *b) {
    double across = b->high[v->across] - b->low[v->across];
    double along = b->high[v->along] - b->low[v->along];
    v->middle[0] = b->low[v->across] + across / 2;
    v->middle[1] = b->low[v->along] + along / 2;
    v->scale = SIDE / (1.15 * fmax(fmax(across, along), 1e-3));
}

static double right_of(const view *v, const double p[3]) {
    return v->x + v->scale * (p[v->across] - v->middle[0]);
}

static double below(const view *v, const double p[3]) {
    return v->y + v->scale * v->down * (p[v->along] - v->middle[1]);
}

/* ---- drawing -------------------------------------------------------------------------------- */

/* 1, 2 or 5 times a power of ten: about six steps over the range. */
static double tick_step(double mm) {
    double power = pow(10, floor(log10(mm / 6))), m = mm / 6 / power;
    return power * (m < 1.5 ? 1 : m < 3.5 ? 2 : m < 7.5 ? 5 : 10);
}

static void tick(FILE *out, const view *v, bool upright, double mm) {
    double half = SIDE / 2., x = v->x + v->scale * (mm - v->middle[0]);
    double y = v->y + v->scale * v->down * (mm - v->middle[1]);
    if (upright)
        fprintf(out,
                "<path class=\"grid\" d=\"M%.2f %.2fv%d\"/><text x=\"%.2f\" y=\"%.2f\">%g</text>\n",
                x, v->y - half, SIDE, x, v->y + half + 16, mm);
    else
        fprintf(out,
                "<path class=\"grid\" d=\"M%.2f %.2fh%d\"/>"
                "<text class=\"left\" x=\"%.2f\" y=\"%.2f\">%g</text>\n",
                v->x - half, y, SIDE, v->x - half - 6, y + 4, mm);
}

static void axes(FILE *out, const view *v) {
    double half = SIDE / 2., step = tick_step(SIDE / v->scale);
    for (int k = 0; k < 2; k++) {
        double from = ceil((v->middle[k] - half / v->scale) / step);
        double to = floor((v->middle[k] + half / v->scale) / step);
        for (double i = from; i <= to; i++)
            tick(out, v, k == 0, i == 0 ? 0 : i * step);
    }
    fprintf(out, "<text class=\"title\" x=\"%.2f\" y=\"%.2f\">%s: %s</text>\n", v->x,
            v->y - half - 12, v->name, v->seen);
    fprintf(out, "<text x=\"%.2f\" y=\"%.2f\">%c / mm</text>\n", v->x, v->y + half + 34,
            "xyz"[v->across]);
    fprintf(out, "<text transform=\"translate(%.2f %.2f) rotate(-90)\">%c / mm</text>\n",
            v->x - half - 44, v->y, "xyz"[v->along]);
}

/* A dot where the camera stood, and a stroke the way it looked. */
static void draw_cameras(FILE *out, const view *v, const svg_cameras *cameras) {
    const double length = 12 / v->scale;
    for (uint32_t i = 0; i < cameras->n; i++) {
        const double *C = cameras->at[i].C, *d = cameras->at[i].axis;
        double to[3] = {C[0] + length * d[0], C[1] + length * d[1], C[2] + length * d[2]};
        if (near(C) && near(to))
            fprintf(out,
                    "<path class=\"camera\" d=\"M%.2f %.2fL%.2f %.2f\"/>"
                    "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"1.5\"/>\n",
                    right_of(v, C), below(v, C), right_of(v, to), below(v, to), right_of(v, C),
                    below(v, C));
    }
}

static void draw_lines(FILE *out, const view *v, const arris_lines *lines,
                       enum arris_line_state state) {
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        if (drawable(l, state))
            fprintf(out, "<path class=\"%s\" d=\"M%.2f %.2fL%.2f %.2f\"/>\n",
                    state == ARRIS_MEASURED ? "measured" : "weak", right_of(v, l->p),
                    below(v, l->p), right_of(v, l->q), below(v, l->q));
    }
}

/* 1, 2 or 5 times a power of ten: makes the greatest deviation some 30 px long, or less. */
static double magnification(const arris_verdict *verdict, double scale) {
    double most = 1e-9;
    for (uint32_t i = 0; i < verdict->n; i++)
        if (isfinite(verdict->item[i].at[0][0]) && !verdict->item[i].is_angle)
            most = fmax(most, fabs(verdict->item[i].worst));
    double m = 30 / (scale * most), power = pow(10, floor(log10(m)));
    return fmax(1, power * (m < 2 * power ? 1 : m < 5 * power ? 2 : 5));
}

static void draw_features(FILE *out, const view *v, const arris_verdict *verdict) {
    double m = magnification(verdict, v->scale);
    for (uint32_t i = 0; i < verdict->n; i++) {
        const arris_feature *f = &verdict->item[i];
        if (!near(f->p) || !near(f->q))
            continue;
        fprintf(out, "<path class=\"edge %s\" d=\"M%.2f %.2fL%.2f %.2f\"/>\n",
                judgement_name(f->verdict), right_of(v, f->p), below(v, f->p), right_of(v, f->q),
                below(v, f->q));
        for (int k = 0; k < 2; k++) {
            double d[3], to[3], on[3], s = 0, length = 0;
            for (int n = 0; n < 3; n++)
                d[n] = f->q[n] - f->p[n];
            for (int n = 0; n < 3; n++) {
                s += (f->at[k][n] - f->p[n]) * d[n];
                length += d[n] * d[n];
            }
            for (int n = 0; n < 3; n++) {
                on[n] = f->p[n] + s / length * d[n];
                to[n] = on[n] + m * (f->at[k][n] - on[n]);
            }
            if (near(to))
                fprintf(out, "<path class=\"edge %s\" d=\"M%.2f %.2fL%.2f %.2f\"/>\n",
                        judgement_name(f->verdict), right_of(v, on), below(v, on), right_of(v, to),
                        below(v, to));
        }
    }
    fprintf(out, "<text class=\"key\" x=\"%.2f\" y=\"%.2f\">deviations &#215;%g</text>\n",
            v->x - SIDE / 2. + 6, v->y + SIDE / 2. - 8, m);
}

/* Everything is cut off at the frame of the view. */
static void draw_view(FILE *out, const view *v, const arris_lines *lines,
                      const svg_cameras *cameras, const arris_verdict *verdict) {
    double left = v->x - SIDE / 2., top = v->y - SIDE / 2.;
    axes(out, v);
    fprintf(out,
            "<svg x=\"%.2f\" y=\"%.2f\" width=\"%d\" height=\"%d\" viewBox=\"%.2f %.2f %d %d\">\n",
            left, top, SIDE, SIDE, left, top, SIDE, SIDE);
    draw_cameras(out, v, cameras);
    draw_lines(out, v, lines, ARRIS_WEAK);
    draw_lines(out, v, lines, ARRIS_MEASURED);
    if (verdict)
        draw_features(out, v, verdict);
    fprintf(out, "</svg>\n<rect x=\"%.2f\" y=\"%.2f\" width=\"%d\" height=\"%d\"/>\n", left, top,
            SIDE, SIDE);
}

static uint32_t count(const arris_lines *lines, enum arris_line_state state) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < lines->n; i++)
        n += line_stands(&lines->item[i]) && line_state(&lines->item[i]) == state;
    return n;
}

static void legend(FILE *out, const arris_lines *lines, const svg_cameras *cameras, int y) {
    fprintf(out,
            "<g transform=\"translate(%d %d)\">"
            "<path class=\"measured\" d=\"M0 0h24\"/><text class=\"key\" x=\"32\" y=\"4\">"
            "%u measured</text>"
            "<circle cx=\"114\" r=\"1.5\"/><text class=\"key\" x=\"122\" y=\"4\">%u cameras</text>"
            "<path class=\"weak\" d=\"M198 0h24\"/><text class=\"key\" x=\"230\" y=\"4\">"
            "%u weak (%u unobservable hidden)</text></g>\n",
            LEFT, y, count(lines, ARRIS_MEASURED), cameras->seen, count(lines, ARRIS_WEAK),
            count(lines, ARRIS_UNOBSERVABLE));
}

static const char style[] =
    "<style>text{font:11px sans-serif;fill:#444;text-anchor:middle}.left{text-anchor:end}"
    ".key{text-anchor:start}.title{font-size:13px;font-weight:bold}"
    "path,rect{fill:none}rect{stroke:#888}.grid{stroke:#e4e4e4}.paper{fill:#fff;stroke:none}"
    ".measured{stroke:#111;stroke-width:2;stroke-linecap:round}"
    ".edge{stroke-width:1.5}.edge.PASS{stroke:#2b7a3d}.edge.FAIL{stroke:#e0342b}"
    ".edge.INDETERMINATE{stroke:#d79a1e}"
    ".weak{stroke:#b0562c;stroke-width:.8;stroke-dasharray:4 3}"
    ".camera{stroke:#2b6cb0;stroke-width:.6}circle{fill:#2b6cb0}</style>\n";

void svg_write(FILE *out, const arris_lines *lines, const svg_cameras *cameras,
               const arris_verdict *verdict, enum svg_views which) {
    const int n = which == SVG_ALL ? 3 : 1, pitch = LEFT + SIDE + RIGHT;
    const int height = TOP + SIDE + BOTTOM + LEGEND;
    const box b = range(lines, cameras);
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "viewBox=\"0 0 %d %d\">\n%s<rect class=\"paper\" width=\"%d\" height=\"%d\"/>\n",
            n * pitch, height, n * pitch, height, style, n * pitch, height);
    for (int i = 0; i < n; i++) {
        view v = views_of[which == SVG_ALL ? i : (int)which - SVG_XY];
        v.x = i * pitch + LEFT + SIDE / 2.;
        v.y = TOP + SIDE / 2.;
        fit(&v, &b);
        draw_view(out, &v, lines, cameras, verdict);
    }
    legend(out, lines, cameras, height - 16);
    fprintf(out, "</svg>\n");
}
