/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * arris_types.h: error codes, the camera model, and the layers that a frame gains.
 *
 * Units: millimetres, radians, pixels, microseconds. Pixel (0, 0) is the centre of the top-left
 * pixel, x to the right, y down. World to camera: x ~ K R (X - C).
 *
 * A layer is a plain struct whose arrays have a capacity that is fixed before the first frame. The
 * stage that gives a layer fills it; afterwards it is read-only. When more was found than fits, the
 * giver stops at `max` and counts the rest in `lost`.
 */
#ifndef ARRIS_TYPES_H
#define ARRIS_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- errors --------------------------------------------------------------------------------- */

/* X(name, value, exit code of `arris`, text). Functions return 0 or one of the negative values. */
#define ARRIS_ERRORS(X)                                                                            \
    X(USAGE, -1, 2, "wrong usage")                                                                 \
    X(RECIPE, -2, 2, "the pipeline cannot be built")                                               \
    X(PLUGIN, -3, 2, "a plugin cannot be loaded")                                                  \
    X(INPUT, -4, 4, "bad input")                                                                   \
    X(IO, -5, 4, "a file or a device failed")                                                      \
    X(MEMORY, -6, 5, "out of memory")                                                              \
    X(INTERNAL, -7, 5, "internal error")                                                           \
    X(ABORTED, -8, 5, "aborted")

enum {
    ARRIS_OK = 0,
#define X(name, value, exit_code, text) ARRIS_E_##name = value,
    ARRIS_ERRORS(X)
#undef X
};

/* ---- the camera ----------------------------------------------------------------------------- */

/* Pinhole with Bouguet's distortion (k1, k2, p1, p2, k3; the same as OpenCV's). `skew` is s of the
 * thesis's eq. 2.6, in pixels: Bouguet's alpha_c times fx. An ideal camera has zero distortion. */
typedef struct arris_camera {
    int32_t width, height; /* px */
    double fx, fy, skew;   /* px */
    double cx, cy;         /* px */
    double k1, k2, p1, p2, k3;
} arris_camera;

enum arris_format { ARRIS_GREY8 = 1, ARRIS_GREY16 = 2 }; /* the value is the bytes a pixel takes */

/* What is constant for a stream. `camera` is NULL when none is known; it outlives the stream. */
typedef struct arris_caps {
    enum arris_format format; /* 0: the stream has no image */
    int32_t width, height;    /* px */
    double fps;               /* 0: as fast as it goes */
    const arris_camera *camera;
} arris_caps;

/* ---- the layers ----------------------------------------------------------------------------- */

/* X(NAME, "name", type, what). Append only: the position is part of the ABI. */
#define ARRIS_LAYERS(X)                                                                            \
    X(IMAGE, "image", arris_image, "grey levels")                                                  \
    X(POSE, "pose", arris_pose, "the camera's position and rotation")                              \
    X(EDGES, "edges", arris_edges, "linked sub-pixel edge points")                                 \
    X(SEGMENTS, "segments", arris_segments, "straight segments with covariance")                   \
    X(TRACKS, "tracks", arris_tracks, "which segment continues which track")                       \
    X(LINES, "lines", arris_lines, "3D lines with covariance")                                     \
    X(CORNERS, "corners", arris_corners, "sub-pixel corner points")                                \
    X(FLOW, "flow", arris_flow, "how far every pixel has moved since the frame before")            \
    X(VERDICT, "verdict", arris_verdict, "nominal edges compared with the measured lines")         \
    X(GUIDE, "guide", arris_guide, "where known lines are, that `edges` did not look for")

enum arris_layer {
#define X(NAME, name, type, what) ARRIS_##NAME,
    ARRIS_LAYERS(X)
#undef X
        ARRIS_N_LAYERS,
    ARRIS_USER0 = 24, /* to ARRIS_USER7: for plugins from elsewhere; plain bytes */
    ARRIS_USER1,
    ARRIS_USER2,
    ARRIS_USER3,
    ARRIS_USER4,
    ARRIS_USER5,
    ARRIS_USER6,
    ARRIS_USER7,
    ARRIS_MAX_LAYERS = 32
};

