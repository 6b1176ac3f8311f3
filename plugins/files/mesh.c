/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mesh.c: the measured lines for CAD and mesh programs: PLY, OBJ and DXF R12. Millimetres.
 */
#include "writers.h"

/* The next measured line from *i on, NULL after the last; *i then is the one after it. */
static const arris_line *next(const arris_lines *lines, uint32_t *i) {
    while (*i < lines->n) {
        const arris_line *l = &lines->item[(*i)++];
        if (line_stands(l) && line_state(l) == ARRIS_MEASURED)
            return l;
    }
    return NULL;
}

static uint32_t count(const arris_lines *lines) {
    uint32_t n = 0;
    for (uint32_t i = 0; next(lines, &i);)
        n++;
    return n;
}

static void vertices(FILE *out, const char *prefix, const arris_lines *lines) {
    const arris_line *l;
    for (uint32_t i = 0; (l = next(lines, &i));)
        fprintf(out, "%s%.9g %.9g %.9g\n%s%.9g %.9g %.9g\n", prefix, l->p[0], l->p[1], l->p[2],
                prefix, l->q[0], l->q[1], l->q[2]);
}

void ply_write(FILE *out, const arris_lines *lines) {
    uint32_t n = count(lines);
    fprintf(out,
            "ply\nformat ascii 1.0\ncomment arris: measured lines, mm\n"
            "element vertex %u\nproperty double x\nproperty double y\nproperty double z\n"
            "element edge %u\nproperty int vertex1\nproperty int vertex2\nend_header\n",
            2 * n, n);
    vertices(out, "", lines);
    for (uint32_t i = 0; i < n; i++)
        fprintf(out, "%u %u\n", 2 * i, 2 * i + 1);
}

void obj_write(FILE *out, const arris_lines *lines) {
    uint32_t n = count(lines);
    fprintf(out, "# arris: measured lines, mm\n");
    vertices(out, "v ", lines);
    for (uint32_t i = 0; i < n; i++)
        fprintf(out, "l %u %u\n", 2 * i + 1, 2 * i + 2);
}

/* Pairs of a group code and its value. Exponents are avoided: some readers know none. */
void dxf_write(FILE *out, const arris_lines *lines) {
    const arris_line *l;
    fprintf(out, "999\narris: measured lines, mm\n0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n"
                 "0\nENDSEC\n0\nSECTION\n2\nENTITIES\n");
    for (uint32_t i = 0; (l = next(lines, &i));)
        fprintf(out, "0\nLINE\n8\n0\n10\n%.6f\n20\n%.6f\n30\n%.6f\n11\n%.6f\n21\n%.6f\n31\n%.6f\n",
                l->p[0], l->p[1], l->p[2], l->q[0], l->q[1], l->q[2]);
    fprintf(out, "0\nENDSEC\n0\nEOF\n");
}
