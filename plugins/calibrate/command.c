/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * command.c: `arris calibrate`: its words, and which of its tasks they ask for.
 */
#include "command.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "options.h"

static const char help[] =
    "usage: arris calibrate --board COLSxROWS --square MM [options] IMAGES... -o camera.json\n"
    "       arris calibrate --board COLSxROWS --square MM [options] --from PIPELINE -o "
    "camera.json\n"
    "       arris calibrate --board COLSxROWS --square MM --hand-eye flange.csv -o handeye.json\n"
    "       arris calibrate --print-board COLSxROWS --square MM -o board.svg\n"
    "\n"
    "COLSxROWS counts the inner corners, where four squares meet. IMAGES are picture files, "
    "folders\n"
    "of them, or a frames.csv.\n"
    "\n"
    "  --fix LIST      parameters that are not estimated: names of fx fy skew cx cy k1 k2 p1 p2 "
    "k3\n"
    "                  with commas between, NAME=VALUE; without a value it is 0\n"
    "  --flat          estimate the board's shape too\n"
    "  --report FILE   write an HTML page: residuals, coverage, uncertainty, what to do next\n"
    "  --distance MM   of the part, for the uncertainty on it; otherwise that of the views\n"
    "  --from PIPELINE collect views from a pipeline's pictures, without a sink at its end\n"
    "  --target UM     with --from: stop when the uncertainty on the part is below that\n"
    "  --hand-eye CSV  the camera on the robot's flange, by views of a board that stands still\n"
    "  --camera FILE   with --hand-eye: the camera.json; otherwise the one beside the CSV, or "
    "else\n"
    "                  the camera is calibrated from the same pictures\n"
    "  --print-board   a board to print, .svg or .pdf, true to scale\n";

static int fail(int code, const fault *f) {
    fprintf(stderr, "arris calibrate: %s\n", f->text);
    if (f->hint)
        fprintf(stderr, "  %s\n", f->hint);
    return arris_exit_code(code);
}

static int usage(fault *f, const char *option, const char *value, const char *expected) {
    return fault_set(f, ARRIS_E_USAGE, "see `arris calibrate --help`", "%s %.100s: expected %s",
                     option, value, expected);
}

/* ---- options -------------------------------------------------------------------------------- */

static int read_board(const char *option, const char *text, cal_board *b, fault *f) {
    char rest;
    if (sscanf(text, "%dx%d%c", &b->cols, &b->rows, &rest) != 2 || b->cols < 3 || b->rows < 3 ||
        b->cols > CAL_MAX_SIDE || b->rows > CAL_MAX_SIDE)
        return usage(f, option, text, "COLSxROWS inner corners, as 9x6, from 3 to 100 each");
    return 0;
}

static int read_positive(const char *option, const char *text, const char *expected, double *v,
                         fault *f) {
    char *end;
    *v = strtod(text, &end);
    if (end == text || *end || !(*v > 0 && *v < 1e6))
        return usage(f, option, text, expected);
    return 0;
}

static int read_fixed(const char *text, cal_options *o, fault *f) {
    char copy[256], *next = copy, *word;
    if (snprintf(copy, sizeof copy, "%s", text) >= (int)sizeof copy)
        return usage(f, "--fix", text, "a shorter list");
    while ((word = strsep(&next, ","))) {
        char *value = strchr(word, '='), *end = NULL;
        int i = 0;
        if (value)
            *value++ = 0;
        while (i < CAL_N && strcmp(word, cal_names[i]))
            i++;
        if (i == CAL_N)
            return usage(f, "--fix", word, "one of fx fy skew cx cy k1 k2 p1 p2 k3");
        o->fixed[i] = true;
        o->value[i] = value ? strtod(value, &end) : 0;
        if (value && (end == value || *end || !isfinite(o->value[i])))
            return usage(f, "--fix", value, "a number");
        if (i <= CAL_FY && !(o->value[i] > 0))
            return usage(f, "--fix", word, "a focal length above 0, as fx=800");
    }
    return 0;
}

enum { BOARD = 1, SQUARE, FIX, FLAT, REPORT, DISTANCE, FROM, TARGET, HAND_EYE, CAMERA, PRINT };

static int read_option(int c, void *self, fault *f) {
    command *m = self;
    switch (c) {
    case BOARD:
        return read_board("--board", optarg, &m->views.board, f);
    case PRINT:
        m->print = true;
        return read_board("--print-board", optarg, &m->views.board, f);
    case SQUARE:
        return read_positive("--square", optarg, "the side of a square in mm, above 0",
                             &m->views.board.square, f);
    case DISTANCE:
        return read_positive("--distance", optarg, "mm, above 0", &m->distance, f);
    case TARGET:
        return read_positive("--target", optarg, "µm, above 0", &m->target, f);
    case FIX:
        return read_fixed(optarg, &m->options, f);
    case FLAT:
        m->options.flat = true;
        return 0;
    case REPORT:
        m->report = optarg;
        return 0;
    case FROM:
        m->from = optarg;
        return 0;
    case HAND_EYE:
        m->hand_eye = optarg;
        return 0;
    case CAMERA:
        m->camera = optarg;
        return 0;
    default:
        m->output = optarg;
        return 0;
    }
}

