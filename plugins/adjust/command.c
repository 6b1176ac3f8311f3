/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * command.c: `arris adjust`: lines and poses of a scan that filesink wrote.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "arris.h"
#include "arris_plugin.h"

#include "bytes.h"
#include "camera.h"
#include "files/output.h"
#include "files/writers.h"
#include "input.h"
#include "options.h"
#include "summary.h"

static const char help[] =
    "usage: arris adjust [options] lines.json frames.csv segments.csv\n"
    "\n"
    "Adjusts lines and poses together: those that `reconstruct` found, the poses that the robot\n"
    "reported, and the segments with their tracks, as filesink writes them.\n"
    "\n"
    "  -o FILE           write the adjusted lines: .json .ply .obj .dxf\n"
    "  --poses FILE      write frames.csv with the adjusted poses\n"
    "  --camera FILE     the camera.json; otherwise the one beside frames.csv\n"
    "  --pose-sigma MM   noise of the reported positions, per axis; otherwise it is estimated\n"
    "  --rot-sigma RAD   noise of the reported rotations, per axis; otherwise it is estimated\n"
    "  --states LIST     what else the poses have in common, with commas between: scale, drift,\n"
    "                    hand-eye, delay; and the pictures: lens, a state anyway when evident\n"
    "  --robust SIGMAS   from which a segment counts less (4); 0: never\n"
    "  --solver NAME     cholmod (the default) or eigen\n"
    "  --truth FILE      a frames.csv with the true poses, to compare with\n"
    "  --json            what was found as JSON\n";

typedef struct command {
    const char *output, *poses, *camera_path, *truth_path, *paths[3];
    adjust_params p;
    bool json;
    bytes lines_text, segments_text;
    frame_list frames, truth;
    arris_camera camera;
    arris_lines before, after;
    record record;
    adjusted result;
} command;

static const char hint[] = "see `arris adjust --help`";

/* ---- options --------------------------------------------------------------------------------- */

static int read_number(const char *option, const char *text, double max, double *v, fault *f) {
    char *end;
    *v = strtod(text, &end);
    if (end == text || *end || !(*v >= 0 && *v <= max))
        return fault_set(f, ARRIS_E_USAGE, hint, "%s %.100s: expected a number from 0 to %g",
                         option, text, max);
    return 0;
}

static int read_states(const char *text, unsigned *common, fault *f) {
    static const char *const names[] = {"scale", "drift", "hand-eye", "delay", "lens"};
    char copy[100], *next = copy, *word;
    snprintf(copy, sizeof copy, "%s", text);
    while ((word = strsep(&next, ","))) {
        int i = 0;
        while (i < 5 && strcmp(word, names[i]) != 0)
            i++;
        if (i == 5)
            return fault_set(f, ARRIS_E_USAGE, hint,
                             "--states %.40s: expected one of scale, drift, hand-eye, delay, lens",
                             word);
        *common |= 1u << i;
    }
    return 0;
}

static int read_solver(const char *text, const adj_backend **backend, fault *f) {
    *backend = strcmp(text, adj_eigen.name) == 0 ? &adj_eigen : &adj_cholmod;
    if (strcmp(text, (*backend)->name) == 0)
        return 0;
    return fault_set(f, ARRIS_E_USAGE, hint, "--solver %.40s: expected cholmod or eigen", text);
}

enum { POSES = 1, CAMERA, POSE_SIGMA, ROT_SIGMA, STATES, ROBUST, SOLVER, TRUTH, JSON };

static int read_option(int c, void *self, fault *f) {
    command *m = self;
    switch (c) {
    case POSES:
        m->poses = optarg;
        return 0;
    case CAMERA:
        m->camera_path = optarg;
        return 0;
    case POSE_SIGMA:
        return read_number("--pose-sigma", optarg, 1e3, &m->p.pose_sigma, f);
    case ROT_SIGMA:
        return read_number("--rot-sigma", optarg, 1, &m->p.rot_sigma, f);
    case STATES:
        return read_states(optarg, &m->p.common, f);
    case ROBUST:
        return read_number("--robust", optarg, 100, &m->p.robust, f);
    case SOLVER:
        return read_solver(optarg, &m->p.backend, f);
    case TRUTH:
        m->truth_path = optarg;
        return 0;
    case JSON:
        m->json = true;
        return 0;
    default:
        m->output = optarg;
        return 0;
    }
}

