/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * solve.h: a sparse symmetric matrix and its factors, by one of two ways that give the same.
 */
#ifndef ADJUST_SOLVE_H
#define ADJUST_SOLVE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The upper triangle by columns, rows ascending: column j is at ptr[j] .. ptr[j + 1] - 1; and an
 * order of the rows in which few entries come in on the way. */
typedef struct adj_matrix {
    int n;
    int *ptr, *row, *order;
    double *val;
} adj_matrix;

/* A[perm, perm] = L D L' by columns, rows ascending: at ptr[j] is D's, then come nz[j] - 1 of L
 * below the diagonal, where it has ones. It is the solver's, until that is used again or freed. */
typedef struct adj_factor {
    int n;
    const int *perm, *ptr, *nz, *row;
    const double *val;
} adj_factor;

typedef struct adj_solver adj_solver;

/* A way to factor. The functions return 0, ARRIS_E_MEMORY, or ARRIS_E_INPUT: the matrix is not
 * positive definite. */
typedef struct adj_backend {
    const char *name;
    adj_solver *(*create)(void); /* NULL: no memory. For `free`. */
    void (*free)(adj_solver *s); /* NULL is allowed */
    /* Once for all matrices with the same pattern: finds a cheap order. */
    int (*analyse)(adj_solver *s, const adj_matrix *A);
    int (*factor)(adj_solver *s, const adj_matrix *A, adj_factor *f);
} adj_backend;

extern const adj_backend adj_cholmod; /* simplicial, by CHOLMOD's LGPL functions alone */
extern const adj_backend adj_eigen;   /* Eigen's SimplicialLDLT */

/* x = A⁻¹ b; `work` has room for n, and may not be one of them. */
void adj_factor_solve(const adj_factor *f, const double *b, double *x, double *work);

/* The same for a matrix that is near to the one with the factor, by conjugate gradients, until what
 * x lacks is of b' A⁻¹ b the share `share`. Returns the turns that it took; 0: it did not come so
 * far in `most`. `work` has room for ADJ_CONJUGATE times n. */
enum { ADJ_CONJUGATE = 5 };
int adj_conjugate(const adj_matrix *A, const adj_factor *f, const double *b, double *x, int most,
                  double share, double *work);

/* The entries of A⁻¹ where L has some (Takahashi's recursion; Erisman and Tinney 1975): in the
 * places of f->val, `work` has room for n whole numbers, all -1 before and after, and n more. */
void adj_factor_invert(const adj_factor *f, double *inverse, int *work, double *column);

#ifdef __cplusplus
}
#endif
#endif
