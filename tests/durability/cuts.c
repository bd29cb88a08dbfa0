// SPDX-License-Identifier: BSD-3-Clause
// What of the operations is on the disk when power goes (cuts.h), and the folder that somebody then finds.
#include "tests/durability/cuts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/durability/disk.h"

enum { SECTOR = 512, PAGE = 4096 };
// How a cut deals with what was not synced: all of it is lost, all of it is there, each by chance, each sector by
// chance.
enum { LOSE, KEEP, SOME, TORN, STYLES };

typedef struct cut {
    const disk *d;
    size_t n, commit; // commit: how many changes of names and sizes an ordered disk has
    int model, style, name_style;
    uint64_t random;
} cut;

// ---- content ----

static void set_size(tree_bytes *file, size_t size) {
    if (size > file->size) {
        file->data = realloc(file->data, size);
        memset(file->data + file->size, 0, size - file->size);
    }
    file->size = size;
}

static void put_range(tree_bytes *file, const operation *o, size_t from, size_t to) {
    if ((size_t)o->offset + to > file->size) {
        set_size(file, (size_t)o->offset + to);
    }
    memcpy(file->data + o->offset + from, o->data + from, to - from);
}

// Each sector is there or not.
static void put_torn(cut *c, tree_bytes *file, const operation *o, size_t n) {
    for (size_t from = 0; from < n;) {
        size_t to = from + SECTOR - ((size_t)o->offset + from) % SECTOR;
        to = to < n ? to : n;
        if (tree_chance(&c->random, 2)) {
            put_range(file, o, from, to);
        }
        from = to;
    }
}

static void do_content(tree_bytes *file, const operation *o) {
    if (o->kind == SHIM_R_SIZE) {
        set_size(file, (size_t)o->offset);
    } else {
        put_range(file, o, 0, o->size);
    }
}

static void strict_content(cut *c, tree_bytes *file, const operation *o) {
    const bool whole = c->style == KEEP || (c->style == SOME && tree_chance(&c->random, 2));
    if (whole || (c->style == TORN && o->kind == SHIM_R_SIZE && tree_chance(&c->random, 2))) {
        do_content(file, o);
    } else if (c->style == TORN && o->kind == SHIM_R_DATA) {
        if (o->grows && tree_chance(&c->random, 4)) {
            set_size(file, (size_t)o->offset + o->size > file->size ? (size_t)o->offset + o->size : file->size);
        }
        put_torn(c, file, o, o->size);
    }
}

// false: nothing that comes after is in the file.
static bool ordered_content(cut *c, size_t i, tree_bytes *file, const operation *o) {
    if (o->kind == SHIM_R_SIZE) {
        if (i < c->commit) {
            do_content(file, o);
        }
        return i < c->commit;
    }
    if (!o->grows) {
        strict_content(c, file, o);
        return true;
    }
    if (c->style == KEEP) {
        do_content(file, o);
        return true;
    }
    const size_t pages = o->size / PAGE + 1, kept = c->style == LOSE ? 0 : tree_below(&c->random, (uint32_t)pages + 1);
    const size_t end = kept * PAGE < o->size ? kept * PAGE : o->size;
    if (end > 0) {
        put_range(file, o, 0, end);
    }
    return end == o->size;
}

static size_t last_sync(const cut *c, int node) {
    for (size_t i = c->n; i-- > 0;) {
        const operation *o = &c->d->operations[i];
        if ((o->kind == SHIM_R_SYNC && o->node == node) || o->kind == SHIM_R_SYNC_ALL) {
            return i;
        }
    }
    return 0;
}

static tree_bytes content_of(cut *c, int node) {
    const tree_bytes *begun = &c->d->nodes[node].begun;
    tree_bytes file = {malloc(begun->size + 1), begun->size};
    if (begun->size > 0) {
        memcpy(file.data, begun->data, begun->size);
    }
    const size_t synced = c->model == CUT_NOTHING ? c->n : last_sync(c, node);
    for (size_t i = 0; i < c->n; i++) {
        const operation *o = &c->d->operations[i];
        if (o->node != node || !is_content(o)) {
            continue;
        }
        if (i < synced) {
            do_content(&file, o);
        } else if (c->model == CUT_STRICT) {
            strict_content(c, &file, o);
        } else if (!ordered_content(c, i, &file, o)) {
            break;
        }
    }
    for (size_t i = 0; c->model != CUT_NOTHING && c->d->nodes[node].mapped && i < file.size; i++) {
        file.data[i] = c->style == LOSE ? 0 : (unsigned char)tree_random(&c->random); // written unseen: anything
    }
    return file;
}

