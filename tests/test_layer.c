/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_layer.c: how layers lie in their buffers; and the sizes and offsets of every public struct,
 * pinned for 64-bit x86 and ARM: a plugin or an application that was built before must go on
 * working. Fields are only appended, and where arrays are made of a struct it stays as it is.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "internal.h"

/* ---- the ABI --------------------------------------------------------------------------------- */

#if defined(__x86_64__) || defined(__aarch64__)
#define SIZE(T, size, align) _Static_assert(sizeof(T) == size && _Alignof(T) == align, #T)
#define AT(T, field, at) _Static_assert(offsetof(T, field) == at, #T "." #field)
SIZE(arris_camera, 88, 8);
AT(arris_camera, width, 0);
AT(arris_camera, height, 4);
AT(arris_camera, fx, 8);
AT(arris_camera, fy, 16);
AT(arris_camera, skew, 24);
AT(arris_camera, cx, 32);
AT(arris_camera, cy, 40);
AT(arris_camera, k1, 48);
AT(arris_camera, k2, 56);
AT(arris_camera, p1, 64);
AT(arris_camera, p2, 72);
AT(arris_camera, k3, 80);

SIZE(arris_caps, 32, 8);
AT(arris_caps, format, 0);
AT(arris_caps, width, 4);
AT(arris_caps, height, 8);
AT(arris_caps, fps, 16);
AT(arris_caps, camera, 24);

SIZE(arris_image, 40, 8);
AT(arris_image, format, 0);
AT(arris_image, width, 4);
AT(arris_image, height, 8);
AT(arris_image, stride, 16);
AT(arris_image, camera, 24);
AT(arris_image, data, 32);

SIZE(arris_pose, 272, 8);
AT(arris_pose, valid, 0);
AT(arris_pose, C, 8);
AT(arris_pose, R, 32);
AT(arris_pose, cov, 104);

SIZE(arris_edge_point, 16, 4);
AT(arris_edge_point, x, 0);
AT(arris_edge_point, y, 4);
AT(arris_edge_point, gx, 8);
AT(arris_edge_point, gy, 12);

SIZE(arris_chain, 12, 4);
AT(arris_chain, first, 0);
AT(arris_chain, n, 4);
AT(arris_chain, closed, 8);

SIZE(arris_edges, 56, 8);
AT(arris_edges, n, 0);
AT(arris_edges, max, 4);
AT(arris_edges, lost, 8);
AT(arris_edges, n_chains, 12);
AT(arris_edges, max_chains, 16);
AT(arris_edges, lost_chains, 20);
AT(arris_edges, camera, 24);
AT(arris_edges, noise, 32);
AT(arris_edges, point, 40);
AT(arris_edges, chain, 48);

SIZE(arris_segment, 88, 8);
AT(arris_segment, x1, 0);
AT(arris_segment, y1, 8);
AT(arris_segment, x2, 16);
AT(arris_segment, y2, 24);
AT(arris_segment, cov, 32);
AT(arris_segment, lo, 56);
AT(arris_segment, hi, 60);
AT(arris_segment, blur, 64);
AT(arris_segment, chi2, 68);
AT(arris_segment, chain, 72);
AT(arris_segment, beside, 76);

SIZE(arris_segments, 32, 8);
AT(arris_segments, n, 0);
AT(arris_segments, max, 4);
AT(arris_segments, lost, 8);
AT(arris_segments, camera, 16);
AT(arris_segments, item, 24);

SIZE(arris_track, 8, 4);
AT(arris_track, id, 0);
AT(arris_track, segment, 4);

SIZE(arris_tracks, 24, 8);
AT(arris_tracks, n, 0);
AT(arris_tracks, max, 4);
AT(arris_tracks, lost, 8);
AT(arris_tracks, total, 12);
AT(arris_tracks, item, 16);

SIZE(arris_line, 256, 8);
AT(arris_line, id, 0);
AT(arris_line, state, 4);
AT(arris_line, change, 8);
AT(arris_line, into, 12);
AT(arris_line, p, 16);
AT(arris_line, q, 40);
AT(arris_line, cov, 64);
AT(arris_line, views, 232);
AT(arris_line, seen, 236);
AT(arris_line, baseline, 240);
AT(arris_line, rms, 248);

