/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * merge.h: straight pieces of chains, and joining those that continue each other.
 */
#ifndef MERGE_H
#define MERGE_H

#include "arris_types.h"

/* A run of edge points near a line, brighter side on the right. */
typedef struct piece {
    double x1, y1, x2, y2;      /* the ends, px */
    double dx, dy;              /* unit direction from the first end to the second */
    double n, x, y, xx, xy, yy; /* sums over the points */
    double gx, gy;              /* and over their gradients */
    uint32_t chain, points;     /* the chain that most points are from, and how many those are */
    bool raw;                   /* the ends are points of chains, not their feet on the line */
    bool gone;                  /* it became part of another */
} piece;

/* The piece of n >= 2 points, without those at the ends that a corner may have rounded, unless it
 * is `raw`. It has no direction yet. */
void piece_make(piece *s, const arris_edge_point *p, uint32_t n, uint32_t chain, bool raw);

/* The points' mean squared distance from the piece's line, and their variance along it, px². */
double piece_scatter(const piece *p);
double piece_spread(const piece *p);

typedef struct piece_rule {
    double sine;    /* of the angle between the directions */
    double linkrad; /* px, between the end of one and the start of the next */
    double tol;     /* px, of all four ends from the line of the joined piece; may be INFINITY */
} piece_rule;

/* Two pieces of which the second begins where the first ends; the less `cost` the better. A
 * negative number: none. */
typedef struct piece_pair {
    double cost;
    int32_t first, second;
} piece_pair;

/* What the search needs of a piece, in a list of those that start nearby; and what was found at its
 * end. */
typedef struct piece_node {
    float x1, y1, x2, y2, dx, dy;
    int32_t next;
    int32_t near;   /* the piece that starts there; negative: none, or several */
    int32_t joined; /* the round after which it was made, from 1 on */
    bool search;    /* what continues it is to be looked for in this round */
    bool gone;
    piece_pair best;
} piece_node;

enum { PIECE_HEADS = 16384 };

/* Fits the lines of new pieces: by total least squares, or through the first and the last point
 * when they are raw. Then joins pieces by the rule (Kovesi's mergeseg, for pieces whose brighter
 * sides agree). The pair that fits best goes first and directions are updated after each join, so
 * that the order of the pieces has no influence. A joined piece is `gone`. `heads` is scratch for
 * PIECE_HEADS and `nodes` for n. */
void piece_merge(piece *p, uint32_t n, const piece_rule *rule, int32_t *heads, piece_node *nodes);

#endif
