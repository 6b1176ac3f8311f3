/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * registry.c: finds stages. The folders of ARRIS_PLUGIN_PATH come first, then the one beside the
 * library. A text list X.stages beside X.so says what is in it, so that only what a line names is
 * opened; a plugin without a list is opened when a name is found nowhere else. Why one could not be
 * loaded is kept and told when its stage is asked for.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

enum { MAX_PLUGINS = 256, MAX_PATH = 1024 };

typedef struct plugin {
    char path[MAX_PATH]; /* of the .so */
    char *list;          /* "stage edges\nstage ...", or NULL */
    bool opened;
    const arris_plugin_desc *desc; /* NULL: not loaded */
    char why[400];                 /* that it could not be */
    const arris_stage_desc **stage;
    size_t n_stages;
} plugin;

static plugin *plugins[MAX_PLUGINS];
static size_t n_plugins;
static pthread_once_t scanned = PTHREAD_ONCE_INIT;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static char *read_list(const char *so) {
    char path[MAX_PATH + 8];
    snprintf(path, sizeof path, "%.*s.stages", (int)strlen(so) - 3, so);
    FILE *f = fopen(path, "r");
    char *text = f ? calloc(1, 4096) : NULL;
    if (text && !fread(text, 1, 4095, f)) {
        free(text);
        text = NULL;
    }
    if (f)
        fclose(f);
    return text;
}

static int is_so(const struct dirent *e) {
    size_t n = strlen(e->d_name);
    return n > 3 && strcmp(e->d_name + n - 3, ".so") == 0;
}

static void scan_folder(const char *folder) {
    struct dirent **entry;
    int n = scandir(folder, &entry, is_so, alphasort);
    for (int i = 0; i < n; i++) {
        plugin *p = n_plugins < MAX_PLUGINS ? calloc(1, sizeof *p) : NULL;
        if (p && snprintf(p->path, sizeof p->path, "%s/%s", folder, entry[i]->d_name) < MAX_PATH) {
            p->list = read_list(p->path);
            plugins[n_plugins++] = p;
        } else {
            free(p);
        }
        free(entry[i]);
    }
    if (n >= 0)
        free(entry);
}

static void scan(void) {
    const char *path = getenv("ARRIS_PLUGIN_PATH");
    for (const char *end; path && *path; path = *end ? end + 1 : end) {
        char folder[MAX_PATH];
        end = strchrnul(path, ':');
        snprintf(folder, sizeof folder, "%.*s", (int)(end - path), path);
        scan_folder(folder);
    }
    Dl_info self;
    if (dladdr((void *)(uintptr_t)scan, &self) && self.dli_fname) {
        char folder[MAX_PATH];
        const char *slash = strrchr(self.dli_fname, '/');
        snprintf(folder, sizeof folder, "%.*sarris", slash ? (int)(slash - self.dli_fname) + 1 : 0,
                 self.dli_fname);
        scan_folder(folder);
    }
}

/* A plugin built with an older header has a shorter descriptor: the fields it lacks are zero. */
static const arris_stage_desc *adopt(const arris_stage_desc *d) {
    arris_stage_desc *copy = calloc(1, sizeof *copy);
    if (copy)
        memcpy(copy, d, d->size < sizeof *copy ? d->size : sizeof *copy);
    return copy;
}

static const char *fault_of(const arris_stage_desc *d) {
    return d->size < offsetof(arris_stage_desc, close) + sizeof d->close
               ? "its descriptor is too short"
           : !d->name || !*d->name || strlen(d->name) >= MAX_NAME ? "it has no valid name"
           : d->name[strspn(d->name, NAME_CHARACTERS)]
               ? "its name has other signs than letters, digits, - and _"
           : !d->process             ? "it has no process"
           : d->n_props && !d->props ? "it has no properties"
                                     : NULL;
}

static void take_stages(plugin *p) {
    size_t n = 0;
    while (p->desc->stages[n])
        n++;
    p->stage = calloc(n, sizeof *p->stage);
    for (size_t i = 0; p->stage && i < n; i++) {
        const char *fault = fault_of(p->desc->stages[i]);
        if (fault)
            snprintf(p->why, sizeof p->why, "stage %zu of it is not valid: %s", i + 1, fault);
        else if ((p->stage[p->n_stages] = adopt(p->desc->stages[i])))
            p->n_stages++;
    }
}

/* dlopen runs the plugin's constructors, so each is opened once and never closed. */
static void open_plugin(plugin *p) {
    if (p->opened)
        return;
    p->opened = true;
    void *so = dlopen(p->path, RTLD_NOW | RTLD_LOCAL);
    const arris_plugin_desc *d = so ? dlsym(so, "arris_plugin") : NULL;
    if (!d)
        snprintf(p->why, sizeof p->why, "%s", dlerror());
    else if (d->abi != ARRIS_ABI)
        snprintf(p->why, sizeof p->why,
                 "it was built for ABI %u of Arris, this is ABI %d: rebuild it", d->abi, ARRIS_ABI);
    else if (d->size < sizeof *d || !d->stages)
        snprintf(p->why, sizeof p->why, "its descriptor is not valid");
    else
        p->desc = d;
    if (p->desc)
        take_stages(p);
}