SIZE(arris_lines, 40, 8);
AT(arris_lines, n, 0);
AT(arris_lines, max, 4);
AT(arris_lines, lost, 8);
AT(arris_lines, frames, 12);
AT(arris_lines, scale_sigma, 16);
AT(arris_lines, pose_sigma, 24);
AT(arris_lines, item, 32);

SIZE(arris_foreseen, 64, 8);
AT(arris_foreseen, line, 0);
AT(arris_foreseen, x1, 8);
AT(arris_foreseen, y2, 32);
AT(arris_foreseen, sigma, 40);
AT(arris_foreseen, dx, 48);

SIZE(arris_guide, 48, 8);
AT(arris_guide, n, 0);
AT(arris_guide, max, 4);
AT(arris_guide, lost, 8);
AT(arris_guide, searched, 16);
AT(arris_guide, camera, 24);
AT(arris_guide, step, 32);
AT(arris_guide, item, 40);

SIZE(arris_prop, 72, 8);
AT(arris_prop, name, 0);
AT(arris_prop, type, 8);
AT(arris_prop, offset, 16);
AT(arris_prop, value, 24);
AT(arris_prop, min, 32);
AT(arris_prop, max, 40);
AT(arris_prop, unit, 48);
AT(arris_prop, words, 56);
AT(arris_prop, help, 64);

SIZE(arris_layers, 16, 4);
AT(arris_layers, needs, 0);
AT(arris_layers, wants, 4);
AT(arris_layers, gives, 8);
AT(arris_layers, asks, 12);

SIZE(arris_stage_desc, 128, 8);
AT(arris_stage_desc, size, 0);
AT(arris_stage_desc, name, 8);
AT(arris_stage_desc, summary, 16);
AT(arris_stage_desc, example, 24);
AT(arris_stage_desc, flags, 32);
AT(arris_stage_desc, layers, 36);
AT(arris_stage_desc, self_size, 56);
AT(arris_stage_desc, props, 64);
AT(arris_stage_desc, n_props, 72);
AT(arris_stage_desc, settle, 80);
AT(arris_stage_desc, setup, 88);
AT(arris_stage_desc, process, 96);
AT(arris_stage_desc, finish, 104);
AT(arris_stage_desc, close, 112);
AT(arris_stage_desc, devices, 120);

SIZE(arris_plugin_desc, 48, 8);
AT(arris_plugin_desc, size, 0);
AT(arris_plugin_desc, abi, 8);
AT(arris_plugin_desc, name, 16);
AT(arris_plugin_desc, licence, 24);
AT(arris_plugin_desc, stages, 32);
AT(arris_plugin_desc, commands, 40);

SIZE(arris_command_desc, 32, 8);
AT(arris_command_desc, size, 0);
AT(arris_command_desc, name, 8);
AT(arris_command_desc, summary, 16);
AT(arris_command_desc, run, 24);

SIZE(arris_error, 2572, 4);
AT(arris_error, code, 0);
AT(arris_error, text, 4);
AT(arris_error, hint, 516);
AT(arris_error, line, 1028);
AT(arris_error, column, 2052);
AT(arris_error, file, 2056);
AT(arris_error, line_number, 2568);

SIZE(arris_message, 880, 8);
AT(arris_message, severity, 0);
AT(arris_message, code, 4);
AT(arris_message, stage, 8);
AT(arris_message, frame, 72);
AT(arris_message, text, 80);
AT(arris_message, hint, 480);

SIZE(arris_progress, 72, 8);
AT(arris_progress, frames, 0);
AT(arris_progress, done, 8);
AT(arris_progress, dropped, 16);
AT(arris_progress, lines, 24);
AT(arris_progress, seconds, 32);
AT(arris_progress, p50, 40);
AT(arris_progress, p99, 48);
AT(arris_progress, troubled, 56);
AT(arris_progress, trouble, 64);

_Static_assert(sizeof(enum arris_format) == 4 && sizeof(enum arris_type) == 4, "enums are int");
#endif

_Static_assert(ARRIS_IMAGE == 0 && ARRIS_POSE == 1 && ARRIS_EDGES == 2 && ARRIS_SEGMENTS == 3 &&
                   ARRIS_TRACKS == 4 && ARRIS_LINES == 5 && ARRIS_CORNERS == 6 && ARRIS_FLOW == 7 &&
                   ARRIS_VERDICT == 8 && ARRIS_GUIDE == 9 && ARRIS_USER0 == 24,
               "layers are only appended");
