/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_ceres.cc: the solver of `adjust` beside Ceres, on the same problems, by the same residuals
 * and derivatives, from the same start, in one thread. Ceres goes two ways: eliminating the lines
 * (SPARSE_SCHUR), and ordering all unknowns (SPARSE_NORMAL_CHOLESKY).
 *
 *     bench_ceres
 *
 * Drawn scans of growing length past lines that are each seen in some 60 frames: the time that a
 * solution takes with CHOLMOD and with Eigen, a frame's share of it, and Ceres's times over ours,
 * the medians of pairs of runs; how far the two optima differ, in cost (relative) and in the lines
 * (sigmas of theirs); and the most memory the process ever took, before Ceres was first called.
 */
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>
#include <random>
#include <vector>

#include <ceres/ceres.h>
#include <sys/resource.h>

extern "C" {
#include "adjust/adjust.h"
}

namespace {

const int PAIRS = 2, ROUNDS = 50;
const double STILL = 1e-9;              /* of the cost: a step that takes off less is the last */
const double STEP = 4.1, PX = 0.02;     /* mm a frame; px, sigma of a segment's offset */
const double JITTER = 0.2, TURN = 2e-4; /* mm, rad */
const double SIGMAS[6] = {JITTER, JITTER, JITTER, TURN, TURN, TURN};

struct Size {
    uint32_t frames, lines;
} const SIZES[] = {{135, 40}, {500, 125}, {1000, 250}, {2000, 500}};

/* Of this thread alone, so that what else the machine does has less of a say. */
double now() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/* ---- a drawn scan ---------------------------------------------------------------------------- */

struct Problem : adj_problem {
    Problem(uint32_t frames, uint32_t lines) {
        if (adj_init(this, frames, lines, frames * lines))
            std::abort();
    }
    ~Problem() {
        adj_free(this);
    }
    Problem(const Problem &) = delete;
    Problem &operator=(const Problem &) = delete;
};

class Draw {
  public:
    double uniform(double from, double to) {
        return std::uniform_real_distribution<double>(from, to)(generator);
    }
    double normal(double sigma) {
        return std::normal_distribution<double>(0, sigma)(generator);
    }

