/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * match.h: which line measured which nominal edge, and by how much it is off. No dependency on the
 * runtime.
 *
 * Coordinates across an edge are (a, b): a towards the outer side where the edge has a normal, b
 * completing. The deviation is linear along the edge; it is kept at the two ends of what both the
 * edge and the line reach over: d = (a, b at `from`; a, b at `to`), mm.
 */
#ifndef MATCH_H
#define MATCH_H

#include "nominal.h"

/* Where the nominal lies in the world: X' = R (X - c) + c + t. */
typedef struct place {
    double R[9], t[3], c[3]; /* mm */
    double size;             /* mm; a rotation by w moves the nominal's far points by size * w */
    double cov[6][6];     /* of (size * rotation vector, t), mm², from the measurement's noise */
    double inverse[6][6]; /* of the information that it was found with, mm² */
    double form;          /* variance by which the edges do not fit each other, mm² */
} place;

/* A nominal edge as placed, and the line that measured it. */
typedef struct piece {
    double p[3], u[3], a[3], b[3]; /* its first end, mm; its direction and the axes across */
    double length;                 /* mm */
    bool outward;                  /* a is towards the outer side of the part */
    int32_t line;                  /* index of the line; -1: none */
    double weight;                 /* its part in the alignment; 0: none */
    double from, to;               /* mm from p */
    double d[4], cov[4][4];        /* mm, mm² */
} piece;

enum { MATCH_CANDIDATES = 6 };

/* The lines that may be an edge, the best first. */
typedef struct candidates {
    uint32_t n, next;
    struct {
        int32_t line;
        double cost;
    } best[MATCH_CANDIDATES];
} candidates;

/* Lays a point of the nominal, or an edge, which has no line then, by `where`. */
void place_point(const place *where, const double x[3], double X[3]);
void piece_place(piece *e, const nominal_edge *n, const place *where);

/* Compares the edge with a line: fills from, to, d, cov. Returns the squared Mahalanobis distance
 * of its middle, `reach` (mm) being the sigma by which the part may be off; INFINITY when their
 * directions differ by more than 8 degrees or they do not overlap by 30 % of the shorter. */
double piece_compare(piece *e, const arris_line *l, double reach);

/* Gives every edge at most one of the measured lines and every line to at most one edge, the nearer
 * first (deferred acceptance); `search` is the greatest deviation, mm. `c` (n) and `owner`
 * (lines->n) are room to work in. */
void match(piece *e, uint32_t n, const arris_lines *lines, double search, candidates *c,
           int32_t *owner);

/* The point at d[2 * end] of the nominal, 0: from, 1: to. */
void piece_point(const piece *e, int end, double X[3]);

/* Derivatives of d by the parameters of `where` (as in its cov), 4 rows of 6. */
void piece_jacobian(const piece *e, const place *where, double J[4][6]);

#endif