_Static_assert(ARRIS_GREY8 == 1 && ARRIS_GREY16 == 2, "formats");
_Static_assert(ARRIS_MEASURED == 0 && ARRIS_WEAK == 1 && ARRIS_UNOBSERVABLE == 2, "states");
_Static_assert(ARRIS_SAME == 0 && ARRIS_ADDED == 1 && ARRIS_MOVED == 2 && ARRIS_MERGED == 3 &&
                   ARRIS_RETIRED == 4,
               "changes");
_Static_assert(ARRIS_INT == 0 && ARRIS_DOUBLE == 1 && ARRIS_BOOL == 2 && ARRIS_ENUM == 3 &&
                   ARRIS_STRING == 4 && ARRIS_INFILE == 5,
               "types of properties");
_Static_assert(ARRIS_SOURCE == 1 && ARRIS_SINK == 2 && ARRIS_AHEAD == 4, "flags");
_Static_assert(ARRIS_DROP == 1 && ARRIS_END == 2 && ARRIS_ABI == 1, "what process returns");
_Static_assert(ARRIS_E_USAGE == -1 && ARRIS_E_RECIPE == -2 && ARRIS_E_PLUGIN == -3 &&
                   ARRIS_E_INPUT == -4 && ARRIS_E_IO == -5 && ARRIS_E_MEMORY == -6 &&
                   ARRIS_E_INTERNAL == -7 && ARRIS_E_ABORTED == -8,
               "error codes");

static void codes_have_texts_and_exit_codes(void **state) {
    (void)state;
    static const int exits[] = {0, 2, 2, 2, 4, 4, 5, 5, 5};
    for (int i = 0; i < (int)COUNT(exits); i++) {
        assert_int_equal(arris_exit_code(-i), exits[i]);
        assert_string_not_equal(arris_strerror(-i), "unknown error");
    }
    assert_int_equal(arris_exit_code(-1000), 5);
    assert_string_equal(arris_strerror(-1000), "unknown error");
}

/* ---- layers ---------------------------------------------------------------------------------- */

static const arris_camera camera = {.width = 37, .height = 5, .fx = 30, .fy = 30};

/* A buffer of just the size that is said: ASan sees a byte too many. */
static void *buffer(enum arris_layer layer, const arris_caps *caps, size_t n, size_t m) {
    size_t size = layer_size(layer, caps, n, m);
    assert_int_equal(size % 64, 0);
    void *data = aligned_alloc(64, size);
    memset(data, 0xee, size);
    layer_init(layer, data, caps, n, m);
    layer_reset(layer, data);
    return data;
}

#define ALIGNED(p) assert_int_equal((uintptr_t)(p) % 64, 0)

static void images(void **state) {
    (void)state;
    for (int format = ARRIS_GREY8; format <= ARRIS_GREY16; format++)
        for (int width = 1; width <= 200; width += 21) {
            arris_caps caps = {(enum arris_format)format, width, 5, 0, &camera};
            arris_image *i = buffer(ARRIS_IMAGE, &caps, 0, 0);
            assert_true(i->format == caps.format && i->width == width && i->height == 5);
            assert_ptr_equal(i->camera, &camera);
            assert_true(i->stride >= width * format && i->stride % 64 == 0);
            ALIGNED(i->data);
            memset(i->data, 1, (size_t)i->stride * 5 + 64); /* 64 bytes behind the last row */
            assert_true(i->format == caps.format);
            arris_image own = *i;
            i->data = NULL; /* as a source lets it point into a buffer of the driver's */
            i->stride = 1 << 20;
            layer_reset(ARRIS_IMAGE, i);
            assert_true(i->data == own.data && i->stride == own.stride && i->camera == &camera);
            free(i);
        }
}

static void edges(void **state) {
    (void)state;
    arris_edges *e = buffer(ARRIS_EDGES, &(arris_caps){0}, 1001, 77);
    assert_true(e->max == 1001 && e->max_chains == 77 && !e->n && !e->n_chains && !e->lost);
    assert_true(!e->lost_chains && !e->camera && e->noise == 0);
    ALIGNED(e->point);
    ALIGNED(e->chain);
    memset(e->point, 1, 1001 * sizeof *e->point);
    memset(e->chain, 2, 77 * sizeof *e->chain);
    assert_true(e->point[1000].x == e->point[0].x && e->chain[0].first == 0x02020202u);
    *e = (arris_edges){9, 1001, 3, 4, 77, 2, &camera, 1, e->point, e->chain};
    layer_reset(ARRIS_EDGES, e);
    assert_true(!e->n && !e->lost && !e->n_chains && !e->lost_chains && !e->camera && !e->noise);
    assert_true(e->max == 1001 && e->max_chains == 77 && e->point && e->chain);
    free(e);
}

