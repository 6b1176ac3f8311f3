/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * merge.h: straight pieces of chains, and joining those that continue each other.
 */
#ifndef MERGE_H
#define MERGE_H

#include "arris_types.h"

typedef struct piece piece;

/* Two pieces of which the second begins where the first ends; the less `cost` the better. */
typedef struct piece_pair {
    double cost;
    piece *first, *second;
} piece_pair;

/* A run of edge points near a line, brighter side on the right. */
struct piece {
    double x1, y1, x2, y2;      /* the ends, px */
    double dx, dy;              /* unit direction from the first end to the second */
    double n, x, y, xx, xy, yy; /* sums over the points */
    double gx, gy;              /* and over their gradients */
    uint32_t chain, points;     /* the chain that most points are from, and how many those are */
    bool raw;                   /* the ends are points of chains, not their feet on the line */
    bool gone;                  /* it became part of another */
    piece_pair best;            /* for piece_merge */
};

/* The piece of n >= 2 points. The line is fitted by total least squares, without the points at the
 * ends that a corner may have rounded; `raw`: it is that through the first and the last point. */
piece piece_make(const arris_edge_point *p, uint32_t n, uint32_t chain, bool raw);

/* The points' mean squared distance from the piece's line, and their variance along it, px². */
double piece_scatter(const piece *p);
double piece_spread(const piece *p);

typedef struct piece_rule {
    double sine;    /* of the angle between the directions */
    double linkrad; /* px, between the end of one and the start of the next */
    double tol;     /* px, of all four ends from the line of the joined piece; may be INFINITY */
} piece_rule;

/* Where a piece starts, in a list of those nearby; and what was found at its end. */
typedef struct piece_node {
    float x, y, dx, dy;
    int32_t next;
    int32_t near;   /* the piece that starts there; negative: none, or several */
    int32_t joined; /* the round after which it was made, from 1 on */
    bool search;    /* what continues it is to be looked for in this round */
} piece_node;

enum { PIECE_HEADS = 4096 };

/* Joins pieces by the rule (Kovesi's mergeseg, for pieces whose brighter sides agree). The pair
 * that fits best goes first and directions are updated after each join, so that the order of the
 * pieces has no influence. A joined piece is `gone`. `heads` is scratch for PIECE_HEADS and `nodes`
 * for n. */
void piece_merge(piece *p, uint32_t n, const piece_rule *rule, int32_t *heads, piece_node *nodes);

#endif
