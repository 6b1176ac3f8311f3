/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scenesrc.c: the stage `scenesrc`: a simulated camera in a simulated cell.
 *
 * It renders an OBJ or STL scene: faces of even grey under parallel light, with cast shadows,
 * through the lens of camera.json. Edges are exact: no raster decides where they are (sweep.h,
 * draw.h). What the camera reports, time and pose, is the truth, unless jitter= is given; with
 * robot= the stage `pose` replaces the truth with what the robot reported.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "arris_plugin.h"
#include "camera.h"
#include "follow.h"
#include "frames.h"
#include "link.h"
#include "mix.h"
#include "route.h"
#include "view.h"

enum {
    SLICE = 100000000 /* ns */,
    WAIT = 100000000 /* ns, for the robot's word */,
    HELD = 8 /* frames */,
    FRAMES = 135
};

struct scenesrc {
    const char *location, *camera_path, *poses, *robot, *handeye;
    int32_t frames, seed, kind;
    double fps, psf, noise, jitter, jitter_rot, light[3];
    bool live;
    view_light shade;
    route route;

    frame_list list; /* of poses= */
    arris_camera camera;
    cell cell;
    view *view;
    follow *follow;    /* NULL: on its own path */
    int64_t next, end; /* frames; end 0: none */
    int64_t began;     /* ns: when a live camera took frame 0; 0: not yet */
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

/* Without a direction it comes over the camera's left shoulder, as that is turned half way or in
 * the first pose of a list. */
static void find_light(const struct scenesrc *c, double light[3]) {
    static const double shoulder[3] = {0.35, 0.25, 0.9};
    arris_pose pose;
    memcpy(light, c->light, sizeof c->light);
    if (arris_dot(light, light) > 0)
        return;
    route_pose(&c->route, 0, 1, &pose);
    if (c->poses)
        frames_pose(&c->list.item[0], &pose);
    for (int k = 0; k < 3; k++)
        light[k] =
            pose.R[k] * shoulder[0] + pose.R[3 + k] * shoulder[1] + pose.R[6 + k] * shoulder[2];
}

static int load_cell(struct scenesrc *c, size_t *flat, fault *f) {
    mesh m;
    int r = mesh_load(&m, c->location, f);
    if (r == 0)
        r = cell_build(&c->cell, &m, f);
    *flat = m.flat;
    mesh_free(&m);
    double light[3];
    find_light(c, light);
    return r == 0 ? cell_light_up(&c->cell, light, f) : r;
}

static int load_route(struct scenesrc *c, fault *f) {
    c->route.kind = (enum route_kind)c->kind;
    c->end = c->frames >= 0 ? c->frames : c->robot ? 0 : FRAMES;
    c->live |= c->robot != NULL;
    if (c->robot && (c->poses || c->jitter > 0 || c->jitter_rot > 0))
        return fault_set(f, ARRIS_E_USAGE, "leave out poses=, jitter= and jitter-rot=, or robot=",
                         "with robot= the robot alone says where the camera is");
    if (c->handeye && !c->robot)
        return fault_set(f, ARRIS_E_USAGE, "give robot= too, or leave handeye= out",
                         "handeye= is of the robot that is followed, and there is none");
    if (c->robot)
        return follow_new(&c->follow, c->robot, c->handeye, f);
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

/* µs from frame 0 to frame i. */
static int64_t since_start(const struct scenesrc *c, int64_t i) {
    return (int64_t)((double)i * 1e6 / c->fps);
}

/* A live camera exposes when it is time, whatever the host does; its driver holds some frames for
 * one that comes late, and those before are lost. Returns the time of exposure, µs since the epoch.
 */
static int64_t wait_for_exposure(arris_stage *s, struct scenesrc *c) {
    int64_t now = arris_now();
    if (c->began == 0)
        c->began = now;
    while (c->began + 1000 * since_start(c, c->next + HELD) < now) {
        arris_count(s, "frames lost", 1);
        c->next++;
    }
    int64_t due = c->began + 1000 * since_start(c, c->next);
    for (; now < due && arris_running(s); now = arris_now()) {
        int64_t until = due < now + SLICE ? due : now + SLICE;
        struct timespec t = {.tv_sec = until / 1000000000, .tv_nsec = until % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
    }
    return link_utime() - (arris_now() - due) / 1000;
}

/* Where the camera is in frame i: as the robot that it follows was at utime, or as its path says.
 * False: nobody knows. */
static bool find_pose(arris_stage *s, struct scenesrc *c, int64_t i, int64_t utime,
                      arris_pose *pose) {
    if (c->robot) {
        bool known = follow_pose(c->follow, utime, arris_now() + WAIT, pose);
        arris_trouble(s, known ? NULL : "the simulated robot does not say where it is");
        return known;
    }
    if (c->poses)
        frames_pose(&c->list.item[i], pose);
    else
        route_pose(&c->route, i, c->end, pose);
    return true;
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    struct scenesrc *c = self;
    int64_t exposed = c->live ? wait_for_exposure(s, c) : 0, i = c->next++;
    if ((c->end > 0 && i >= c->end) || !arris_running(s))
        return ARRIS_END;
    const frame_entry *e = c->poses ? &c->list.item[i] : NULL;
    int64_t utime = c->live ? exposed : e ? e->utime : since_start(c, i);
    arris_pose *pose = arris_layer_give(s, frame, ARRIS_POSE);
    if (!find_pose(s, c, i, utime, pose)) {
        arris_count(s, "without the robot", 1);
        return ARRIS_DROP;
    }
    uint64_t seed = mix_at((uint64_t)c->seed, (uint64_t)i);
    arris_pose truth = *pose;
    if (c->jitter > 0 || c->jitter_rot > 0)
        route_shake(&truth, c->jitter, c->jitter_rot, mix(seed));
    arris_image *image = arris_layer_give(s, frame, ARRIS_IMAGE);
    image->camera = &c->camera;
    view_take(c->view, &truth, c->noise, seed, image);
    arris_frame_set(frame, e ? e->index : i, utime);
    return 0;
}

static void close_scene(arris_stage *s, void *self) {
    (void)s;
    struct scenesrc *c = self;
    follow_free(c->follow);
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
    ARRIS_P_STRING(T, robot, "robot", NULL,
                   "the LCM URL, or default, of a simulated robot: the camera is live and goes "
                   "where that truly is (ROBOT_TRUTH)"),
    ARRIS_P_INFILE(T, handeye, "handeye", NULL,
                   "a handeye.json: how the camera sits on the robot; else the robot's pose is "
                   "the camera's"),
    ARRIS_P_INT_OR(T, frames, "frames", "auto", "auto", 0, FRAMES_MAX, NULL,
                   "how many; 0: without end; auto: 135, as many as there are poses, or, following "
                   "a robot, without end"),
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
    ARRIS_P_DOUBLE(T, light[0], "light-x", "0", -1, 1, NULL,
                   "the way in the world that the light goes; all 0: from over the shoulder of the "
                   "camera as omega, theta and kappa, or the first of poses=, have it"),
    ARRIS_P_DOUBLE(T, light[1], "light-y", "0", -1, 1, NULL, "likewise"),
    ARRIS_P_DOUBLE(T, light[2], "light-z", "0", -1, 1, NULL, "likewise"),
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