/* 0, an error, or 1: the help was asked for. */
static int read_options(int argc, char **argv, command *m, fault *f) {
    static const struct option table[] = {{"poses", required_argument, NULL, POSES},
                                          {"camera", required_argument, NULL, CAMERA},
                                          {"pose-sigma", required_argument, NULL, POSE_SIGMA},
                                          {"rot-sigma", required_argument, NULL, ROT_SIGMA},
                                          {"states", required_argument, NULL, STATES},
                                          {"robust", required_argument, NULL, ROBUST},
                                          {"solver", required_argument, NULL, SOLVER},
                                          {"truth", required_argument, NULL, TRUTH},
                                          {"json", no_argument, NULL, JSON},
                                          {"output", required_argument, NULL, 'o'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    int r = options_read(argc, argv, "ho:", table, read_option, m, hint, f);
    if (r == 0 && argc - optind != 3)
        return fault_set(f, ARRIS_E_USAGE, hint,
                         "it takes three files: lines.json frames.csv segments.csv");
    for (int i = 0; r == 0 && i < 3; i++)
        m->paths[i] = argv[optind + i];
    return r;
}

/* ---- in -------------------------------------------------------------------------------------- */

enum { MAX_FILE = 1 << 30 };

static int load(command *m, fault *f) {
    char beside[FRAMES_PATH];
    const char *camera = m->camera_path ? m->camera_path : beside;
    int r = bytes_read(&m->lines_text, m->paths[0], MAX_FILE, f);
    if (r == 0)
        r = input_lines((const char *)m->lines_text.data, m->lines_text.n, m->paths[0], &m->before,
                        f);
    if (r == 0)
        r = frames_load(&m->frames, m->paths[1], 0, f);
    if (r == 0 && !m->camera_path)
        r = frames_path(&m->frames, "camera.json", beside, f);
    if (r == 0)
        r = camera_load(camera, &m->camera, f);
    if (r == 0)
        r = bytes_read(&m->segments_text, m->paths[2], MAX_FILE, f);
    if (r == 0)
        r = input_segments((char *)m->segments_text.data, m->segments_text.n, m->paths[2],
                           &m->frames, &m->camera, &m->record, f);
    if (r == 0 && m->truth_path)
        r = frames_load(&m->truth, m->truth_path, 0, f);
    return r;
}

/* ---- out ------------------------------------------------------------------------------------- */

typedef void lines_writer(FILE *out, const arris_lines *lines);

static lines_writer *writer_of(const char *path) {
    static const struct {
        const char *ending;
        lines_writer *write;
    } kinds[] = {
        {".json", json_write}, {".ply", ply_write}, {".obj", obj_write}, {".dxf", dxf_write}};
    size_t n = strlen(path);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        size_t m = strlen(kinds[i].ending);
        if (n >= m && strcmp(path + n - m, kinds[i].ending) == 0)
            return kinds[i].write;
    }
    return NULL;
}

/* The frames as they were listed, with the adjusted pose where there is one. */
static void write_frames(FILE *out, const command *m) {
    uint32_t k = 0;
    fprintf(out, "index,file,utime,x,y,z,omega,theta,kappa\n");
    for (size_t i = 0; i < m->frames.n; i++) {
        const frame_entry *e = &m->frames.item[i];
        double pose[6];
        memcpy(pose, e->pose, sizeof pose);
        fprintf(out, "%lld,%s,%lld", (long long)e->index, e->file, (long long)e->utime);
        if (k < m->record.n_frames && m->record.frame[k].index == e->index) {
            memcpy(pose, m->result.pose[k].C, sizeof m->result.pose[k].C);
            arris_angles(m->result.pose[k].R, &pose[3], &pose[4], &pose[5]);
            k++;
        }
        for (int j = 0; j < 6; j++)
            fprintf(out, e->posed ? ",%.*f" : ",", j < 3 ? 5 : 9, pose[j]);
        fputc('\n', out);
    }
}

static int write_file(const char *path, const command *m, lines_writer *write, fault *f) {
    output o;
    errno = 0;
    int error = output_open(&o, path);
    if (!error) {
        if (write)
            write(o.file, &m->after);
        else
            write_frames(o.file, m);
        error = output_commit(&o);
    }
    return error ? fault_set(f, ARRIS_E_IO, NULL, "cannot write %s: %s", path, strerror(error)) : 0;
}

static const frame_entry *true_entry(const command *m, int64_t index) {
    for (size_t i = 0; i < m->truth.n; i++)
        if (m->truth.item[i].index == index && m->truth.item[i].posed)
            return &m->truth.item[i];
    return NULL;
}

/* The reported and adjusted poses of the frames that have a true one. */
static int compare(const command *m, summary *s, fault *f) {
    uint32_t n = m->record.n_frames, k = 0;
    adj_pose *pose = calloc(3 * (size_t)n + 1, sizeof *pose);
    if (!pose)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %u poses", n);
    for (uint32_t i = 0; i < n; i++) {
        const frame_entry *e = true_entry(m, m->record.frame[i].index);
        arris_pose t;
        if (!e)
            continue;
        frames_pose(e, &t);
        memcpy(pose[k].C, t.C, sizeof t.C);
        memcpy(pose[k].R, t.R, sizeof t.R);
        memcpy(pose[n + k].C, m->record.frame[i].pose.C, sizeof t.C);
        memcpy(pose[n + k].R, m->record.frame[i].pose.R, sizeof t.R);
        pose[2 * n + k++] = m->result.pose[i];
    }
    s->compared = k > 0;
    s->reported = summary_compare(pose + n, pose, k);
    s->adjusted = summary_compare(pose + 2 * n, pose, k);
    free(pose);
    return 0;
}

/* ---- the command ----------------------------------------------------------------------------- */

static int adjust(command *m, fault *f) {
    m->after = m->before;
    m->after.item = malloc((m->before.n + (size_t)1) * sizeof *m->after.item);
    if (!m->after.item)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %u lines", m->before.n);
    memcpy(m->after.item, m->before.item, m->before.n * sizeof *m->after.item);
    int r = record_adjust(&m->record, &m->after, &m->p, &m->result);
    if (r == ARRIS_E_MEMORY)
        return fault_set(f, r, NULL, "no memory to adjust %u segments", m->record.n);
    if (r < 0 || !m->result.pose)
        return fault_set(f, ARRIS_E_INPUT, NULL, "nothing can be adjusted: %s",
                         m->result.undetermined);
    return 0;
}

static int run_command(command *m, fault *f) {
    lines_writer *write = m->output ? writer_of(m->output) : NULL;
    if (m->output && !write)
        return fault_set(f, ARRIS_E_USAGE, hint,
                         "-o %.100s: it ends in none of .json .ply .obj .dxf", m->output);
    int r = load(m, f);
    if (r == 0)
        r = adjust(m, f);
    summary s = {.record = &m->record,
                 .before = &m->before,
                 .after = &m->after,
                 .result = &m->result,
                 .solver = m->p.backend->name};
    if (r == 0 && m->truth_path)
        r = compare(m, &s, f);
    if (r == 0)
        (m->json ? summary_json : summary_print)(stdout, &s);
    if (r == 0 && write)
        r = write_file(m->output, m, write, f);
    if (r == 0 && m->poses)
        r = write_file(m->poses, m, NULL, f);
    return r;
}

static int run(int argc, char **argv) {
    command m = {.p = {.robust = 4, .backend = &adj_cholmod}};
    fault f = {.hint = NULL};
    int r = read_options(argc, argv, &m, &f);
    if (r == 1) {
        fputs(help, stdout);
        return 0;
    }
    if (r == 0)
        r = run_command(&m, &f);
    if (r < 0) {
        fprintf(stderr, "arris adjust: %s\n", f.text);
        if (f.hint)
            fprintf(stderr, "  %s\n", f.hint);
    }
    record_adjusted_free(&m.result);
    record_free(&m.record);
    frames_free(&m.frames);
    frames_free(&m.truth);
    free(m.before.item);
    free(m.after.item);
    free(m.lines_text.data);
    free(m.segments_text.data);
    return r < 0 ? arris_exit_code(r) : 0;
}

const arris_command_desc command_adjust = {
    .size = sizeof(arris_command_desc),
    .name = "adjust",
    .summary = "lines and poses of a recorded scan, together",
    .run = run,
};