// ---- names ----

static bool touches(const operation *o, int folder) {
    return o->folder == folder || (o->folder2 == folder && o->folder2 >= 0);
}

static bool name_is_synced(const cut *c, size_t at) {
    for (size_t i = at + 1; i < c->n; i++) {
        const operation *o = &c->d->operations[i];
        if (o->kind == SHIM_R_SYNC_ALL || (o->kind == SHIM_R_SYNC && touches(&c->d->operations[at], o->node))) {
            return true;
        }
    }
    return false;
}

static space strict_names(cut *c) {
    space names = space_copy(&c->d->begun);
    for (size_t i = 0; i < c->n; i++) {
        const operation *o = &c->d->operations[i];
        if (is_name(o) && (c->model == CUT_NOTHING || c->name_style == KEEP || name_is_synced(c, i) ||
                           (c->name_style != LOSE && tree_chance(&c->random, 2)))) {
            space_do(&names, o);
        }
    }
    return names;
}

static bool changes_metadata(const operation *o, int node) {
    return (is_name(o) && (o->node == node || o->other == node || touches(o, node))) ||
           (o->node == node && (o->kind == SHIM_R_SIZE || (o->kind == SHIM_R_DATA && o->grows)));
}

// The least that a journal of metadata has on the disk: all before the last change of whatever was synced.
static size_t least_commit(const cut *c) {
    size_t least = 0;
    for (size_t i = 0; i < c->n; i++) {
        const operation *o = &c->d->operations[i];
        if (o->kind == SHIM_R_SYNC_ALL) {
            least = i;
        }
        for (size_t k = i; o->kind == SHIM_R_SYNC && k-- > least;) {
            if (changes_metadata(&c->d->operations[k], o->node)) {
                least = k + 1;
                break;
            }
        }
    }
    return least;
}

static space ordered_names(cut *c) {
    space names = space_copy(&c->d->begun);
    for (size_t i = 0; i < c->commit; i++) {
        if (is_name(&c->d->operations[i])) {
            space_do(&names, &c->d->operations[i]);
        }
    }
    return names;
}

// ---- the folder ----

static void build_folder(cut *c, const space *names, char **made, int folder, const char *path, int depth);

static void build_entry(cut *c, const space *names, char **made, const entry *e, const char *path, int depth) {
    char *inner;
    if (asprintf(&inner, "%s/%s", path, e->name) < 0) {
        abort();
    }
    if (c->d->nodes[e->node].is_folder) {
        if (depth < 16) { // a strict disk may have a folder under two names
            build_folder(c, names, made, e->node, inner, depth + 1);
        }
    } else if (made[e->node] != NULL) {
        if (link(made[e->node], inner) != 0) {
            perror(inner);
            exit(1);
        }
    } else {
        tree_bytes file = content_of(c, e->node);
        tree_write(inner, file.data, file.size);
        free(file.data);
        made[e->node] = strdup(inner);
    }
    free(inner);
}

static void build_folder(cut *c, const space *names, char **made, int folder, const char *path, int depth) {
    if (mkdir(path, 0755) != 0) {
        perror(path);
        exit(1);
    }
    for (size_t i = 0; i < names->n; i++) {
        if (names->entries[i].folder == folder && names->entries[i].node >= 0) {
            build_entry(c, names, made, &names->entries[i], path, depth);
        }
    }
}

void disk_build(disk *d, size_t n, int model, uint64_t seed, const char *folder) {
    cut c = {.d = d, .n = n < d->n ? n : d->n, .model = model, .random = seed};
    c.style = (int)tree_below(&c.random, STYLES);
    c.name_style = (int)tree_below(&c.random, STYLES);
    if (model == CUT_ORDERED) {
        const size_t least = least_commit(&c);
        c.commit = least + tree_below(&c.random, (uint32_t)(c.n - least) + 1);
    }
    space names = model == CUT_ORDERED ? ordered_names(&c) : strict_names(&c);
    char **made = calloc((size_t)d->n_nodes, sizeof *made);
    build_folder(&c, &names, made, 0, folder, 0);
    for (int i = 0; i < d->n_nodes; i++) {
        free(made[i]);
    }
    free(made);
    free(names.entries);
}
