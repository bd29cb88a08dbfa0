// SPDX-License-Identifier: BSD-3-Clause
// A folder and the trace of what is done to it, read into nodes and operations.
#include "tests/durability/disk.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// ---- names ----

static entry *find(const space *s, int folder, const char *name) {
    for (size_t i = 0; i < s->n; i++) {
        if (s->entries[i].folder == folder && strcmp(s->entries[i].name, name) == 0) {
            return &s->entries[i];
        }
    }
    return NULL;
}

int space_find(const space *s, int folder, const char *name) {
    const entry *e = find(s, folder, name);
    return e != NULL ? e->node : -1;
}

void space_put(space *s, int folder, const char *name, int node) {
    entry *e = find(s, folder, name);
    if (e == NULL) {
        if (s->n == s->room) {
            s->room = s->room * 2 + 64;
            s->entries = realloc(s->entries, s->room * sizeof *s->entries);
        }
        e = &s->entries[s->n++];
    }
    *e = (entry){folder, node, name};
}

void space_drop(space *s, int folder, const char *name, int node) {
    entry *e = find(s, folder, name);
    if (e != NULL && e->node == node) {
        *e = s->entries[--s->n];
    }
}

space space_copy(const space *s) {
    space copy = {malloc((s->n + 1) * sizeof *s->entries), s->n, s->n + 1};
    memcpy(copy.entries, s->entries, s->n * sizeof *s->entries);
    return copy;
}

void space_do(space *s, const operation *o) {
    if (o->kind == SHIM_R_UNLINK) {
        space_drop(s, o->folder, o->name, o->node);
    } else if (o->kind == SHIM_R_RENAME) {
        space_drop(s, o->folder, o->name, o->node);
        space_put(s, o->folder2, o->name2, o->node);
    } else if (o->kind == SHIM_R_EXCHANGE) {
        space_put(s, o->folder2, o->name2, o->node);
        space_put(s, o->folder, o->name, o->other);
    } else if (o->folder >= 0) {
        space_put(s, o->folder, o->name, o->node);
    }
}

// ---- what is there before ----

static int add_node(disk *d, uint64_t inode, bool is_folder) {
    d->nodes = realloc(d->nodes, ((size_t)d->n_nodes + 1) * sizeof *d->nodes);
    d->nodes[d->n_nodes] = (node){.inode = inode, .is_folder = is_folder};
    return d->n_nodes++;
}

// The newest node of an inode; -1: none.
static int node_of(const disk *d, uint64_t inode) {
    for (int i = d->n_nodes - 1; i >= 0; i--) {
        if (d->nodes[i].inode == inode) {
            return i;
        }
    }
    return -1;
}

static void load(disk *d, const char *path, int folder) {
    DIR *open_folder = opendir(path);
    const struct dirent *list;
    while (open_folder != NULL && (list = readdir(open_folder)) != NULL) {
        char *inner;
        struct stat info;
        if (strcmp(list->d_name, ".") == 0 || strcmp(list->d_name, "..") == 0) {
            continue;
        }
        if (asprintf(&inner, "%s/%s", path, list->d_name) < 0 || lstat(inner, &info) != 0) {
            abort();
        }
        int n = node_of(d, info.st_ino);
        if (n < 0) {
            n = add_node(d, info.st_ino, S_ISDIR(info.st_mode));
            d->nodes[n].begun = tree_read(inner);
            d->nodes[n].size = d->nodes[n].begun.size;
        }
        space_put(&d->begun, folder, strdup(list->d_name), n);
        if (S_ISDIR(info.st_mode)) {
            load(d, inner, n);
        }
        free(inner);
    }
    if (open_folder != NULL) {
        closedir(open_folder);
    }
}

disk *disk_load(const char *folder) {
    disk *d = calloc(1, sizeof *d);
    struct stat info;
    if (d == NULL || stat(folder, &info) != 0) {
        abort();
    }
    add_node(d, info.st_ino, true);
    load(d, folder, 0);
    return d;
}

void disk_free(disk *d) {
    for (int i = 0; d != NULL && i < d->n_nodes; i++) {
        free(d->nodes[i].begun.data);
    }
    if (d != NULL) {
        for (size_t i = 0; i < d->begun.n; i++) {
            free((void *)(uintptr_t)d->begun.entries[i].name);
        }
        free(d->begun.entries);
        free(d->now.entries);
        free(d->nodes);
        free(d->operations);
        free(d->trace.data);
        free(d);
    }
}

