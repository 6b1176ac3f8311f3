/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * eigen.cc: factors by Eigen's SimplicialLDLT, in the order that is given (solve.h).
 */
#include <new>
#include <vector>

#include <Eigen/SparseCholesky>

#include "arris_types.h"
#include "solve.h"

typedef Eigen::SparseMatrix<double> Sparse;
typedef Eigen::SimplicialLDLT<Sparse, Eigen::Upper, Eigen::NaturalOrdering<int>> Ldlt;

struct adj_solver {
    Ldlt ldlt;
    Eigen::PermutationMatrix<Eigen::Dynamic>
        turn; /* from A's rows to the order they are taken in */
    std::vector<int> perm, ptr, nz, row;
    std::vector<double> val;
};

static adj_solver *create() {
    return new (std::nothrow) adj_solver;
}

static void free_solver(adj_solver *s) {
    delete s;
}

static Sparse in_turn(const adj_solver *s, const adj_matrix *A) {
    Eigen::Map<const Sparse> upper(A->n, A->n, A->ptr[A->n], A->ptr, A->row, A->val);
    Sparse B;
    B.selfadjointView<Eigen::Upper>() = upper.selfadjointView<Eigen::Upper>().twistedBy(s->turn);
    return B;
}

static int analyse(adj_solver *s, const adj_matrix *A) {
    try {
        s->perm.assign(A->order, A->order + A->n);
        s->turn.resize(A->n);
        for (int i = 0; i < A->n; i++)
            s->turn.indices()[A->order[i]] = i;
        s->ldlt.analyzePattern(in_turn(s, A));
        return 0;
    } catch (const std::bad_alloc &) {
        return ARRIS_E_MEMORY;
    }
}

/* D's entry before the rows of each column. */
static void copy(adj_solver *s, int n) {
    const Sparse &L = s->ldlt.matrixL().nestedExpression();
    s->ptr.resize((size_t)n);
    s->nz.resize((size_t)n);
    s->row.clear();
    s->val.clear();
    for (int j = 0; j < n; j++) {
        s->ptr[(size_t)j] = (int)s->row.size();
        s->row.push_back(j);
        s->val.push_back(s->ldlt.vectorD()[j]);
        for (Sparse::InnerIterator it(L, j); it; ++it)
            if (it.row() > j) {
                s->row.push_back((int)it.row());
                s->val.push_back(it.value());
            }
        s->nz[(size_t)j] = (int)s->row.size() - s->ptr[(size_t)j];
    }
}

static int factor(adj_solver *s, const adj_matrix *A, adj_factor *f) {
    try {
        s->ldlt.factorize(in_turn(s, A));
        if (s->ldlt.info() != Eigen::Success || !(s->ldlt.vectorD().minCoeff() > 0))
            return ARRIS_E_INPUT;
        copy(s, A->n);
    } catch (const std::bad_alloc &) {
        return ARRIS_E_MEMORY;
    }
    *f = {A->n, s->perm.data(), s->ptr.data(), s->nz.data(), s->row.data(), s->val.data()};
    return 0;
}

extern "C" const adj_backend adj_eigen = {"eigen", create, free_solver, analyse, factor};
