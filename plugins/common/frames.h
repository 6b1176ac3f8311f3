/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * frames.h: the frames of a recording, from a frames.csv or a folder of pictures.
 *
 * A frames.csv has a line a frame with the columns
 *     index,file,utime,x,y,z,omega,theta,kappa
 * (mm, rad, µs); the six of the pose may all be empty. `file` is relative to the CSV. A folder's
 * pictures come in the order of their names, numbers in them by value, without poses.
 */
#ifndef FRAMES_H
#define FRAMES_H

#include <dirent.h>

#include "fault.h"

enum { FRAMES_MAX = 1000000, FRAMES_PATH = 4096 };

typedef struct frame_entry {
    const char *file; /* relative to the list's folder, or absolute */
    int64_t index, utime;
    bool posed;
    double pose[6]; /* x, y, z, omega, theta, kappa; as they are in the file */
} frame_entry;

typedef struct frame_list {
    char folder[FRAMES_PATH]; /* with its slash; empty: the working directory */
    size_t n;
    frame_entry *item;
    bool posed;            /* at least one frame has a pose */
    char *text;            /* the CSV, which `file` points into */
    struct dirent **names; /* or the folder's entries */
} frame_list;

/* Reads the frames.csv or the folder at `location`. A folder's utime counts from 0 by `interval`,
 * in µs. frames_free must follow in any case. Returns 0 or ARRIS_E_INPUT, _IO, _MEMORY. */
int frames_load(frame_list *l, const char *location, double interval, fault *f);

/* The n bytes of a frames.csv, followed by a zero byte; it is changed, and must outlive *l. The
 * rest is as in frames_load; `l` comes zeroed. */
int frames_parse(frame_list *l, char *text, size_t n, const char *path, fault *f);

void frames_free(frame_list *l);

/* Joins `file` to the list's folder. Returns 0, or ARRIS_E_INPUT when it is too long. */
int frames_path(const frame_list *l, const char *file, char path[FRAMES_PATH], fault *f);

/* The frame's pose: R by eq. 2.7, its covariance unknown; invalid when the frame has none. */
void frames_pose(const frame_entry *e, arris_pose *pose);

/* The order of names as people count: "9.png" before "10.png". As strcmp. */
int frames_compare_names(const char *a, const char *b);

#endif
