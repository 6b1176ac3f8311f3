/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * command.h: `arris calibrate`, between the files that do its tasks.
 */
#ifndef CALIBRATE_COMMAND_H
#define CALIBRATE_COMMAND_H

#include "arris.h"
#include "arris_plugin.h"
#include "result.h"

typedef struct command {
    /* what the words say */
    const char *output, *report, *from, *hand_eye, *camera; /* NULL: not given */
    bool print;
    double distance, target; /* mm, µm; 0: not given */
    char **paths;
    int n_paths;
    cal_options options;
    /* what becomes of it */
    view_list views;
    cal_result result;
    cal_quality quality;
} command;

/* Fits the camera to the views. Returns 0 or an error. */
int command_fit(command *m, fault *f);

/* live.c: collects views from the pipeline m->from until the target is reached, the stream ends or
 * Ctrl-C is pressed. */
int live_collect(command *m, fault *f);

/* handeye_command.c: --hand-eye, whole. */
int handeye_command(command *m, fault *f);

/* print_board.c: a board to print, as SVG or PDF by the ending of `path`. */
int print_board(const cal_board *b, const char *path, fault *f);

#endif