#define TABLE_OF(NAME, type, field)                                                                \
    do {                                                                                           \
        type *t = buffer(ARRIS_##NAME, &(arris_caps){0}, 333, 0);                                  \
        assert_true(t->max == 333 && t->n == 0 && t->lost == 0);                                   \
        ALIGNED(t->item);                                                                          \
        memset(t->item, 3, 333 * sizeof *t->item);                                                 \
        t->n = t->lost = 9;                                                                        \
        memset(&t->field, 5, sizeof t->field);                                                     \
        layer_reset(ARRIS_##NAME, t);                                                              \
        assert_true(t->max == 333 && t->n == 0 && t->lost == 0 && t->item && !t->field);           \
        free(t);                                                                                   \
    } while (0)

static void tables(void **state) {
    (void)state;
    TABLE_OF(SEGMENTS, arris_segments, camera);
    TABLE_OF(TRACKS, arris_tracks, total);
    TABLE_OF(LINES, arris_lines, scale_sigma);
    TABLE_OF(VERDICT, arris_verdict, tolerance);
    TABLE_OF(GUIDE, arris_guide, step);
}

static void verdicts(void **state) {
    (void)state;
    arris_verdict *v = buffer(ARRIS_VERDICT, &(arris_caps){0}, 21, 500);
    assert_true(v->max == 21 && v->max_extra == 500 && !v->n_extra && !v->lost_extra);
    ALIGNED(v->extra);
    memset(v->item, 1, 21 * sizeof *v->item);
    memset(v->extra, 2, 500 * sizeof *v->extra);
    assert_int_equal(v->item[20].line, 0x01010101);
    assert_int_equal(v->extra[0], 0x02020202);
    v->n_extra = v->lost_extra = 7;
    layer_reset(ARRIS_VERDICT, v);
    assert_true(v->max_extra == 500 && v->extra && !v->n_extra && !v->lost_extra);
    free(v);
}

static void poses_and_bytes(void **state) {
    (void)state;
    arris_pose *p = buffer(ARRIS_POSE, &(arris_caps){0}, 0, 0);
    assert_true(!p->valid && p->C[0] == 0 && p->R[8] == 0 && p->cov[20] == 0);
    free(p);
    for (size_t n = 0; n < 200; n += 33) {
        char *bytes = buffer(ARRIS_USER0 + 3, &(arris_caps){0}, n, 0);
        memset(bytes, 1, n);
        free(bytes);
    }
}

static void sizes_are_checked(void **state) {
    (void)state;
    assert_int_equal(layer_size(ARRIS_EDGES, &(arris_caps){0}, SIZE_MAX / 8, 1), 0);
    assert_int_equal(layer_size(ARRIS_EDGES, &(arris_caps){0}, 1, SIZE_MAX / 8), 0);
    assert_int_equal(layer_size(ARRIS_USER0, &(arris_caps){0}, SIZE_MAX, 0), 0);
}

static void names(void **state) {
    (void)state;
    char text[200];
    assert_string_equal(layer_name(ARRIS_IMAGE), "image");
    assert_string_equal(layer_name(ARRIS_LINES), "lines");
    assert_string_equal(layer_name(ARRIS_USER0 + 7), "user7");
    assert_string_equal(layer_name(ARRIS_N_LAYERS), "unknown");
    layer_names(0, text, sizeof text);
    assert_string_equal(text, "nothing");
    layer_names(ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_LINES) | ARRIS_BIT(ARRIS_USER0), text,
                sizeof text);
    assert_string_equal(text, "pose, lines, user0");
    layer_names(~0u, text, 20);
    assert_true(strlen(text) < 20);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(codes_have_texts_and_exit_codes),
        cmocka_unit_test(images),
        cmocka_unit_test(edges),
        cmocka_unit_test(tables),
        cmocka_unit_test(verdicts),
        cmocka_unit_test(poses_and_bytes),
        cmocka_unit_test(sizes_are_checked),
        cmocka_unit_test(names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