static const arris_stage_desc *stage_in(const plugin *p, const char *name) {
    for (size_t i = 0; i < p->n_stages; i++)
        if (strcmp(p->stage[i]->name, name) == 0)
            return p->stage[i];
    return NULL;
}

/* Whether a list has the line "stage NAME". */
static bool listed(const char *list, const char *name) {
    size_t n = strlen(name);
    for (const char *l = list; l && *l; l = strchr(l, '\n') ? strchr(l, '\n') + 1 : NULL)
        if (!strncmp(l, "stage ", 6) && !strncmp(l + 6, name, n) && (l[6 + n] == '\n' || !l[6 + n]))
            return true;
    return false;
}

static const arris_stage_desc *built_in(const char *name) {
    for (size_t i = 0; builtin_stages[i]; i++)
        if (strcmp(builtin_stages[i]->name, name) == 0)
            return builtin_stages[i];
    return NULL;
}

static void unknown(const char *name, const token *t, arris_error *err) {
    nearest near = {.word = name};
    char hint[512] = "`arris stages` lists what there is";
    bool broken = false;
    for (size_t i = 0; builtin_stages[i]; i++)
        nearest_offer(&near, builtin_stages[i]->name);
    for (size_t i = 0; i < n_plugins; i++) {
        open_plugin(plugins[i]);
        for (size_t k = 0; k < plugins[i]->n_stages; k++)
            nearest_offer(&near, plugins[i]->stage[k]->name);
        if (*plugins[i]->why && !plugins[i]->list && !broken)
            broken = snprintf(hint, sizeof hint, "a plugin was not loaded: %.120s: %.300s",
                              plugins[i]->path, plugins[i]->why) > 0;
    }
    const char *best = nearest_result(&near);
    error_at(err, t, 0, ARRIS_E_RECIPE, hint, "there is no stage '%.100s'%s%s%s", name,
             best ? "; did you mean '" : "", best ? best : "", best ? "'?" : "");
}

static const arris_stage_desc *find(const char *name, const token *t, arris_error *err) {
    for (int with_list = 1; with_list >= 0; with_list--)
        for (size_t i = 0; i < n_plugins; i++) {
            plugin *p = plugins[i];
            if (with_list ? !listed(p->list, name) : p->list != NULL)
                continue;
            open_plugin(p);
            const arris_stage_desc *d = stage_in(p, name);
            if (d)
                return d;
            if (with_list) {
                error_at(err, t, 0, ARRIS_E_PLUGIN,
                         *p->why ? p->why : "its list of stages is stale",
                         "the plugin of '%s' cannot be loaded: %s", name, p->path);
                return NULL;
            }
        }
    unknown(name, t, err);
    return NULL;
}

const arris_stage_desc *registry_find(const char *name, const token *t, arris_error *err) {
    const arris_stage_desc *d = built_in(name);
    if (d)
        return d;
    pthread_once(&scanned, scan);
    pthread_mutex_lock(&lock);
    d = find(name, t, err);
    pthread_mutex_unlock(&lock);
    return d;
}

typedef struct entry {
    const arris_stage_desc *desc;
    const char *plugin;
    size_t order; /* of two with one name the first is taken */
} entry;

static int by_name(const void *a, const void *b) {
    const entry *x = a, *y = b;
    int names = strcmp(x->desc->name, y->desc->name);
    return names ? names : (x->order > y->order) - (x->order < y->order);
}

void registry_each(void (*f)(const arris_stage_desc *d, const char *plugin, void *user),
                   void *user) {
    static entry all[1024];
    size_t n = 0;
    pthread_once(&scanned, scan);
    pthread_mutex_lock(&lock);
    while (builtin_stages[n]) {
        all[n] = (entry){builtin_stages[n], NULL, n};
        n++;
    }
    for (size_t i = 0; i < n_plugins; i++) {
        open_plugin(plugins[i]);
        for (size_t k = 0; k < plugins[i]->n_stages && n < COUNT(all); k++)
            all[n] = (entry){plugins[i]->stage[k], plugins[i]->path, n}, n++;
    }
    qsort(all, n, sizeof *all, by_name);
    for (size_t i = 0; i < n; i++)
        if (i == 0 || strcmp(all[i].desc->name, all[i - 1].desc->name) != 0)
            f(all[i].desc, all[i].plugin, user);
    pthread_mutex_unlock(&lock);
}
