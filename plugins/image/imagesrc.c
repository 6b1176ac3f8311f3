/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * imagesrc.c: the stage `imagesrc`: a recorded scan, from a frames.csv or a folder of pictures,
 * with the camera.json beside them.
 *
 * The first picture settles size and format for all. The layer POSE is there when at least one
 * frame of the list has a pose; in the others it is invalid. With loop=, utime goes on rising.
 */
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "arris_plugin.h"
#include "bytes.h"
#include "camera.h"
#include "frames.h"
#include "handeye.h"
#include "picture.h"
#include "rigid.h"

enum { MAX_FILE = 1 << 30, ROOM = 1 << 16 /* bytes */, SLICE = 100000000 /* ns */ };

static const char picture_hint[] =
    "every picture of the list must be there, whole, and like the first in size and depth: leave "
    "this one out, or record it again";

struct imagesrc {
    const char *location, *camera_path, *handeye_path;
    int32_t loop, start, stop, step;
    double fps;

    frame_list frames;
    arris_camera camera;
    const arris_camera *known_camera; /* &camera, or NULL */
    handeye handeye;
    picture_info info; /* of the first picture, and so of all */
    bytes file;
    size_t next, end; /* entries of the list */
    int32_t round;
    uint64_t lap, shift; /* µs: what a round adds to utime, and what the rounds so far have added */
    int64_t due;         /* ns, of the next frame when paced; 0: it has not begun */
};

/* ---- what there is to play ------------------------------------------------------------------- */

/* From frame to frame where the recording has no times, µs: 40 ms when fps does not say. */
static double interval(const struct imagesrc *i) {
    return 1e6 / (i->fps > 0 ? i->fps : 25);
}

static int load_frames(const struct imagesrc *i, frame_list *l, fault *f) {
    if (!i->location)
        return fault_set(f, ARRIS_E_USAGE, "give it a frames.csv, or a folder of pictures",
                         "no location= is given");
    if (i->fps > 0 && i->fps < 0.001)
        return fault_set(f, ARRIS_E_USAGE, "fps=0 plays as fast as it goes",
                         "fps=%g: it must be 0, or at least 0.001", i->fps);
    return frames_load(l, i->location, interval(i), f);
}

static int select_frames(struct imagesrc *i, fault *f) {
    size_t n = i->frames.n;
    i->next = (size_t)i->start;
    i->end = i->stop < 0 || (size_t)i->stop > n ? n : (size_t)i->stop;
    if (i->next < i->end)
        return 0;
    return fault_set(f, ARRIS_E_USAGE, "start= counts from 0, and must be below stop=",
                     "from start=%d to %zu there is no frame; the list has %zu", i->start, i->end,
                     n);
}

/* A round lasts from its earliest frame to its latest and one mean step more. */
static void measure_lap(struct imagesrc *i) {
    int64_t first = INT64_MAX, last = INT64_MIN, n = 0;
    for (size_t k = i->next; k < i->end; k += (size_t)i->step, n++) {
        int64_t t = i->frames.item[k].utime;
        first = t < first ? t : first;
        last = t > last ? t : last;
    }
    int64_t mean = last - first >= n ? (last - first) / (n - 1) : (int64_t)interval(i);
    i->lap = (uint64_t)(last - first + mean);
}

static int find_camera(struct imagesrc *i, fault *f) {
    char path[FRAMES_PATH];
    const char *file = i->camera_path;
    if (!file) {
        int r = frames_path(&i->frames, "camera.json", path, f);
        if (r < 0 || access(path, F_OK) != 0)
            return r;
        file = path;
    }
    int r = camera_load(file, &i->camera, f);
    if (r < 0)
        return r;
    i->known_camera = &i->camera;
    if (i->camera.width == i->info.width && i->camera.height == i->info.height)
        return 0;
    return fault_set(f, ARRIS_E_INPUT, "name the camera that took them with camera=",
                     "%s is of a camera of %dx%d, and the pictures are %dx%d", file,
                     i->camera.width, i->camera.height, i->info.width, i->info.height);
}

/* ---- one picture ----------------------------------------------------------------------------- */

static int open_picture(struct imagesrc *i, const char *path, picture_info *info, fault *f) {
    fault why;
    int r = bytes_read(&i->file, path, MAX_FILE, f);
    if (r < 0)
        return r;
    r = picture_read_info(i->file.data, i->file.n, info, &why);
    return r < 0 ? fault_set(f, r, why.hint, "%s: %s", path, why.text) : 0;
}

/* Room for every picture that is not bigger than its grey levels, and then some. */
static int read_first(struct imagesrc *i, fault *f) {
    char path[FRAMES_PATH];
    int r = frames_path(&i->frames, i->frames.item[i->next].file, path, f);
    if (r == 0)
        r = open_picture(i, path, &i->info, f);
    if (r < 0)
        return r;
    size_t grey = (size_t)i->info.width * (size_t)i->info.height * i->info.format;
    return bytes_reserve(&i->file, (grey > i->file.n ? grey : i->file.n) + ROOM, f);
}

static int read_picture(struct imagesrc *i, const char *path, const arris_image *out, fault *f) {
    picture_info info;
    fault why;
    int r = open_picture(i, path, &info, f);
    if (r < 0)
        return r;
    if (info.width != out->width || info.height != out->height || info.format != out->format)
        return fault_set(f, ARRIS_E_INPUT, NULL,
                         "%s is %dx%d with %d bits; the first picture is %dx%d with %d", path,
                         info.width, info.height, 8 * info.format, out->width, out->height,
                         8 * out->format);
    r = picture_decode(i->file.data, i->file.n, out, &why);
    return r < 0 ? fault_set(f, r, why.hint, "%s: %s", path, why.text) : 0;
}

