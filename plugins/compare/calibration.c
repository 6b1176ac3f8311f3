/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * calibration.c: the uncertainty that a camera.json states of itself.
 */
#include "calibration.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>

#include "arris_geometry.h"
#include "bytes.h"
#include "camera.h"

enum { MAX_FILE = 1 << 20 };

static int read_sigma(const json_t *sigma, const char *key, const char *path, double *v, fault *f) {
    const json_t *j = json_object_get(sigma, key);
    *v = json_number_value(j);
    return json_is_number(j) && *v >= 0
               ? 0
               : fault_set(f, ARRIS_E_INPUT, "`arris calibrate` writes such a file",
                           "%s: its calibration states no sigma of %s", path, key);
}

int calibration_read(calibration *c, const char *path, fault *f) {
    static const char *const keys[] = {"fx", "fy", "cx", "cy"};
    arris_camera camera;
    bytes b = {0};
    double v[4];
    int r = camera_load(path, &camera, f);
    if (r == 0)
        r = bytes_read(&b, path, MAX_FILE, f);
    json_t *root = r ? NULL : json_loadb((const char *)b.data, b.n, 0, NULL);
    const json_t *sigma = json_object_get(json_object_get(root, "calibration"), "sigma");
    for (int i = 0; i < 4 && r == 0; i++)
        r = read_sigma(sigma, keys[i], path, &v[i], f);
    json_decref(root);
    free(b.data);
    if (r)
        return r;
    c->focal = fmax(v[0] / camera.fx, v[1] / camera.fy);
    c->centre[0] = v[2] / camera.fx;
    c->centre[1] = v[3] / camera.fy;
    return 0;
}

void calibration_spread(const calibration *c, piece *e) {
    double X[3], Y[3];
    piece_point(e, 0, X);
    piece_point(e, 1, Y);
    for (int i = 0; i < 3; i++)
        X[i] = (X[i] + Y[i]) / 2 - c->C[i];
    double depth = arris_dot(c->R + 6, X);
    double by[3] = {depth * c->centre[0], depth * c->centre[1], depth * c->focal};
    for (int k = 0; k < 3; k++) {
        double s[2] = {by[k] * arris_dot(c->R + 3 * k, e->a),
                       by[k] * arris_dot(c->R + 3 * k, e->b)};
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++)
                e->cov[i][j] += s[i % 2] * s[j % 2];
    }
}