#define ARRIS_BIT(layer) (1u << (layer)) /* a set of layers is the sum of their bits */

/* The image: `height` rows of `width` pixels, `stride` bytes from row to row, in the machine's byte
 * order. Rows start on 64-byte boundaries and 64 bytes may be read after the last row. */
typedef struct arris_image {
    enum arris_format format;
    int32_t width, height;      /* px */
    ptrdiff_t stride;           /* bytes */
    const arris_camera *camera; /* the model that holds for these pixels; NULL when unknown */
    uint8_t *data;
} arris_image;

typedef struct arris_pose {
    bool valid;  /* false: this frame has none, and the rest means nothing */
    double C[3]; /* camera centre in the world, mm */
    double R[9]; /* rotation world to camera, row by row (eq. 2.7) */
    double
        cov[21]; /* of (C in mm, rotation vector in rad), upper triangle row by row; 0: unknown */
} arris_pose;

/* One edge point. (gx, gy) is the gradient of the smoothed picture, grey levels per px: it points
 * to the brighter side. A chain's points are in order, with the brighter side on the right as one
 * walks with y down: the tangent is near (gy, -gx). Undistortion moves x, y and keeps g. */
typedef struct arris_edge_point {
    float x, y;   /* px, sub-pixel */
    float gx, gy; /* grey levels per px */
} arris_edge_point;

typedef struct arris_chain {
    uint32_t first, n; /* points first .. first + n - 1 */
    bool closed;       /* the last point neighbours the first */
} arris_chain;

typedef struct arris_edges {
    uint32_t n, max, lost;                      /* points */
    uint32_t n_chains, max_chains, lost_chains; /* chains */
    const arris_camera *camera;                 /* the model that the coordinates follow */
    float noise;                                /* sigma of one pixel, grey levels; 0: unknown */
    arris_edge_point *point;
    arris_chain *chain;
} arris_edges;

/* A straight segment from (x1, y1) to (x2, y2). `lo` is the grey level on its left and `hi` that on
 * its right, seen with y down: right is the side of (-dy, dx). Those of a chain have the brighter
 * side on the right. The covariance is that of the fitted line at the segment's middle: `offset`
 * across it, to the right, and `angle` from x to y. End points bound a line, they never measure
 * it. */
typedef struct arris_segment {
    double x1, y1, x2, y2; /* px */
    double cov[3];         /* var(offset) px², cov(offset, angle) px rad, var(angle) rad² */
    float lo, hi;          /* grey levels */
    float blur;            /* sigma of the blurred step, px; 0: unknown */
    float chi2;            /* of the fit, per degree of freedom; 0: unknown */
    uint32_t chain;        /* of the edges layer it was made from; UINT32_MAX: found by the guide */
    float beside[2]; /* what is on its left and on its right that is no part of a step, sigma */
} arris_segment;

typedef struct arris_segments {
    uint32_t n, max, lost;
    const arris_camera *camera;
    arris_segment *item;
} arris_segments;

/* The tracks that are alive in this frame. Ids count from 0 and are never used twice. */
typedef struct arris_track {
    int32_t id;
    int32_t segment; /* index into this frame's segments; -1: not seen in this frame */
} arris_track;

typedef struct arris_tracks {
    uint32_t n, max, lost;
    uint32_t total; /* tracks ever started, ids 0 .. total - 1 */
    arris_track *item;
} arris_tracks;

enum arris_line_state { ARRIS_MEASURED, ARRIS_WEAK, ARRIS_UNOBSERVABLE };
enum arris_line_change { ARRIS_SAME, ARRIS_ADDED, ARRIS_MOVED, ARRIS_MERGED, ARRIS_RETIRED };

typedef struct arris_line {
    int32_t id;
    enum arris_line_state state;
    enum arris_line_change change; /* since the frame before */
    int32_t into;                  /* the id it was merged into; -1 */
    double p[3], q[3];             /* the ends, mm */
    double cov[21];                /* 6x6 of (p, q), upper triangle row by row, mm² */
    uint32_t views;
    uint32_t seen;   /* `frames` when it was last seen where it was expected; 0: never */
    double baseline; /* mm, between the outermost camera centres that saw it */
    double rms;      /* px, of the ends of its segments */
} arris_line;