// ---- the trace ----

static int known(disk *d, uint64_t inode) { return inode == 0 ? -1 : node_of(d, inode); }

static void read_names(disk *d, const shim_record *r, operation *o) {
    o->folder = known(d, r->folder);
    o->folder2 = known(d, r->folder2);
    if (o->kind == SHIM_R_MAKE) {
        o->node = add_node(d, r->inode, r->is_folder != 0);
    } else if (o->kind == SHIM_R_LINK) {
        o->node = known(d, r->inode);
    } else {
        o->node = space_find(&d->now, o->folder, o->name);
        o->other = o->kind == SHIM_R_EXCHANGE ? space_find(&d->now, o->folder2, o->name2) : -1;
    }
    space_do(&d->now, o);
}

static void read_content(disk *d, operation *o) {
    if (o->node < 0) {
        return;
    }
    node *n = &d->nodes[o->node];
    const size_t end = (size_t)o->offset + o->size;
    o->grows = end > n->size;
    n->size = o->kind == SHIM_R_SIZE ? (size_t)o->offset : end > n->size ? end : n->size;
}

bool disk_trace(disk *d, const char *path) {
    d->trace = tree_read(path);
    if (d->trace.data == NULL) {
        return false;
    }
    d->now = space_copy(&d->begun);
    size_t room = 0;
    for (size_t at = 0; at + sizeof(shim_record) <= d->trace.size;) {
        shim_record r;
        memcpy(&r, d->trace.data + at, sizeof r);
        if (r.size < sizeof r || r.size > d->trace.size - at) {
            break; // the program died while it wrote the record
        }
        const char *names = (const char *)d->trace.data + at + sizeof r;
        if (d->n == room) {
            room = room * 2 + 256;
            d->operations = realloc(d->operations, room * sizeof *d->operations);
        }
        operation *o = &d->operations[d->n];
        *o = (operation){.kind = r.kind,
                         .folder = -1,
                         .folder2 = -1,
                         .other = -1,
                         .name = names,
                         .name2 = names + r.name_size,
                         .size = r.data_size,
                         .offset = r.offset};
        o->data = (const unsigned char *)names + r.name_size + r.name2_size;
        if (is_name(o)) {
            read_names(d, &r, o);
        } else {
            o->node = known(d, r.inode);
            if (is_content(o)) {
                read_content(d, o);
            } else if (o->kind == SHIM_R_MAPPED && o->node >= 0) {
                d->nodes[o->node].mapped = true;
            }
        }
        d->n += o->node >= 0 || o->kind == SHIM_R_SYNC_ALL;
        at += r.size;
    }
    return true; // a command may change nothing
}

size_t disk_operations(const disk *d) { return d->n; }

static const char *name_of(const disk *d, int node) {
    for (size_t i = 0; i < d->now.n; i++) {
        if (d->now.entries[i].node == node) {
            return d->now.entries[i].name;
        }
    }
    for (size_t i = d->n; i-- > 0;) { // the last name that it had
        const operation *o = &d->operations[i];
        if (is_name(o) && o->node == node && o->name[0] != 0) {
            return o->kind == SHIM_R_RENAME ? o->name2 : o->name;
        }
    }
    return node == 0 ? "the parent folder" : "?";
}

void disk_tell(const disk *d, size_t i, char *text, size_t room) {
    static const char *const kinds[] = {"make",   "write",  "set the size of", "sync", "link",
                                        "unlink", "rename", "exchange",        "map",  "sync everything after"};
    if (i >= d->n) {
        snprintf(text, room, "the end");
        return;
    }
    const operation *o = &d->operations[i];
    snprintf(text, room, "%s %s%s%s", kinds[o->kind], is_name(o) ? o->name : name_of(d, o->node),
             o->name2[0] != 0 ? " as " : "", o->name2);
}

size_t disk_synced(const disk *d, size_t n, const char *name) {
    for (size_t i = n < d->n ? n : d->n; i-- > 0;) {
        const operation *o = &d->operations[i];
        if (o->kind == SHIM_R_SYNC && strncmp(name_of(d, o->node), name, strlen(name)) == 0) {
            return i + 1;
        }
    }
    return 0;
}
