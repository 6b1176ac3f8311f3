/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * nominal.c: reads a model: JSON through jansson, meshes through assimp's C interface.
 */
#include "nominal.h"

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "arris_geometry.h"
#include "bytes.h"

static const char json_hint[] =
    "a list of edges is {\"unit\": \"mm\", \"lines\": [{\"id\": \"top\", \"p\": [x,y,z], "
    "\"q\": [x,y,z]}]}";

/* ---- a list of edges --------------------------------------------------------------------------
 */

static bool read_vector(const json_t *o, const char *key, double v[3]) {
    const json_t *a = json_object_get(o, key);
    bool good = json_is_array(a) && json_array_size(a) == 3;
    for (size_t i = 0; good && i < 3; i++) {
        const json_t *x = json_array_get(a, i);
        v[i] = json_number_value(x);
        good = json_is_number(x) && fabs(v[i]) < 1e9;
    }
    return good;
}

static int read_edge(nominal *m, const json_t *o, size_t i, const char *path, fault *f) {
    nominal_edge e = {.mark = json_is_false(json_object_get(o, "in_cad"))};
    const json_t *id = json_object_get(o, "id"), *t = json_object_get(o, "tolerance");
    double d[3];
    if (!json_is_string(id) || strlen(json_string_value(id)) >= sizeof e.id)
        return fault_set(f, ARRIS_E_INPUT, json_hint,
                         "%s: line %zu has no id of 1 to 63 characters", path, i + 1);
    snprintf(e.id, sizeof e.id, "%s", json_string_value(id));
    if (!read_vector(o, "p", e.p) || !read_vector(o, "q", e.q))
        return fault_set(f, ARRIS_E_INPUT, json_hint,
                         "%s: line '%s' has no ends p and q of three numbers each", path, e.id);
    for (int k = 0; k < 3; k++)
        d[k] = e.q[k] - e.p[k];
    if (!(arris_unit(d) > 1e-6))
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s: the ends of line '%s' are one point", path,
                         e.id);
    if (json_object_get(o, "normal") &&
        (!read_vector(o, "normal", e.normal) || !(arris_unit(e.normal) > 0)))
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s: the normal of line '%s' is no vector", path,
                         e.id);
    if (t && !((e.tolerance = json_number_value(t)) > 0))
        return fault_set(f, ARRIS_E_INPUT, NULL,
                         "%s: the tolerance of line '%s' is no number above 0", path, e.id);
    for (uint32_t k = 0; k < m->n_edges; k++)
        if (!strcmp(m->edge[k].id, e.id))
            return fault_set(f, ARRIS_E_INPUT, NULL, "%s: two lines are called '%s'", path, e.id);
    m->edge[m->n_edges++] = e;
    return 0;
}

static int read_lines(nominal *m, const json_t *root, const char *path, double min_length,
                      fault *f) {
    const json_t *unit = json_object_get(root, "unit"), *lines = json_object_get(root, "lines");
    size_t n = json_array_size(lines);
    if (!json_is_string(unit) || strcmp(json_string_value(unit), "mm") != 0)
        return fault_set(f, ARRIS_E_INPUT, "convert it to millimetres and say \"unit\": \"mm\"",
                         "%s: the unit is %s%s%s", path, json_is_string(unit) ? "'" : "",
                         json_is_string(unit) ? json_string_value(unit) : "missing",
                         json_is_string(unit) ? "', not mm" : "");
    if (!json_is_array(lines))
        return fault_set(f, ARRIS_E_INPUT, json_hint, "%s: there are no \"lines\"", path);
    if (n > NOMINAL_MAX_EDGES)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s: %zu lines are more than %d", path, n,
                         NOMINAL_MAX_EDGES);
    m->edge = calloc(n + 1, sizeof *m->edge);
    if (!m->edge)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu edges", n);
    for (size_t i = 0; i < n; i++) {
        const json_t *o = json_array_get(lines, i);
        int r = read_edge(m, o, i, path, f);
        if (r)
            return r;
        const nominal_edge *e = &m->edge[m->n_edges - 1];
        if (hypot(hypot(e->q[0] - e->p[0], e->q[1] - e->p[1]), e->q[2] - e->p[2]) < min_length)
            m->n_edges--;
    }
    return 0;
}

static int read_json(nominal *m, const char *path, double min_length, fault *f) {
    bytes b = {0};
    json_error_t e;
    int r = bytes_read(&b, path, NOMINAL_MAX_FILE, f);
    if (r)
        return r;
    json_t *root = json_loadb((const char *)b.data, b.n, JSON_REJECT_DUPLICATES, &e);
    free(b.data);
    if (!root)
        return fault_set(f, ARRIS_E_INPUT, json_hint, "%s:%d:%d: %s", path, e.line, e.column,
                         e.text);
    r = read_lines(m, root, path, min_length, f);
    json_decref(root);
    return r;
}

/* ---- a mesh -----------------------------------------------------------------------------------
 */

/* assimp stands a DXF's z up along y. */
static void upright(double v[3]) {
    double y = v[1];
    v[1] = -v[2];
    v[2] = y;
}