/* ---- the stage ------------------------------------------------------------------------------- */

static int settle(arris_stage *s, void *self, arris_layers *l) {
    frame_list list = {.n = 0};
    fault f;
    int r = load_frames(self, &list, &f);
    if (!list.posed)
        l->gives &= ~ARRIS_BIT(ARRIS_POSE);
    frames_free(&list);
    return r < 0 ? arris_fail(s, r, f.hint, "%s", f.text) : 0;
}

static int prepare(struct imagesrc *i, fault *f) {
    int r = load_frames(i, &i->frames, f);
    if (r == 0)
        r = select_frames(i, f);
    if (r == 0)
        r = read_first(i, f);
    if (r == 0)
        r = find_camera(i, f);
    if (r == 0)
        measure_lap(i);
    return r == 0 && i->handeye_path ? handeye_load(i->handeye_path, &i->handeye, f) : r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct imagesrc *i = self;
    fault f;
    int r = prepare(i, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    *caps = (arris_caps){.format = i->info.format,
                         .width = i->info.width,
                         .height = i->info.height,
                         .fps = i->fps,
                         .camera = i->known_camera};
    arris_set_live(s, i->fps > 0);
    if (i->frames.posed && (r = arris_reserve(s, ARRIS_POSE, 0, 0)) < 0)
        return r;
    return arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

/* Waits as a camera makes one wait. One that comes late is not caught up with by hurrying. */
static void wait_until_due(const arris_stage *s, struct imagesrc *i) {
    int64_t period = (int64_t)(1e9 / i->fps), now = arris_now();
    if (i->due == 0 || now > i->due + period)
        i->due = now;
    for (; now < i->due && arris_running(s); now = arris_now()) {
        int64_t until = i->due < now + SLICE ? i->due : now + SLICE;
        struct timespec t = {.tv_sec = until / 1000000000, .tv_nsec = until % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
    }
    i->due += period;
}

/* False when all rounds are played. */
static bool begin_round(struct imagesrc *i) {
    if (i->loop > 0 && ++i->round == i->loop)
        return false;
    i->next = (size_t)i->start;
    i->shift += i->lap;
    return true;
}

static void give_pose(const struct imagesrc *i, const frame_entry *e, arris_pose *pose) {
    frames_pose(e, pose);
    if (i->handeye_path && pose->valid)
        rigid_move(pose, i->handeye.t, i->handeye.q);
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    struct imagesrc *i = self;
    char path[FRAMES_PATH];
    fault f;
    if (i->next >= i->end && !begin_round(i))
        return ARRIS_END;
    const frame_entry *e = &i->frames.item[i->next];
    i->next += (size_t)i->step;
    arris_image *image = arris_layer_give(s, frame, ARRIS_IMAGE);
    image->camera = i->known_camera;
    int r = frames_path(&i->frames, e->file, path, &f);
    if (r == 0)
        r = read_picture(i, path, image, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint ? f.hint : picture_hint, "%s", f.text);
    if (i->frames.posed)
        give_pose(i, e, arris_layer_give(s, frame, ARRIS_POSE));
    if (i->fps > 0)
        wait_until_due(s, i);
    arris_frame_set(frame, e->index, (int64_t)((uint64_t)e->utime + i->shift));
    return arris_running(s) ? 0 : ARRIS_END;
}

static void close_files(arris_stage *s, void *self) {
    (void)s;
    struct imagesrc *i = self;
    frames_free(&i->frames);
    free(i->file.data);
}

#define T struct imagesrc
static const arris_prop props[] = {
    ARRIS_P_INFILE(T, location, "location", NULL, "a frames.csv, or a folder of pictures"),
    ARRIS_P_INFILE(
        T, camera_path, "camera", NULL,
        "a camera.json; without it, the one beside the pictures' list when there is one"),
    ARRIS_P_INFILE(T, handeye_path, "handeye", NULL,
                   "a handeye.json: the poses are the flange's, and the camera sits on it"),
    ARRIS_P_INT(T, loop, "loop", "1", 0, INT32_MAX, NULL, "how often it plays; 0: for ever"),
    ARRIS_P_INT(T, start, "start", "0", 0, FRAMES_MAX, NULL, "the first frame of the list, from 0"),
    ARRIS_P_INT_OR(T, stop, "stop", "end", "end", 0, FRAMES_MAX, NULL,
                   "the frame of the list before which it ends"),
    ARRIS_P_INT(T, step, "step", "1", 1, FRAMES_MAX, NULL, "takes every step-th frame"),
    ARRIS_P_DOUBLE(T, fps, "fps", "0", 0, 1000, "1/s",
                   "plays as a live camera would; 0: as fast as it goes. The utime stays the "
                   "recording's; a folder's pictures count from 0 by 1/fps, or by 40 ms"),
};

const arris_stage_desc stage_imagesrc = {
    .size = sizeof(arris_stage_desc),
    .name = "imagesrc",
    .summary = "a recorded scan: PNG, JPEG or PGM pictures with poses and camera",
    .example = "imagesrc location=samples/box/frames.csv ! fakesink",
    .flags = ARRIS_SOURCE | ARRIS_AHEAD,
    .layers = {.gives = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_POSE)},
    .self_size = sizeof(struct imagesrc),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .close = close_files,
};
