/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * system.c: the pattern of the normal equations (system.h). Their filling is in fill.c.
 */
#include "system.h"

#include <stdlib.h>
#include <string.h>

static int reserve_matrix(adj_system *s, size_t entries) {
    if (entries <= s->max_entries)
        return 0;
    free(s->S.row);
    free(s->S.val);
    s->S.row = entries < INT32_MAX ? malloc(entries * sizeof *s->S.row) : NULL;
    s->S.val = entries < INT32_MAX ? malloc(entries * sizeof *s->S.val) : NULL;
    s->max_entries = s->S.row && s->S.val ? entries : 0;
    return s->max_entries ? 0 : ARRIS_E_MEMORY;
}

/* A triangle of 4 for a line, 4x6 for a view, a triangle of 6 for a frame, and the border. */
static size_t count_entries(size_t lines, size_t views, size_t frames) {
    return 10 * lines + 24 * views + 21 * frames + 1 +
           (4 * lines + 6 * frames + ADJ_COMMON) * ADJ_COMMON;
}

int adj_system_init(adj_system *s, const adj_problem *p) {
    size_t frames = p->max_frames, lines = p->max_lines, views = p->max_views;
    memset(s, 0, sizeof *s);
    s->max_rows = 4 * lines + 6 * frames + ADJ_COMMON;
    s->S.ptr = malloc((s->max_rows + 1) * sizeof *s->S.ptr);
    s->S.order = malloc(s->max_rows * sizeof *s->S.order);
    s->rhs = malloc(s->max_rows * sizeof *s->rhs);
    s->order = malloc((views + 1) * sizeof *s->order);
    s->slot = malloc((views + 1) * sizeof *s->slot);
    s->first = malloc((lines + 2) * sizeof *s->first);
    s->last = malloc((frames + 1) * sizeof *s->last);
    s->own = malloc((frames + 1) * sizeof *s->own);
    if (!s->S.ptr || !s->S.order || !s->rhs || !s->order || !s->slot || !s->first || !s->last ||
        !s->own)
        return ARRIS_E_MEMORY;
    return 0;
}

void adj_system_free(adj_system *s) {
    free(s->S.ptr);
    free(s->S.row);
    free(s->S.val);
    free(s->S.order);
    free(s->rhs);
    free(s->order);
    free(s->slot);
    free(s->first);
    free(s->last);
    free(s->own);
    memset(s, 0, sizeof *s);
}

static void sort_views(adj_system *s, const adj_problem *p) {
    memset(s->first, 0, (p->n_lines + (size_t)2) * sizeof *s->first);
    for (uint32_t i = 0; i < p->n_views; i++)
        s->first[p->view[i].line + 2]++;
    for (uint32_t l = 2; l < p->n_lines + 2; l++)
        s->first[l] += s->first[l - 1];
    for (uint32_t i = 0; i < p->n_views; i++)
        s->order[s->first[p->view[i].line + 1]++] = i;
}

/* Lines in turn, so that the rows of a frame's columns ascend; a line may be seen twice in one. */
static void place_views(adj_system *s, const adj_problem *p) {
    int *rows = s->own, *last = s->last;
    for (uint32_t i = 0; i < p->n_frames; i++)
        rows[i] = 0, last[i] = -1;
    for (uint32_t l = 0; l < p->n_lines; l++)
        for (uint32_t k = s->first[l]; k < s->first[l + 1]; k++) {
            uint32_t v = s->order[k], frame = p->view[v].frame;
            if (last[frame] != (int)l)
                rows[frame] += 4;
            last[frame] = (int)l;
            s->slot[v] = rows[frame] - 4;
        }
}

static void count_columns(adj_system *s) {
    int *ptr = s->S.ptr, at = 0, column = 0;
    for (; column < s->poses; at += column++ % 4 + 1)
        ptr[column] = at;
    for (; column < s->common; column++) {
        int frame = (column - s->poses) / 6, c = (column - s->poses) % 6;
        ptr[column] = at;
        at += s->own[frame] + c + 1;
    }
    for (; column < s->S.n; column++) {
        ptr[column] = at;
        at += column - s->border + 1;
    }
    ptr[s->S.n] = at;
}

/* Lines that no frame sees come first, the common states last. */
static void order_rows(adj_system *s, const adj_problem *p) {
    int *last = s->S.row, n = 0; /* the last frame of each line */
    for (uint32_t l = 0; l < p->n_lines; l++) {
        last[l] = -1;
        for (uint32_t k = s->first[l]; k < s->first[l + 1]; k++) {
            int frame = (int)p->view[s->order[k]].frame;
            last[l] = frame > last[l] ? frame : last[l];
        }
    }
    for (int i = -1; i < (int)p->n_frames; i++) {
        for (int r = 0; i >= 0 && r < 6; r++)
            s->S.order[n++] = s->poses + 6 * i + r;
        for (uint32_t l = 0; l < p->n_lines; l++)
            for (int r = 0; last[l] == i && r < 4; r++)
                s->S.order[n++] = 4 * (int)l + r;
    }
    while (n < s->S.n) {
        s->S.order[n] = n;
        n++;
    }
}

static void list_rows(int *to, int first, int n) {
    for (int r = 0; r < n; r++)
        to[r] = first + r;
}

static void list_entries(adj_system *s, const adj_problem *p) {
    const int *ptr = s->S.ptr;
    int *row = s->S.row;
    for (int c = 0; c < s->poses; c++)
        list_rows(row + ptr[c], c - c % 4, c % 4 + 1);
    for (uint32_t i = 0; i < p->n_views; i++)
        for (int c = 0; c < 6; c++)
            list_rows(row + ptr[s->poses + 6 * (int)p->view[i].frame + c] + s->slot[i],
                      4 * (int)p->view[i].line, 4);
    for (int i = 0; i < (int)p->n_frames; i++)
        for (int c = 0; c < 6; c++)
            list_rows(row + ptr[s->poses + 6 * i + c] + s->own[i], s->poses + 6 * i, c + 1);
    for (int c = s->common; c < s->S.n; c++)
        list_rows(row + ptr[c], s->border, c - s->border + 1);
}

int adj_system_plan(adj_system *s, const adj_problem *p) {
    s->poses = 4 * (int)p->n_lines;
    s->common = s->poses + 6 * (int)p->n_frames;
    s->border = p->common & ADJ_LENS ? 0 : s->poses;
    s->S.n = s->common + adj_n_common(p);
    sort_views(s, p);
    place_views(s, p);
    count_columns(s);
    if (reserve_matrix(s, count_entries(p->n_lines, p->n_views, p->n_frames)))
        return ARRIS_E_MEMORY;
    order_rows(s, p);
    list_entries(s, p);
    return 0;
}