  private:
    std::mt19937 generator{1};
};

struct Edge {
    double P[3], Q[3];
};

Edge draw_edge(Draw &draw, double span) {
    double x = draw.uniform(-150, span + 150), y = draw.uniform(-150, 150);
    double z = draw.uniform(670, 1000), t = draw.uniform(0.5, 2.6), half = draw.uniform(30, 80);
    return {{x - half * cos(t), y - half * sin(t), z}, {x + half * cos(t), y + half * sin(t), z}};
}

/* False when it is not in the picture. */
bool see(Draw &draw, const arris_camera &c, const arris_pose &pose, const Edge &e,
         arris_segment *s) {
    double offset = draw.normal(PX), angle = draw.normal(PX / 20);
    *s = arris_segment();
    s->cov[0] = PX * PX, s->cov[2] = PX * PX / 400;
    if (!(arris_project(&c, &pose, e.P, &s->x1, &s->y1) > 0) ||
        !(arris_project(&c, &pose, e.Q, &s->x2, &s->y2) > 0))
        return false;
    double dx = s->x2 - s->x1, dy = s->y2 - s->y1, half = hypot(dx, dy) / 2;
    for (double k : {-1., 1.}) {
        double by = (offset + k * half * angle) / (2 * half);
        double &x = k < 0 ? s->x1 : s->x2, &y = k < 0 ? s->y1 : s->y2;
        x -= by * dy, y += by * dx;
        if (x < 0 || x > c.width - 1 || y < 0 || y > c.height - 1)
            return false;
    }
    return true;
}

void draw_scan(adj_problem *p) {
    Draw draw;
    arris_camera &c = p->camera;
    c.width = 320, c.height = 240;
    c.fx = 380, c.fy = 378, c.cx = 160, c.cy = 119;
    std::copy(SIGMAS, SIGMAS + 6, p->sigma);
    p->robust = 3;
    std::vector<Edge> edges;
    for (uint32_t i = 0; i < p->max_lines; i++) {
        edges.push_back(draw_edge(draw, STEP * p->max_frames));
        Edge guess = edges.back();
        for (int k = 0; k < 3; k++)
            guess.P[k] += draw.normal(0.3), guess.Q[k] += draw.normal(0.3);
        adj_add_line(p, guess.P, guess.Q, 1000);
    }
    for (uint32_t i = 0; i < p->max_frames; i++) {
        arris_pose reported = {};
        arris_segment s;
        reported.C[0] = STEP * i;
        arris_rotation(0, 0, 0, reported.R);
        adj_add_frame(p, &reported, 0.2 * i);
        adj_pose at = p->frame[i].pose;
        double d[6];
        for (int k = 0; k < 6; k++)
            d[k] = draw.normal(SIGMAS[k]);
        adj_pose_move(&at, d);
        std::copy(at.C, at.C + 3, reported.C);
        std::copy(at.R, at.R + 9, reported.R);
        for (uint32_t l = 0; l < p->max_lines; l++)
            if (see(draw, c, reported, edges[l], &s))
                adj_add_view(p, i, l, &s);
    }
}

/* ---- Ceres ----------------------------------------------------------------------------------- */

/* The twelve numbers of an adj_pose. A cost's derivatives by the step stand in the first six of the
 * twelve that Ceres asks for, so this hands them on. */
class Pose : public ceres::Manifold {
  public:
    int AmbientSize() const override {
        return 12;
    }
    int TangentSize() const override {
        return 6;
    }
    bool Plus(const double *x, const double *step, double *sum) const override {
        adj_pose pose;
        memcpy(&pose, x, sizeof pose);
        adj_pose_move(&pose, step);
        memcpy(sum, &pose, sizeof pose);
        return true;
    }
    bool PlusJacobian(const double *, double *J) const override {
        for (int i = 0; i < 12; i++)
            for (int k = 0; k < 6; k++)
                J[6 * i + k] = i == k;
        return true;
    }
    bool Minus(const double *, const double *, double *) const override {
        return false;
    }
    bool MinusJacobian(const double *, double *) const override {
        return false;
    }
};
static_assert(sizeof(adj_pose) == 12 * sizeof(double), "a pose is twelve numbers");

class View : public ceres::SizedCostFunction<2, 12, 4> {
  public:
    View(const adj_problem &problem, const adj_view &seen) : p(problem), v(seen) {
        c = v.cov[1] / v.cov[0];
        a = 1 / sqrt(v.cov[0]);
        b = 1 / sqrt(v.cov[2] - c * v.cov[1]);
    }
    bool Evaluate(double const *const *x, double *r, double **J) const override {
        adj_pose pose;
        adj_line line = p.line[v.line];
        double Jp[2][6], Jl[2][4];
        memcpy(&pose, x[0], sizeof pose);
        memcpy(line.x, x[1], sizeof line.x);
        if (!adj_residual(&p, &v, &pose, &line, r, J ? Jp : NULL, J ? Jl : NULL))
            return false;
        r[1] = b * (r[1] - c * r[0]), r[0] *= a;
        for (int i = 0; J && J[0] && i < 12; i++) {
            J[0][12 + i] = i < 6 ? b * (Jp[1][i] - c * Jp[0][i]) : 0;
            J[0][i] = i < 6 ? a * Jp[0][i] : 0;
        }
        for (int i = 0; J && J[1] && i < 4; i++) {
            J[1][4 + i] = b * (Jl[1][i] - c * Jl[0][i]);
            J[1][i] = a * Jl[0][i];
        }
        return true;
    }

  private:
    const adj_problem &p;
    const adj_view &v;
    double a, b, c;
};

/* `scratch` is a problem of the same frames, whose poses may change. */
class Prior : public ceres::SizedCostFunction<6, 12> {
  public:
    Prior(adj_problem &scratch, uint32_t i) : p(scratch), frame(i) {
    }
    bool Evaluate(double const *const *x, double *e, double **J) const override {
        double R[9];
        memcpy(&p.frame[frame].pose, x[0], sizeof(adj_pose));
        adj_error(&p, frame, e, R, NULL);
        for (int i = 0; i < 6; i++) {
            e[i] /= SIGMAS[i];
            for (int k = 0; J && J[0] && k < 12; k++)
                J[0][12 * i + k] =
                    (i < 3 || k < 3 || k > 5 ? i == k : R[3 * (i - 3) + k - 3]) / SIGMAS[i];
        }
        return true;
    }

  private:
    adj_problem &p;
    uint32_t frame;
};

/* What is known of a line beforehand. */
class Hold : public ceres::SizedCostFunction<4, 4> {
  public:
    explicit Hold(double sigma) : hold(sigma) {
    }
    bool Evaluate(double const *const *x, double *e, double **J) const override {
        for (int i = 0; i < 4; i++) {
            e[i] = x[0][i] / hold;
            for (int k = 0; J && J[0] && k < 4; k++)
                J[0][4 * i + k] = (i == k) / hold;
        }
        return true;
    }

