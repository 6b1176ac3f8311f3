/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * registry.c: finds stages and subcommands. The folders of ARRIS_PLUGIN_PATH come first, then the
 * one beside the library. A text list X.stages beside X.so says what is in it, so that only what a
 * line names is opened; a plugin without a list is opened when a name is found nowhere else. Why
 * one could not be loaded is kept and told when its stage is asked for.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

enum { MAX_PLUGINS = 256, MAX_PATH = 1024 };

typedef struct plugin {
    char path[MAX_PATH]; /* of the .so */
    char *list;          /* "stage edges\ncommand ...", or NULL */
    bool opened;
    const arris_plugin_desc *desc; /* NULL: not loaded */
    char why[400];                 /* that it could not be */
    const arris_stage_desc **stage;
    size_t n_stages;
    const arris_command_desc *const *command; /* NULL-terminated */
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
    else if (d->size < offsetof(arris_plugin_desc, commands) || !d->stages)
        snprintf(p->why, sizeof p->why, "its descriptor is not valid");
    else
        p->desc = d;
    static const arris_command_desc *const none[] = {NULL};
    p->command = p->desc && p->desc->size >= sizeof *d && d->commands ? d->commands : none;
    if (p->desc)
        take_stages(p);
}

/* What a launch line or the command line names; its word in a list and in messages. */
typedef enum kind { STAGE, COMMAND } kind;
static const char *const kind_word[] = {"stage", "command"};
static const char *const builtin_commands[] = {"launch", "stages"}; /* core/cli */

static const void *in_plugin(const plugin *p, kind k, const char *name) {
    for (size_t i = 0; k == STAGE && i < p->n_stages; i++)
        if (strcmp(p->stage[i]->name, name) == 0)
            return p->stage[i];
    for (size_t i = 0; k == COMMAND && p->command[i]; i++)
        if (strcmp(p->command[i]->name, name) == 0)
            return p->command[i];
    return NULL;
}

/* Whether a list has the line "stage NAME", or "command NAME". */
static bool listed(const char *list, kind k, const char *name) {
    char line[MAX_NAME + 16];
    size_t n = (size_t)snprintf(line, sizeof line, "%s %s", kind_word[k], name);
    for (const char *l = list; l && *l; l = strchr(l, '\n') ? strchr(l, '\n') + 1 : NULL)
        if (n < sizeof line && !strncmp(l, line, n) && (l[n] == '\n' || !l[n]))
            return true;
    return false;
}

static const arris_stage_desc *built_in(const char *name) {
    for (size_t i = 0; builtin_stages[i]; i++)
        if (strcmp(builtin_stages[i]->name, name) == 0)
            return builtin_stages[i];
    return NULL;
}

static void offer_all(nearest *near, kind k, const plugin *p) {
    for (size_t i = 0; k == STAGE && i < p->n_stages; i++)
        nearest_offer(near, p->stage[i]->name);
    for (size_t i = 0; k == COMMAND && p->command[i]; i++)
        nearest_offer(near, p->command[i]->name);
}

static void unknown(kind k, const char *name, const token *t, arris_error *err) {
    nearest near = {.word = name};
    char hint[512];
    bool broken = false;
    snprintf(hint, sizeof hint, "`arris %s` lists what there is", k == STAGE ? "stages" : "--help");
    for (size_t i = 0; k == STAGE && builtin_stages[i]; i++)
        nearest_offer(&near, builtin_stages[i]->name);
    for (size_t i = 0; k == COMMAND && i < COUNT(builtin_commands); i++)
        nearest_offer(&near, builtin_commands[i]);
    for (size_t i = 0; i < n_plugins; i++) {
        open_plugin(plugins[i]);
        offer_all(&near, k, plugins[i]);
        if (*plugins[i]->why && !plugins[i]->list && !broken)
            broken = snprintf(hint, sizeof hint, "a plugin was not loaded: %.120s: %.300s",
                              plugins[i]->path, plugins[i]->why) > 0;
    }
    const char *best = nearest_result(&near);
    error_at(err, t, 0, k == STAGE ? ARRIS_E_RECIPE : ARRIS_E_USAGE, hint,
             "there is no %s '%.100s'%s%s%s", kind_word[k], name, best ? "; did you mean '" : "",
             best ? best : "", best ? "'?" : "");
}

static const void *find(kind k, const char *name, const token *t, arris_error *err) {
    for (int with_list = 1; with_list >= 0; with_list--)
        for (size_t i = 0; i < n_plugins; i++) {
            plugin *p = plugins[i];
            if (with_list ? !listed(p->list, k, name) : p->list != NULL)
                continue;
            open_plugin(p);
            const void *d = in_plugin(p, k, name);
            if (d)
                return d;
            if (with_list) {
                error_at(err, t, 0, ARRIS_E_PLUGIN, *p->why ? p->why : "its list is stale",
                         "the plugin of '%s' cannot be loaded: %s", name, p->path);
                return NULL;
            }
        }
    unknown(k, name, t, err);
    return NULL;
}

static const void *find_locked(kind k, const char *name, const token *t, arris_error *err) {
    pthread_once(&scanned, scan);
    pthread_mutex_lock(&lock);
    const void *d = find(k, name, t, err);
    pthread_mutex_unlock(&lock);
    return d;
}

const arris_stage_desc *registry_find(const char *name, const token *t, arris_error *err) {
    const arris_stage_desc *d = built_in(name);
    return d ? d : find_locked(STAGE, name, t, err);
}

arris_command arris_find_command(const char *name, arris_error *err) {
    const arris_command_desc *d = find_locked(COMMAND, name, NULL, err);
    return d ? d->run : NULL;
}

void arris_print_commands(FILE *out) {
    pthread_once(&scanned, scan);
    pthread_mutex_lock(&lock);
    for (size_t i = 0; i < n_plugins; i++) {
        open_plugin(plugins[i]);
        for (size_t k = 0; plugins[i]->command[k]; k++)
            fprintf(out, "  %-12s %s\n", plugins[i]->command[k]->name,
                    plugins[i]->command[k]->summary);
    }
    pthread_mutex_unlock(&lock);
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