/* 0, an error, or 1: the help was asked for. */
static int read_options(int argc, char **argv, command *m, fault *f) {
    static const struct option table[] = {{"board", required_argument, NULL, BOARD},
                                          {"square", required_argument, NULL, SQUARE},
                                          {"fix", required_argument, NULL, FIX},
                                          {"flat", no_argument, NULL, FLAT},
                                          {"report", required_argument, NULL, REPORT},
                                          {"distance", required_argument, NULL, DISTANCE},
                                          {"from", required_argument, NULL, FROM},
                                          {"target", required_argument, NULL, TARGET},
                                          {"hand-eye", required_argument, NULL, HAND_EYE},
                                          {"camera", required_argument, NULL, CAMERA},
                                          {"print-board", required_argument, NULL, PRINT},
                                          {"output", required_argument, NULL, 'o'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    int r =
        options_read(argc, argv, "ho:", table, read_option, m, "see `arris calibrate --help`", f);
    m->paths = argv + optind;
    m->n_paths = argc - optind;
    return r;
}

static int check_options(const command *m, fault *f) {
    static const char hint[] = "see `arris calibrate --help`";
    const int sources = (m->n_paths > 0) + (m->from != NULL) + (m->hand_eye != NULL) + m->print;
    if (m->views.board.cols == 0)
        return fault_set(f, ARRIS_E_USAGE, hint, "--board COLSxROWS is missing");
    if (m->views.board.square == 0)
        return fault_set(f, ARRIS_E_USAGE, hint, "--square MM, the side of a square, is missing");
    if (sources != 1)
        return fault_set(f, ARRIS_E_USAGE, hint,
                         "give it one of: pictures, --from, --hand-eye, --print-board");
    if (m->print && !m->output)
        return fault_set(f, ARRIS_E_USAGE, hint, "-o board.svg or board.pdf is missing");
    if (m->hand_eye && (m->report || m->distance > 0))
        return fault_set(f, ARRIS_E_USAGE, hint,
                         "--report and --distance are for the camera, not for --hand-eye");
    if (m->target > 0 && !m->from)
        return fault_set(f, ARRIS_E_USAGE, hint, "--target is for --from");
    if (m->camera && !m->hand_eye)
        return fault_set(f, ARRIS_E_USAGE, hint, "--camera is for --hand-eye");
    return 0;
}

/* ---- the camera ----------------------------------------------------------------------------- */

int command_fit(command *m, fault *f) {
    view_list *l = &m->views;
    m->options.width = l->width;
    m->options.height = l->height;
    int r = views_check(l, f);
    if (r < 0)
        return r;
    cal_leave_out_same(&l->board, l->item, l->n, &m->options);
    return cal_fit(&l->board, l->item, l->n, &m->options, &m->result, f);
}

static int write_files(const command *m, json_t *old, fault *f) {
    int r = 0;
    if (m->output)
        r = result_write_camera(m->output, old, &m->views, &m->options, &m->result, f);
    if (r == 0 && m->report)
        r = result_write_report(m->report, &m->views, &m->options, &m->result, &m->quality, f);
    return r;
}

static int calibrate_camera(command *m, fault *f) {
    json_t *old = m->output ? result_read_old(m->output, f) : NULL;
    if (m->output && !old)
        return ARRIS_E_INPUT;
    int r = m->from ? live_collect(m, f) : views_load(&m->views, m->paths, m->n_paths, f);
    if (r == 0)
        r = command_fit(m, f);
    if (r == 0)
        r = cal_assess(&m->views.board, m->views.item, m->views.n, &m->options, &m->result,
                       m->distance, &m->quality, f);
    if (r == 0) {
        result_print(stdout, &m->views, &m->options, &m->result, &m->quality);
        r = write_files(m, old, f);
    }
    json_decref(old);
    return r;
}

/* ---- the command ---------------------------------------------------------------------------- */

/* Below the error, as a part of it. */
static void name_left_out(const view_list *l) {
    for (int i = 0; i < l->n; i++)
        if (*l->item[i].left_out)
            fprintf(stderr, "  left out %s: %s\n", l->item[i].name, l->item[i].left_out);
}

static int run(int argc, char **argv) {
    command m = {.output = NULL};
    fault f = {.hint = NULL};
    int r = read_options(argc, argv, &m, &f);
    if (r == 1) {
        fputs(help, stdout);
        return 0;
    }
    if (r == 0)
        r = check_options(&m, &f);
    if (r == 0)
        r = m.print      ? print_board(&m.views.board, m.output, &f)
            : m.hand_eye ? handeye_command(&m, &f)
                         : calibrate_camera(&m, &f);
    int code = r < 0 ? fail(r, &f) : 0;
    if (r < 0)
        name_left_out(&m.views);
    views_free(&m.views);
    return code;
}

const arris_command_desc command_calibrate = {
    .size = sizeof(arris_command_desc),
    .name = "calibrate",
    .summary = "the camera from views of a chessboard, and the camera on the robot",
    .run = run,
};
