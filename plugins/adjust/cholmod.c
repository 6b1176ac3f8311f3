/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * cholmod.c: factors by CHOLMOD (solve.h). Of it only functions of Core and Cholesky are called,
 * which are under the LGPL (`make lint` looks at the symbols), so the factor is simplicial: what is
 * done with it is in factor.c.
 */
#include <stdlib.h>
#include <suitesparse/cholmod.h>

#include "arris_types.h"
#include "solve.h"

struct adj_solver {
    cholmod_common c;
    cholmod_factor *L;
};

static void free_solver(adj_solver *s) {
    if (!s)
        return;
    cholmod_free_factor(&s->L, &s->c);
    cholmod_finish(&s->c);
    free(s);
}

/* The cheapest order of three: CHOLMOD counts them out. Minimum degree alone is some times far from
 * it where a scan is long. */
static adj_solver *create(void) {
    adj_solver *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    cholmod_start(&s->c);
    s->c.print = 0;
    s->c.supernodal = CHOLMOD_SIMPLICIAL;
    s->c.nmethods = 3;
    s->c.method[0].ordering = CHOLMOD_GIVEN;
    s->c.method[1].ordering = CHOLMOD_NATURAL;
    s->c.method[2].ordering = CHOLMOD_AMD;
    return s;
}

static cholmod_sparse view_of(const adj_matrix *A) {
    return (cholmod_sparse){.nrow = (size_t)A->n,
                            .ncol = (size_t)A->n,
                            .nzmax = (size_t)A->ptr[A->n],
                            .p = A->ptr,
                            .i = A->row,
                            .x = A->val,
                            .stype = 1,
                            .itype = CHOLMOD_INT,
                            .xtype = CHOLMOD_REAL,
                            .dtype = CHOLMOD_DOUBLE,
                            .sorted = 1,
                            .packed = 1};
}

static int analyse(adj_solver *s, const adj_matrix *A) {
    cholmod_sparse a = view_of(A);
    cholmod_free_factor(&s->L, &s->c);
    s->L = cholmod_analyze_p(&a, A->order, NULL, 0, &s->c);
    return s->L ? 0 : ARRIS_E_MEMORY;
}

static int factor(adj_solver *s, const adj_matrix *A, adj_factor *f) {
    cholmod_sparse a = view_of(A);
    cholmod_factorize(&a, s->L, &s->c);
    if (s->c.status == CHOLMOD_NOT_POSDEF || (s->c.status == CHOLMOD_OK && s->L->minor < s->L->n))
        return ARRIS_E_INPUT;
    if (s->c.status != CHOLMOD_OK)
        return s->c.status == CHOLMOD_OUT_OF_MEMORY ? ARRIS_E_MEMORY : ARRIS_E_INPUT;
    *f = (adj_factor){A->n, s->L->Perm, s->L->p, s->L->nz, s->L->i, s->L->x};
    for (int j = 0; j < f->n; j++)
        if (!(f->val[f->ptr[j]] > 0))
            return ARRIS_E_INPUT;
    return 0;
}

const adj_backend adj_cholmod = {"cholmod", create, free_solver, analyse, factor};
