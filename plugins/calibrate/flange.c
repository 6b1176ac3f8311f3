/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * flange.c: flange.csv (flange.h).
 */
#include "flange.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "fit.h"

enum { MAX_CSV = 64 << 20, FILE_NAME = 0, FIRST = 1, COLUMNS = 8 };

static const char *const names[COLUMNS] = {"file", "x", "y", "z", "qw", "qx", "qy", "qz"};
static const char hint[] =
    "flange.csv has the columns index,file,utime,x,y,z,qw,qx,qy,qz: mm, and a unit quaternion that "
    "turns the flange's axes to the base's";

static cal_pose pose_of(const double v[7]) {
    const double n = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
    const double w = v[3] / n, x = v[4] / n, y = v[5] / n, z = v[6] / n;
    return (cal_pose){.R = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
                      .t = {v[0], v[1], v[2]}};
}

static int read_entry(const csv *c, const int *column, flange_entry *e, fault *f) {
    double v[7];
    int r = 0;
    e->file = c->field[column[FILE_NAME]];
    if (!*e->file)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: file: this is empty", c->path, c->line);
    for (int k = 0; r == 0 && k < 7; k++)
        r = csv_number(c, column[FIRST + k], &v[k], f);
    if (r < 0)
        return r;
    const double n = v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6];
    if (fabs(n - 1) > 2e-3)
        return fault_set(f, ARRIS_E_INPUT, NULL,
                         "%s:%d: qw, qx, qy, qz have the length %.4f, not 1", c->path, c->line,
                         sqrt(n));
    e->pose = pose_of(v);
    return 0;
}

static int read_rows(flange_list *l, csv *c, fault *f) {
    int column[COLUMNS], max = 0;
    int r = csv_columns(c, names, COLUMNS, column, f);
    while (r == 0 && (r = csv_next(c, f)) > 0) {
        if (l->n == CAL_MAX_VIEWS)
            return fault_set(f, ARRIS_E_INPUT, NULL, "%s has more than %d views", c->path,
                             CAL_MAX_VIEWS);
        if (l->n == max) {
            max = max ? 2 * max : 64;
            flange_entry *item = realloc(l->item, (size_t)max * sizeof *item);
            if (!item)
                return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %d views", max);
            l->item = item;
        }
        r = read_entry(c, column, &l->item[l->n++], f);
    }
    return r == 0 && l->n == 0 ? fault_set(f, ARRIS_E_INPUT, NULL, "%s has no views", c->path) : r;
}

int flange_load(flange_list *l, const char *path, fault *f) {
    csv c;
    *l = (flange_list){.n = 0};
    int r = bytes_read(&l->text, path, MAX_CSV, f);
    if (r == 0)
        r = csv_open(&c, path, (char *)l->text.data, l->text.n, f);
    if (r == 0)
        r = read_rows(l, &c, f);
    if (r < 0)
        f->hint = hint;
    return r;
}

void flange_free(flange_list *l) {
    free(l->item);
    free(l->text.data);
    *l = (flange_list){.n = 0};
}
