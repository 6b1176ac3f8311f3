/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye_command.c: `arris calibrate --hand-eye`: flange.csv in, handeye.json out.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "camera.h"
#include "command.h"
#include "flange.h"
#include "handeye.h"

static const double DEGREES = 180 / 3.14159265358979323846;
enum { PATH_SIZE = 4096 };

static const double FEW_AXES = 0.2; /* of he_result's diversity */

/* ---- in ------------------------------------------------------------------------------------- */

/* A file's path, seen from the folder of the CSV. */
static int beside(const char *csv, const char *file, char path[PATH_SIZE], fault *f) {
    const char *slash = *file == '/' ? NULL : strrchr(csv, '/');
    const int folder = slash ? (int)(slash - csv) + 1 : 0;
    if (snprintf(path, PATH_SIZE, "%.*s%s", folder, csv, file) >= PATH_SIZE)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the path is too long: %.100s...", file);
    return 0;
}

static int load_views(command *m, const flange_list *list, fault *f) {
    char path[PATH_SIZE];
    int r = 0;
    for (int i = 0; r == 0 && i < list->n; i++)
        if ((r = beside(m->hand_eye, list->item[i].file, path, f)) == 0)
            r = views_load_picture(&m->views, path, f);
    return r == 0 ? views_check(&m->views, f) : r;
}

/* The camera.json that was given, or the one beside the CSV; else from the same pictures. */
static int find_camera(command *m, arris_camera *c, fault *f) {
    char path[PATH_SIZE];
    const char *file = m->camera;
    int r = file ? 0 : beside(m->hand_eye, "camera.json", path, f);
    if (r < 0)
        return r;
    if (!file && access(path, F_OK) == 0)
        file = path;
    if (file) {
        r = camera_load(file, c, f);
        if (r == 0 && (c->width != m->views.width || c->height != m->views.height))
            r = fault_set(f, ARRIS_E_INPUT, NULL, "%s is for pictures of %dx%d; these are %dx%d",
                          file, c->width, c->height, m->views.width, m->views.height);
        return r;
    }
    puts("there is no camera.json: the camera is calibrated from the same pictures");
    r = command_fit(m, f);
    *c = m->result.camera;
    return r;
}

/* ---- out ------------------------------------------------------------------------------------ */

static json_t *rigid_json(const cal_pose *p) {
    double w[3], n;
    cal_rotation_vector(p->R, w);
    n = arris_unit(w);
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "x", p->t[0], "y", p->t[1], "z",
                     p->t[2], "qw", cos(n / 2), "qx", sin(n / 2) * w[0], "qy", sin(n / 2) * w[1],
                     "qz", sin(n / 2) * w[2]);
}

static int write_handeye(const char *path, const he_result *h, fault *f) {
    json_t *cov = json_array();
    for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++)
            json_array_append_new(cov, json_real(h->cov[6 * i + j]));
    json_t *o = json_pack("{s:o, s:o, s:o, s:{s:f, s:f}, s:i}", "camera_to_flange",
                          rigid_json(&h->camera_to_flange), "cov", cov, "board_to_base",
                          rigid_json(&h->board_to_base), "robot_sigma", "position_mm", h->sigma_mm,
                          "rotation_rad", h->sigma_angle, "views", h->views);
    int r = o ? result_write_json(path, o, f)
              : fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %s", path);
    json_decref(o);
    return r;
}

static void print_views(const he_view *views, int n) {
    puts("view                       px by robot  px adjusted   px alone  robot off mm  degrees  "
         "held out mm");
    for (int i = 0; i < n; i++) {
        const he_view *v = &views[i];
        const char *slash = strrchr(v->view->name, '/'), *name = slash ? slash + 1 : v->view->name;
        if (*v->view->left_out)
            printf("%-26.26s left out: %s\n", name, v->view->left_out);
        else
            printf("%-26.26s %11.2f %12.3f %10.3f %13.2f %8.3f %12.2f\n", name, v->reported,
                   v->corrected, v->view->rms, v->off_mm, v->off_angle * DEGREES, v->held_out);
    }
}

static void print_pose(const char *name, const cal_pose *p, const double *cov) {
    double w[3];
    cal_rotation_vector(p->R, w);
    printf("%s\n", name);
    for (int i = 0; i < 6; i++) {
        printf("  %-10s %11.4f",
               (const char *[]){"x mm", "y mm", "z mm", "turn x °", "turn y °", "turn z °"}[i],
               i < 3 ? p->t[i] : w[i - 3] * DEGREES);
        if (cov)
            printf(" ± %.4f", sqrt(cov[7 * i]) * (i < 3 ? 1 : DEGREES));
        putchar('\n');
    }
}

static void print_result(const he_view *views, int n, const he_result *h) {
    print_views(views, n);
    print_pose("\ncamera on the flange (± 1 sigma)", &h->camera_to_flange, h->cov);
    print_pose("board in the base", &h->board_to_base, NULL);
    printf(
        "\n%d of %d views. Corners: %.3f px rms by each view's own pose; %.2f px by the robot's; "
        "%.3f px when the robot's poses are corrected as far as their noise allows.\n",
        h->views, n, h->corner_px, h->reported_px, h->corrected_px);
    printf("The robot is off by %.2f mm and %.3f° (rms over the views): its reported poses scatter "
           "by %.2f mm along and %.3f° about each axis.\n",
           h->off_mm, h->off_angle * DEGREES, h->sigma_mm, h->sigma_angle * DEGREES);
    printf("Held-out views: off by %.2f mm.\n", h->held_out);
    printf("The board's origin seen from the base scatters by %.2f, %.2f, %.2f mm along x, y, z.\n",
           h->scatter[0], h->scatter[1], h->scatter[2]);
    if (h->diversity < FEW_AXES)
        printf("warning: the flange turned almost about one axis only (%.2f of 1): the camera's "
               "position along it is poorly known; turn it about another one too\n",
               h->diversity);
}

/* ---- the whole ------------------------------------------------------------------------------ */

static int fit_and_write(command *m, const flange_list *list, fault *f) {
    he_view *views = calloc((size_t)list->n, sizeof *views);
    arris_camera camera;
    he_result result;
    int r = views ? load_views(m, list, f)
                  : fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the views");
    if (r == 0)
        r = find_camera(m, &camera, f);
    for (int i = 0; r == 0 && i < m->views.n; i++)
        views[i] = (he_view){.view = &m->views.item[i], .flange = list->item[i].pose};
    if (r == 0)
        r = he_fit(&m->views.board, &camera, views, m->views.n, &result, f);
    if (r == 0) {
        print_result(views, m->views.n, &result);
        r = m->output ? write_handeye(m->output, &result, f) : 0;
    }
    free(views);
    return r;
}

int handeye_command(command *m, fault *f) {
    flange_list list;
    int r = flange_load(&list, m->hand_eye, f);
    if (r == 0)
        r = fit_and_write(m, &list, f);
    flange_free(&list);
    return r;
}
