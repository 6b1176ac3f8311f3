/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mesh.c: the triangles of an OBJ or STL file (mesh.h).
 */
#include "mesh.h"

#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "arris_geometry.h"

static const char hint[] = "location= is an OBJ or STL file in mm, as CAD programs export it";

static int check_file(const char *path, fault *f) {
    struct stat st;
    const char *dot = strrchr(path, '.');
    if (!dot || (strcasecmp(dot, ".obj") != 0 && strcasecmp(dot, ".stl") != 0))
        return fault_set(f, ARRIS_E_INPUT, hint, "%s ends neither in .obj nor in .stl", path);
    if (stat(path, &st) < 0)
        return fault_set(f, errno == ENOENT ? ARRIS_E_INPUT : ARRIS_E_IO, hint,
                         "cannot open %s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return fault_set(f, ARRIS_E_INPUT, hint, "%s is no regular file", path);
    if (st.st_size > MESH_MAX_FILE)
        return fault_set(f, ARRIS_E_INPUT, "leave out what the camera does not see",
                         "%s has %lld bytes; the limit is %d", path, (long long)st.st_size,
                         MESH_MAX_FILE);
    return 0;
}

/* ---- from assimp's scene --------------------------------------------------------------------- */

static float grey_of(const struct aiMaterial *m) {
    struct aiColor4D c;
    if (aiGetMaterialColor(m, AI_MATKEY_COLOR_DIFFUSE, &c) != aiReturn_SUCCESS)
        return 0.6f;
    float grey = 0.299f * c.r + 0.587f * c.g + 0.114f * c.b;
    return grey >= 0 ? fminf(grey, 1) : 0;
}

/* How many points there are, and triangles when every face is cut into some. */
static int count(const struct aiScene *s, const char *path, size_t *points, size_t *triangles,
                 fault *f) {
    size_t faces = 0;
    *points = *triangles = 0;
    for (unsigned i = 0; i < s->mNumMeshes; i++) {
        const struct aiMesh *m = s->mMeshes[i];
        *points += m->mNumVertices;
        faces += m->mNumFaces;
        for (unsigned k = 0; k < m->mNumFaces; k++)
            *triangles += m->mFaces[k].mNumIndices > 2 ? m->mFaces[k].mNumIndices - 2 : 1;
    }
    if (faces == 0)
        return fault_set(f, ARRIS_E_INPUT, hint, "%s has no faces", path);
    if (*triangles > MESH_MAX_TRIANGLES)
        return fault_set(f, ARRIS_E_INPUT, "leave out what the camera does not see",
                         "%s has %zu triangles; the limit is %d", path, *triangles,
                         MESH_MAX_TRIANGLES);
    return 0;
}

static int take_points(mesh *m, const struct aiMesh *a, const char *path, fault *f) {
    for (unsigned i = 0; i < a->mNumVertices; i++) {
        const struct aiVector3D *v = &a->mVertices[i];
        double *p = m->point[m->n_points++];
        p[0] = (double)v->x, p[1] = (double)v->y, p[2] = (double)v->z;
        for (int k = 0; k < 3; k++)
            if (!(fabs(p[k]) <= MESH_MAX_SIZE))
                return fault_set(f, ARRIS_E_INPUT, hint,
                                 "%s: point %zu is at %g, %g, %g; the limit is %g mm", path,
                                 m->n_points, p[0], p[1], p[2], MESH_MAX_SIZE);
    }
    return 0;
}

static void take_faces(mesh *m, const struct aiMesh *a, size_t first, float grey) {
    for (unsigned i = 0; i < a->mNumFaces; i++) {
        const struct aiFace *face = &a->mFaces[i];
        bool good = face->mNumIndices == 3;
        mesh_triangle t = {.grey = grey};
        for (int k = 0; good && k < 3; k++) {
            good = face->mIndices[k] < a->mNumVertices;
            t.v[k] = (uint32_t)(first + face->mIndices[k]);
        }
        if (good)
            m->triangle[m->n_triangles++] = t;
        else
            m->flat++;
    }
}

static int take(mesh *m, const struct aiScene *s, const char *path, fault *f) {
    size_t points, triangles;
    int r = count(s, path, &points, &triangles, f);
    if (r < 0)
        return r;
    m->point = calloc(points + 1, sizeof *m->point);
    m->triangle = calloc(triangles, sizeof *m->triangle);
    if (!m->point || !m->triangle)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu triangles", triangles);
    for (unsigned i = 0; i < s->mNumMeshes; i++) {
        const struct aiMesh *a = s->mMeshes[i];
        size_t first = m->n_points;
        if ((r = take_points(m, a, path, f)) < 0)
            return r;
        take_faces(m, a, first,
                   a->mMaterialIndex < s->mNumMaterials ? grey_of(s->mMaterials[a->mMaterialIndex])
                                                        : 0.6f);
    }
    return 0;
}

/* ---- one point a place ----------------------------------------------------------------------- */

typedef struct place {
    double p[3];
    uint32_t was;
} place;

static int by_place(const void *a, const void *b) {
    const place *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->p[k] != q->p[k])
            return p->p[k] < q->p[k] ? -1 : 1;
    return (p->was > q->was) - (p->was < q->was);
}