  private:
    double hold;
};

double *numbers(adj_pose *pose) {
    return pose->C;
}

/* Solves p by Ceres; returns the seconds that the solution takes. */
double solve_by_ceres(adj_problem *p, ceres::LinearSolverType way) {
    Problem scratch(p->max_frames, 1);
    ceres::Problem problem;
    ceres::Solver::Options o;
    ceres::Solver::Summary summary;
    auto order = std::make_shared<ceres::ParameterBlockOrdering>();
    for (uint32_t l = 0; l < p->n_lines; l++) {
        problem.AddParameterBlock(p->line[l].x, 4);
        problem.AddResidualBlock(new Hold(p->line[l].hold), NULL, p->line[l].x);
        order->AddElementToGroup(p->line[l].x, 0);
    }
    for (uint32_t i = 0; i < p->n_frames; i++) {
        arris_pose reported = {};
        memcpy(reported.C, p->frame[i].reported.C, sizeof reported.C);
        memcpy(reported.R, p->frame[i].reported.R, sizeof reported.R);
        adj_add_frame(&scratch, &reported, 0);
        problem.AddParameterBlock(numbers(&p->frame[i].pose), 12, new Pose);
        order->AddElementToGroup(numbers(&p->frame[i].pose), 1);
        problem.AddResidualBlock(new Prior(scratch, i), NULL, numbers(&p->frame[i].pose));
    }
    for (uint32_t k = 0; k < p->n_views; k++)
        problem.AddResidualBlock(new View(*p, p->view[k]), new ceres::CauchyLoss(p->robust),
                                 numbers(&p->frame[p->view[k].frame].pose),
                                 p->line[p->view[k].line].x);
    o.linear_solver_type = way;
    if (way == ceres::SPARSE_SCHUR)
        o.linear_solver_ordering = order;
    o.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    o.num_threads = 1;
    o.max_num_iterations = ROUNDS;
    o.function_tolerance = STILL;
    o.gradient_tolerance = o.parameter_tolerance = 0;
    o.logging_type = ceres::SILENT;
    double start = now();
    ceres::Solve(o, &problem, &summary);
    double end = now();
    if (summary.termination_type != ceres::CONVERGENCE)
        printf("Ceres: %s\n", summary.message.c_str());
    return end - start;
}

/* ---- ours ------------------------------------------------------------------------------------ */

double solve_by_us(adj_problem *p, const adj_backend *backend) {
    double start = now();
    adj_work *w = adj_work_new(p, backend);
    if (!w || adj_minimise(p, w, ROUNDS, STILL * adj_cost(p)) < 0)
        std::abort();
    double end = now();
    adj_work_free(w);
    return end - start;
}

double most_memory() {
    rusage u;
    getrusage(RUSAGE_SELF, &u);
    return static_cast<double>(u.ru_maxrss) / 1024;
}

/* The greatest difference of the lines of two solutions, in sigmas of the first's. */
double lines_differ(adj_problem *p, const adj_problem *q) {
    double most = 0, cov[16];
    adj_work *w = adj_work_new(p, &adj_cholmod);
    if (!w || adj_minimise(p, w, 1, 0) < 0 || adj_marginals(p, w))
        std::abort();
    for (uint32_t l = 0; l < p->n_lines; l++) {
        adj_line_covariance(w, l, cov);
        for (int i = 0; i < 4; i++)
            most = std::max(most, fabs(p->line[l].x[i] - q->line[l].x[i]) / sqrt(cov[5 * i]));
    }
    adj_work_free(w);
    return most;
}

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}

void bench(const Size &size, double memory) {
    std::vector<double> ours, eigen, schur, whole;
    for (int i = 0; i < PAIRS; i++) {
        Problem a(size.frames, size.lines), b(size.frames, size.lines);
        Problem c(size.frames, size.lines), d(size.frames, size.lines);
        draw_scan(&a), draw_scan(&b), draw_scan(&c), draw_scan(&d);
        ours.push_back(solve_by_us(&a, &adj_cholmod));
        eigen.push_back(solve_by_us(&b, &adj_eigen));
        schur.push_back(solve_by_ceres(&c, ceres::SPARSE_SCHUR) / ours.back());
        whole.push_back(solve_by_ceres(&d, ceres::SPARSE_NORMAL_CHOLESKY) / ours.back());
        if (i + 1 < PAIRS)
            continue;
        double cost = adj_cost(&a);
        printf("%6u %5u %6u %9.1f %9.1f %9.3f %8.2f %8.2f %10.1e %10.1e %8.0f\n", size.frames,
               size.lines, a.n_views, 1e3 * median(ours), 1e3 * median(eigen),
               1e3 * median(ours) / size.frames, median(schur), median(whole),
               (adj_cost(&c) - cost) / cost, lines_differ(&a, &c), memory);
        fflush(stdout);
    }
}

} // namespace

int main() {
    std::vector<double> memory;
    for (const Size &s : SIZES) {
        Problem p(s.frames, s.lines);
        draw_scan(&p);
        solve_by_us(&p, &adj_cholmod);
        memory.push_back(most_memory());
    }
    printf("frames lines  views   ours ms  Eigen ms  ms/frame    Schur    whole      cost      "
           "lines       MB\n");
    for (size_t i = 0; i < sizeof SIZES / sizeof *SIZES; i++)
        bench(SIZES[i], memory[i]);
    return 0;
}
