/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scenesrc.c: the stage `scenesrc`: a simulated camera in a simulated cell.
 *
 * It renders an OBJ or STL scene: faces of even grey under parallel light, with cast shadows,
 * through the lens of camera.json. Edges are exact: no raster decides where they are (sweep.h,
 * draw.h). What the camera reports, time and pose, is the truth, unless jitter= is given.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "arris_plugin.h"
#include "camera.h"
#include "frames.h"
#include "mix.h"
#include "route.h"
#include "view.h"

enum { SLICE = 100000000 /* ns */, FRAMES = 135 };

struct scenesrc {
    const char *location, *camera_path, *poses;
    int32_t frames, seed, kind;
    double fps, psf, noise, jitter, jitter_rot, light[3];
    bool live;
    view_light shade;
    route route;

    frame_list list; /* of poses= */
    arris_camera camera;
    cell cell;
    view *view;
    int64_t next, end;          /* frames; end 0: none */
    int64_t began, began_utime; /* ns and µs: frame 0 of a live camera; 0: not yet */
};

/* ---- what there is to see -------------------------------------------------------------------- */

static int find_camera(struct scenesrc *c, fault *f) {
    char beside[FRAMES_PATH];
    const char *slash = strrchr(c->location, '/');
    int folder = slash ? (int)(slash - c->location) + 1 : 0;
    if (c->camera_path)
        return camera_load(c->camera_path, &c->camera, f);
    if (snprintf(beside, sizeof beside, "%.*scamera.json", folder, c->location) >= FRAMES_PATH)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the path of the scene is too long");
    return camera_load(beside, &c->camera, f);
}

static int check_picture(const arris_camera *c, fault *f) {
    if (c->width <= 8192 && c->height <= 8192)
        return 0;
    return fault_set(f, ARRIS_E_INPUT, NULL, "the camera's picture is %dx%d; the limit is 8192",
                     c->width, c->height);
}

static int load_cell(struct scenesrc *c, size_t *flat, fault *f) {
    mesh m;
    int r = mesh_load(&m, c->location, f);
    if (r == 0)
        r = cell_build(&c->cell, &m, f);
    *flat = m.flat;
    mesh_free(&m);
    if (r == 0 && arris_dot(c->light, c->light) < 1e-12)
        r = fault_set(f, ARRIS_E_USAGE, "for straight down the camera's axis: light-z=1",
                      "light-x, light-y and light-z are all 0: the light has no direction");
    return r == 0 ? cell_light_up(&c->cell, c->light, f) : r;
}

static int load_route(struct scenesrc *c, fault *f) {
    c->route.kind = (enum route_kind)c->kind;
    c->end = c->frames >= 0 ? c->frames : FRAMES;
    if (!c->poses)
        return 0;
    int r = frames_load(&c->list, c->poses, 0, f);
    int64_t n = (int64_t)c->list.n;
    c->end = c->frames > 0 && c->frames < n ? c->frames : n;
    for (int64_t i = 0; r == 0 && i < c->end; i++)
        if (!c->list.item[i].posed)
            r = fault_set(f, ARRIS_E_INPUT, "poses= is a frames.csv with a pose in every line",
                          "%s: frame %lld has no pose", c->poses, (long long)c->list.item[i].index);
    return r;
}