static bool has_area(const mesh *m, const uint32_t v[3]) {
    double a[3], b[3], n[3];
    for (int k = 0; k < 3; k++) {
        a[k] = m->point[v[1]][k] - m->point[v[0]][k];
        b[k] = m->point[v[2]][k] - m->point[v[0]][k];
    }
    arris_cross(a, b, n);
    double longest = fmax(sqrt(arris_dot(a, a)), sqrt(arris_dot(b, b)));
    return sqrt(arris_dot(n, n)) > 1e-6 * longest * longest && longest > 1e-6;
}

/* Assimp has a point for each material that meets there. */
static int weld(mesh *m, fault *f) {
    place *all = calloc(m->n_points + 1, sizeof *all);
    uint32_t *now = calloc(m->n_points + 1, sizeof *now);
    if (!all || !now) {
        free(all), free(now);
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu points", m->n_points);
    }
    for (size_t i = 0; i < m->n_points; i++)
        all[i] = (place){{m->point[i][0], m->point[i][1], m->point[i][2]}, (uint32_t)i};
    qsort(all, m->n_points, sizeof *all, by_place);
    size_t n = 0;
    for (size_t i = 0; i < m->n_points; i++) {
        if (n == 0 || memcmp(m->point[n - 1], all[i].p, sizeof all[i].p) != 0)
            memcpy(m->point[n++], all[i].p, sizeof all[i].p);
        now[all[i].was] = (uint32_t)(n - 1);
    }
    m->n_points = n;
    for (size_t i = 0; i < m->n_triangles; i++)
        for (int k = 0; k < 3; k++)
            m->triangle[i].v[k] = now[m->triangle[i].v[k]];
    free(all), free(now);
    return 0;
}

static int drop_flat(mesh *m, const char *path, fault *f) {
    size_t n = 0;
    for (size_t i = 0; i < m->n_triangles; i++)
        if (has_area(m, m->triangle[i].v))
            m->triangle[n++] = m->triangle[i];
    m->flat += m->n_triangles - n;
    m->n_triangles = n;
    return n > 0 ? 0 : fault_set(f, ARRIS_E_INPUT, hint, "%s: no face has an area", path);
}

/* Faces are cut into triangles when it is known that they are not too many: the time that takes
 * grows with the square of a face's corners. */
static int import(mesh *m, const char *path, fault *f) {
    size_t points, triangles;
    const struct aiScene *s = aiImportFile(path, 0);
    int r = s ? count(s, path, &points, &triangles, f) : 0;
    if (s && r == 0)
        s = aiApplyPostProcessing(s, aiProcess_Triangulate); /* NULL: it has released it */
    if (!s)
        return fault_set(f, ARRIS_E_INPUT, hint, "%s cannot be read: %s", path, aiGetErrorString());
    if (r == 0)
        r = take(m, s, path, f);
    aiReleaseImport(s);
    return r;
}

int mesh_load(mesh *m, const char *path, fault *f) {
    memset(m, 0, sizeof *m);
    int r = check_file(path, f);
    if (r < 0)
        return r;
    r = import(m, path, f);
    if (r == 0)
        r = weld(m, f);
    return r == 0 ? drop_flat(m, path, f) : r;
}

void mesh_free(mesh *m) {
    free(m->point);
    free(m->triangle);
    memset(m, 0, sizeof *m);
}