typedef struct arris_lines {
    uint32_t n, max, lost;
    uint32_t frames;    /* frames that went into it */
    double scale_sigma; /* relative, common to all lines and contained in every cov */
    double pose_sigma;  /* mm, as given or as estimated */
    arris_line *item;
} arris_lines;

typedef struct arris_corner {
    float x, y;     /* px, sub-pixel */
    float strength; /* of the detector's measure */
} arris_corner;

typedef struct arris_corners {
    uint32_t n, max, lost;
    const arris_camera *camera;
    arris_corner *item; /* the strongest first */
} arris_corners;

/* Dense optical flow, and its two components as pictures: mid grey is no motion, darker is
 * negative, lighter positive (thesis, section 2.3). All planes have `width` items a row and no gap.
 */
typedef struct arris_flow {
    int32_t width, height; /* px */
    bool valid;            /* false in the first frame: there is none before it */
    float *u, *v;          /* px, to the right and down */
    uint8_t *grey_u, *grey_v;
} arris_flow;

enum arris_judgement { ARRIS_PASS, ARRIS_FAIL, ARRIS_INDETERMINATE };

/* A nominal edge, or what derives from two of them, against what was measured. A deviation is
 * positive on the outer side of the part where its model has faces, and where it has none. */
typedef struct arris_feature {
    char id[64];
    bool is_angle;         /* deviations, U and tolerance are rad; otherwise mm */
    double deviation, U;   /* the mean along the feature, and its U = k u; NAN: not measured */
    double worst, worst_U; /* of the worst point */
    double straightness;   /* mm, RMS of the observed points about their line; NAN: unknown */
    double tolerance;
    enum arris_judgement verdict; /* ISO 14253-1 */
    const char *reason;           /* why it is indeterminate; NULL. Lives as long as its stage */
    int32_t line;                 /* id of the line that measured it; -1: none, or several */
    double p[3], q[3];            /* an edge's nominal ends as aligned, mm; else NAN */
    double at[2][3];              /* what was measured at these; NAN */
} arris_feature;

typedef struct arris_verdict {
    uint32_t n, max, lost;                   /* features that are judged */
    uint32_t n_extra, max_extra, lost_extra; /* measured lines that no nominal edge explains */
    enum arris_judgement verdict;            /* of all: the worst */
    double tolerance, coverage_factor;       /* mm; k */
    char model[65], calibration[65]; /* SHA-256 of the model's file and of the camera model, hex */
    arris_feature *item;
    int32_t *extra; /* ids of lines */
} arris_verdict;

/* What a known line should look like in this frame, from (x1, y1) to (x2, y2) with the brighter
 * side on the right, by its 3D estimate and the frame's pose. */
typedef struct arris_foreseen {
    int32_t line;          /* the id */
    double x1, y1, x2, y2; /* px */
    double sigma;          /* px, across it */
    double dx, dy;         /* px that its middle has moved in the picture since `searched` */
} arris_foreseen;

/* The known lines of a picture that `edges` does not search: who makes segments looks at the
 * picture there. None: it was searched. */
typedef struct arris_guide {
    uint32_t n, max, lost;
    uint64_t searched;          /* the frame whose edges tell what is beside the lines */
    const arris_camera *camera; /* without a lens: the coordinates are ideal pixels */
    float step;                 /* grey levels: the least that counts as an edge */
    arris_foreseen *item;
} arris_guide;

/* ---- how the stream goes --------------------------------------------------------------------- */

typedef struct arris_progress {
    uint64_t frames;                /* that the source has made */
    uint64_t done;                  /* that reached the end of a branch, the slowest's count */
    uint64_t dropped;               /* anywhere */
    uint64_t lines;                 /* measured, in the newest lines layer; 0 when there is none */
    double seconds;                 /* since the start; 0: it has not started */
    double p50, p99;                /* ms, from exposure to the end of the first branch */
    const char *troubled, *trouble; /* the first stage that ails and what ails it; NULL: none */
} arris_progress;

#ifdef __cplusplus
}
#endif
#endif