static int prepare(struct scenesrc *c, size_t *flat, fault *f) {
    if (!c->location)
        return fault_set(f, ARRIS_E_USAGE, "give it a scene: an OBJ or STL file in mm",
                         "no location= is given");
    int r = load_route(c, f);
    if (r == 0)
        r = find_camera(c, f);
    if (r == 0)
        r = check_picture(&c->camera, f);
    if (r == 0)
        r = load_cell(c, flat, f);
    return r == 0 ? view_new(&c->view, &c->cell, &c->camera, c->psf, &c->shade, f) : r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct scenesrc *c = self;
    size_t flat = 0;
    fault f;
    int r = prepare(c, &flat, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    if (flat > 0)
        arris_warn(s, "%s: %zu faces without area are left out", c->location, flat);
    *caps = (arris_caps){.format = ARRIS_GREY8,
                         .width = c->camera.width,
                         .height = c->camera.height,
                         .fps = c->live ? c->fps : 0,
                         .camera = &c->camera};
    arris_set_live(s, c->live);
    if ((r = arris_reserve(s, ARRIS_POSE, 0, 0)) < 0)
        return r;
    return arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

/* ---- frame by frame -------------------------------------------------------------------------- */

static int64_t utime_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

/* µs from frame 0 to frame i. */
static int64_t since_start(const struct scenesrc *c, int64_t i) {
    return (int64_t)((double)i * 1e6 / c->fps);
}

/* A live camera exposes when it is time. A frame whose time has gone by meanwhile is lost, as with
 * any camera. */
static void wait_for_exposure(arris_stage *s, struct scenesrc *c) {
    int64_t now = arris_now();
    if (c->began == 0) {
        c->began = now;
        c->began_utime = utime_now();
    }
    while (c->began + 1000 * since_start(c, c->next + 1) < now) {
        arris_count(s, "frames lost", 1);
        c->next++;
    }
    int64_t due = c->began + 1000 * since_start(c, c->next);
    for (; now < due && arris_running(s); now = arris_now()) {
        int64_t until = due < now + SLICE ? due : now + SLICE;
        struct timespec t = {.tv_sec = until / 1000000000, .tv_nsec = until % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
    }
}

/* The pose that the camera reports for the frame; its index and utime. */
static void report(const struct scenesrc *c, int64_t i, arris_pose *pose, int64_t *index,
                   int64_t *utime) {
    *index = i;
    *utime = since_start(c, i);
    if (c->poses) {
        const frame_entry *e = &c->list.item[i];
        frames_pose(e, pose);
        *index = e->index;
        *utime = e->utime;
    } else {
        route_pose(&c->route, i, c->end, pose);
    }
    if (c->live)
        *utime = c->began_utime + since_start(c, i);
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    struct scenesrc *c = self;
    int64_t index, utime;
    if (c->live)
        wait_for_exposure(s, c);
    int64_t i = c->next++;
    if ((c->end > 0 && i >= c->end) || !arris_running(s))
        return ARRIS_END;
    arris_pose *pose = arris_layer_give(s, frame, ARRIS_POSE), truth;
    arris_image *image = arris_layer_give(s, frame, ARRIS_IMAGE);
    uint64_t seed = mix_at((uint64_t)c->seed, (uint64_t)i);
    report(c, i, pose, &index, &utime);
    truth = *pose;
    if (c->jitter > 0 || c->jitter_rot > 0)
        route_shake(&truth, c->jitter, c->jitter_rot, mix(seed));
    image->camera = &c->camera;
    view_take(c->view, &truth, c->noise, seed, image);
    arris_frame_set(frame, index, utime);
    return 0;
}

static void close_scene(arris_stage *s, void *self) {
    (void)s;
    struct scenesrc *c = self;
    view_free(c->view);
    cell_free(&c->cell);
    frames_free(&c->list);
}

#define T struct scenesrc
static const arris_prop props[] = {
    ARRIS_P_INFILE(T, location, "location", NULL,
                   "the scene, an OBJ or STL file in mm. A face has the grey level of its "
                   "material's colour; of faces in one plane the later lies on top, as paint"),
    ARRIS_P_INFILE(T, camera_path, "camera", NULL, "a camera.json; else the one beside the scene"),
    ARRIS_P_ENUM(T, kind, "path", "x", "x|y|arc",
                 "straight along the camera's own axis, or on an arc across it"),
    ARRIS_P_INFILE(T, poses, "poses", NULL, "a frames.csv whose poses are taken instead"),
    ARRIS_P_INT_OR(T, frames, "frames", "auto", "auto", 0, FRAMES_MAX, NULL,
                   "how many; 0: without end; auto: 135, or as many as there are poses"),
    ARRIS_P_DOUBLE(T, route.step, "step", "4.1", -1000, 1000, "mm", "from frame to frame"),
    ARRIS_P_DOUBLE(T, route.radius, "radius", "800", 1, 1e5, "mm", "of the arc"),
    ARRIS_P_DOUBLE(T, route.middle[0], "x", "0", -1e5, 1e5, "mm", "the middle of the path"),
    ARRIS_P_DOUBLE(T, route.middle[1], "y", "0", -1e5, 1e5, "mm", "likewise"),
    ARRIS_P_DOUBLE(T, route.middle[2], "z", "0", -1e5, 1e5, "mm", "likewise"),
    ARRIS_P_DOUBLE(T, route.middle[3], "omega", "0", -7, 7, "rad",
                   "how the camera is turned there"),
    ARRIS_P_DOUBLE(T, route.middle[4], "theta", "0", -7, 7, "rad", "likewise"),
    ARRIS_P_DOUBLE(T, route.middle[5], "kappa", "0", -7, 7, "rad", "likewise"),
    ARRIS_P_DOUBLE(T, fps, "fps", "30", 0.001, 1000, "1/s", "frames a second"),
    ARRIS_P_BOOL(T, live, "live", "false", "takes them in real time, not as fast as it goes"),
    ARRIS_P_DOUBLE(T, psf, "psf", "0.8", DRAW_MIN_PSF, 5, "px",
                   "sigma of the lens's blur; the pixel's own area comes to it"),
    ARRIS_P_DOUBLE(T, noise, "noise", "2", 0, 100, "levels", "sigma of a pixel"),
    ARRIS_P_INT(T, seed, "seed", "1", 0, INT32_MAX, NULL, "another one, other noise and jitter"),
    ARRIS_P_DOUBLE(T, jitter, "jitter", "0", 0, 100, "mm",
                   "sigma, on each axis, of where the camera is from where it reports to be"),
    ARRIS_P_DOUBLE(T, jitter_rot, "jitter-rot", "0", 0, 0.1, "rad", "likewise, of its rotation"),
    ARRIS_P_DOUBLE(T, light[0], "light-x", "0.35", -1, 1, NULL, "the way that the light goes"),
    ARRIS_P_DOUBLE(T, light[1], "light-y", "0.25", -1, 1, NULL, "likewise"),
    ARRIS_P_DOUBLE(T, light[2], "light-z", "0.9", -1, 1, NULL, "likewise"),
    ARRIS_P_DOUBLE(T, shade.ambient, "ambient", "0.4", 0, 1, NULL,
                   "the share of light that comes from everywhere; 1: no shadows"),
    ARRIS_P_DOUBLE(T, shade.background, "background", "20", 0, 255, "levels",
                   "where there is nothing"),
};

const arris_stage_desc stage_scenesrc = {
    .size = sizeof(arris_stage_desc),
    .name = "scenesrc",
    .summary = "a simulated camera in a simulated cell: renders a CAD scene",
    .example = "scenesrc location=samples/cell/box.obj frames=5 ! fakesink",
    .flags = ARRIS_SOURCE | ARRIS_AHEAD,
    .layers = {.gives = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_POSE)},
    .self_size = sizeof(struct scenesrc),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_scene,
};