/* The faces of all meshes, as triangles of m and as lines; what isn't finite is left out. */
static uint32_t take_faces(nominal *m, const struct aiScene *scene, bool dxf,
                           uint32_t (*lines)[2]) {
    uint32_t n_lines = 0;
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
        const struct aiMesh *mesh = scene->mMeshes[i];
        uint32_t base = m->n_vertices;
        for (unsigned k = 0; k < mesh->mNumVertices; k++, m->n_vertices++) {
            m->vertex[m->n_vertices][0] = (double)mesh->mVertices[k].x;
            m->vertex[m->n_vertices][1] = (double)mesh->mVertices[k].y;
            m->vertex[m->n_vertices][2] = (double)mesh->mVertices[k].z;
            if (dxf)
                upright(m->vertex[m->n_vertices]);
        }
        for (unsigned k = 0; k < mesh->mNumFaces; k++) {
            const struct aiFace *face = &mesh->mFaces[k];
            bool good = face->mNumIndices == 2 || face->mNumIndices == 3;
            for (unsigned c = 0; good && c < face->mNumIndices; c++) {
                good = face->mIndices[c] < mesh->mNumVertices;
                const double *v = m->vertex[base + (good ? face->mIndices[c] : 0)];
                good = good && fabs(v[0]) < 1e9 && fabs(v[1]) < 1e9 && fabs(v[2]) < 1e9;
            }
            for (unsigned c = 0; good && c < face->mNumIndices; c++)
                if (face->mNumIndices == 2)
                    lines[n_lines][c] = base + face->mIndices[c];
                else
                    m->triangle[m->n_triangles][c] = base + face->mIndices[c];
            n_lines += good && face->mNumIndices == 2;
            m->n_triangles += good && face->mNumIndices == 3;
        }
    }
    return n_lines;
}

static int take_scene(nominal *m, const struct aiScene *scene, bool dxf, double crease,
                      double min_length, fault *f) {
    size_t vertices = 0, faces = 0;
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
        vertices += scene->mMeshes[i]->mNumVertices;
        faces += scene->mMeshes[i]->mNumFaces;
    }
    if (vertices > INT32_MAX || faces > INT32_MAX)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the model has too many faces: %zu", faces);
    m->vertex = calloc(vertices + 1, sizeof *m->vertex);
    m->triangle = calloc(faces + 1, sizeof *m->triangle);
    uint32_t(*lines)[2] = calloc(faces + 1, sizeof *lines);
    int r = fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu faces", faces);
    if (m->vertex && m->triangle && lines) {
        uint32_t n = take_faces(m, scene, dxf, lines);
        r = mesh_edges(m, (const uint32_t(*)[2])lines, n, crease, min_length, f);
    }
    free(lines);
    return r;
}

/* Whether a PLY's header promises no more than its bytes can hold: assimp would make room first. */
static bool ply_holds(const bytes *b) {
    const char *text = (const char *)b->data, *end = strstr(text, "end_header");
    for (const char *l = strstr(text, "\nelement "); end && l && l < end;
         l = strstr(l + 1, "\nelement ")) {
        const char *name = l + strlen("\nelement ");
        unsigned long long n = strtoull(name + strcspn(name, " \n"), NULL, 10);
        if (n > b->n)
            return false;
    }
    return end != NULL;
}

static bool ends_in(const char *path, const char *ending) {
    const char *dot = strrchr(path, '.');
    return dot && strcasecmp(dot, ending) == 0;
}

static int read_mesh(nominal *m, const char *path, double crease, double min_length, fault *f) {
    bytes b = {0};
    int r = bytes_read(&b, path, NOMINAL_MAX_FILE, f);
    bool holds = r || !ends_in(path, ".ply") || ply_holds(&b);
    free(b.data);
    if (r)
        return r;
    if (!holds)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s: its header is not that of its data", path);
    const struct aiScene *scene =
        aiImportFile(path, aiProcess_Triangulate | aiProcess_PreTransformVertices);
    if (!scene)
        return fault_set(f, ARRIS_E_INPUT,
                         "a model is .json (a list of edges), .obj, .stl, .ply, .dxf or another "
                         "mesh, in millimetres",
                         "cannot read %s: %s", path, aiGetErrorString());
    r = take_scene(m, scene, ends_in(path, ".dxf"), crease, min_length, f);
    aiReleaseImport(scene);
    return r;
}

int nominal_read(nominal *m, const char *path, double crease, double min_length, fault *f) {
    *m = (nominal){0};
    int r = ends_in(path, ".json") ? read_json(m, path, min_length, f)
                                   : read_mesh(m, path, crease, min_length, f);
    if (r == 0 && m->n_edges == 0)
        r = fault_set(f, ARRIS_E_INPUT, "crease-angle and min-length decide what is an edge",
                      "%s: there is no edge in it", path);
    return r;
}

void nominal_free(nominal *m) {
    free(m->edge);
    free(m->vertex);
    free(m->triangle);
    *m = (nominal){0};
}
