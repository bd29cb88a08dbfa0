// SPDX-License-Identifier: BSD-3-Clause
#include "scene/cpm/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "brdf/checksum.h"
#include "gonio/output.h"

#define MAGIC "gonioCPM"
#define PATH_SIZE 4096

typedef struct part_head {
    char magic[8];
    uint64_t fingerprint, n, bytes, checksum; // the lengths of n records follow, then they
} part_head;

int gonio_cpm_levels(int resolution) {
    int levels = 1;
    while (resolution > 1) {
        resolution /= 2;
        levels++;
    }
    return levels;
}

size_t gonio_cpm_level_start(int resolution, int level) {
    size_t start = 0;
    for (int l = 0; l < level; l++) {
        start += (size_t)(resolution >> l) * (size_t)(resolution >> l);
    }
    return start;
}

static uint64_t checksum_of(const void *data, size_t size) {
    gonio_checksum sum = gonio_checksum_begin();
    gonio_checksum_add(&sum, data, size);
    return gonio_checksum_end(&sum);
}

static void name_part(const char *folder, int level, uint32_t first, char path[PATH_SIZE]) {
    snprintf(path, PATH_SIZE, "%s/part-%02d-%07u", folder, level, first);
}

// ---- parts ----

// The records of a part's body, copied. false: they do not fit it.
static bool unpack(const part_head *head, const char *body, size_t n, cpm_record **records) {
    const uint64_t *lengths = (const uint64_t *)(const void *)body;
    size_t at = n * sizeof *lengths;
    for (size_t k = 0; k < n; k++) {
        const size_t length = (size_t)lengths[k];
        if (length == 0) {
            continue;
        }
        if (length < sizeof(cpm_record) || length > head->bytes - at || (records[k] = malloc(length)) == NULL) {
            return false;
        }
        memcpy(records[k], body + at, length);
        at += length;
        if (gonio_cpm_record_bytes(records[k]) != length) {
            return false;
        }
    }
    return at == head->bytes;
}

bool gonio_cpm_part_read(const char *folder, int level, uint32_t first, uint64_t fingerprint, size_t n,
                         cpm_record **records) {
    char path[PATH_SIZE], *data = NULL;
    size_t size;
    part_head head;
    name_part(folder, level, first, path);
    memset(records, 0, n * sizeof *records);
    if (access(path, R_OK) != 0 || gonio_file_read(path, 0, &data, &size, NULL) != GONIO_OK || size < sizeof head) {
        free(data);
        return false;
    }
    memcpy(&head, data, sizeof head);
    bool good = memcmp(head.magic, MAGIC, sizeof head.magic) == 0 && head.fingerprint == fingerprint && head.n == n &&
                head.bytes == size - sizeof head && head.bytes >= n * sizeof(uint64_t) &&
                head.checksum == checksum_of(data + sizeof head, size - sizeof head);
    good = good && unpack(&head, data + sizeof head, n, records);
    for (size_t k = 0; k < n && !good; k++) {
        free(records[k]);
        records[k] = NULL;
    }
    free(data);
    return good;
}

gonio_status gonio_cpm_part_write(const char *folder, int level, uint32_t first, uint64_t fingerprint, size_t n,
                                  cpm_record *const *records, gonio_error *error) {
    size_t bytes = n * sizeof(uint64_t);
    for (size_t k = 0; k < n; k++) {
        bytes += records[k] != NULL ? gonio_cpm_record_bytes(records[k]) : 0;
    }
    char path[PATH_SIZE], *body = calloc(1, bytes);
    gonio_output *output;
    if (body == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a part of the map");
    }
    size_t at = n * sizeof(uint64_t);
    for (size_t k = 0; k < n; k++) {
        const uint64_t length = records[k] != NULL ? gonio_cpm_record_bytes(records[k]) : 0;
        memcpy(body + k * sizeof length, &length, sizeof length);
        if (length > 0) {
            memcpy(body + at, records[k], (size_t)length);
            at += (size_t)length;
        }
    }
    part_head head = {.fingerprint = fingerprint, .n = n, .bytes = bytes, .checksum = checksum_of(body, bytes)};
    memcpy(head.magic, MAGIC, sizeof head.magic);
    name_part(folder, level, first, path);
    gonio_status status = gonio_output_open(path, &output, error);
    if (status == GONIO_OK) {
        fwrite(&head, sizeof head, 1, gonio_output_stream(output));
        fwrite(body, 1, bytes, gonio_output_stream(output));
        status = gonio_output_commit(output, error);
    }
    free(body);
    return status;
}

// ---- the folder ----

// Is it a name of ours with what gonio_output_open() puts behind it until it is whole?
static bool is_half_written(const char *name) {
    static const char *const ours[] = {"part-", "map.cpm.", "milliseconds."};
    const char *dot = strrchr(name, '.');
    bool mine = false;
    for (size_t k = 0; k < sizeof ours / sizeof *ours; k++) {
        mine = mine || strncmp(name, ours[k], strlen(ours[k])) == 0;
    }
    return mine && dot != NULL && strlen(dot) == 7 && strspn(dot + 1, "0123456789abcdef") == 6;
}

int gonio_cpm_folder_hold(const char *folder) {
    const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0 || flock(fd, LOCK_EX | LOCK_NB) != 0) {
        const int why = errno;
        if (fd >= 0) {
            close(fd);
        }
        errno = why;
        return -1;
    }
    DIR *names = opendir(folder);
    const struct dirent *entry;
    while (names != NULL && (entry = readdir(names)) != NULL) {
        if (is_half_written(entry->d_name)) {
            unlinkat(fd, entry->d_name, 0);
        }
    }
    if (names != NULL) {
        closedir(names);
    }
    return fd;
}

// ---- seconds ----

// Milliseconds, which no locale writes otherwise.
void gonio_cpm_seconds_read(const char *folder, cpm_seconds *seconds) {
    char path[PATH_SIZE];
    uint64_t ms[3];
    *seconds = (cpm_seconds){0};
    snprintf(path, sizeof path, "%s/milliseconds", folder);
    FILE *file = fopen(path, "re");
    if (file != NULL && fscanf(file, "%15" SCNu64 " %15" SCNu64 " %15" SCNu64, &ms[0], &ms[1], &ms[2]) == 3) {
        *seconds = (cpm_seconds){(double)ms[0] / 1e3, (double)ms[1] / 1e3, (double)ms[2] / 1e3};
    }
    if (file != NULL) {
        fclose(file);
    }
}

gonio_status gonio_cpm_seconds_write(const char *folder, const cpm_seconds *s, gonio_error *error) {
    char path[PATH_SIZE];
    gonio_output *output;
    snprintf(path, sizeof path, "%s/milliseconds", folder);
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    fprintf(gonio_output_stream(output), "%.0f %.0f %.0f\n", 1e3 * s->area, 1e3 * s->reflectance, 1e3 * s->choice);
    return gonio_output_commit(output, error);
}

void gonio_cpm_seconds_tell(const char *folder, gonio_cpm_facts *facts) {
    cpm_seconds seconds;
    gonio_cpm_seconds_read(folder, &seconds);
    facts->area_s = seconds.area;
    facts->reflectance_s = seconds.reflectance;
    facts->choice_s = seconds.choice;
}

// ---- joining ----

static void add_facts(gonio_cpm_facts *facts, const cpm_record *record) {
    facts->texels++;
    facts->points += record->points;
    facts->coefficients += record->coefficients;
    facts->mean_snr_db += (double)record->snr_db;
}

// Writes the records of all parts behind each other; the table learns where they are.
static gonio_status copy_parts(const char *folder, cpm_head *head, FILE *stream, cpm_entry *entries, uint64_t *at,
                               gonio_error *error) {
    cpm_record *records[CPM_PART];
    for (int level = 0; level < (int)head->levels; level++) {
        const size_t side = head->resolution >> level, texels = side * side;
        cpm_entry *own = entries + gonio_cpm_level_start((int)head->resolution, level);
        for (size_t first = 0; first < texels; first += CPM_PART) {
            const size_t n = texels - first < CPM_PART ? texels - first : CPM_PART;
            if (!gonio_cpm_part_read(folder, level, (uint32_t)first, head->fingerprint, n, records)) {
                return gonio_fail_line(error, GONIO_E_INPUT, folder, -1, "a part of the map is damaged or gone");
            }
            for (size_t k = 0; k < n; k++) {
                if (records[k] != NULL) {
                    const size_t bytes = gonio_cpm_record_bytes(records[k]);
                    own[first + k] = (cpm_entry){*at, checksum_of(records[k], bytes)};
                    *at += fwrite(records[k], 1, bytes, stream);
                    add_facts(&head->facts, records[k]);
                    head->most_points = records[k]->points > head->most_points ? records[k]->points : head->most_points;
                    free(records[k]);
                }
            }
        }
    }
    return GONIO_OK;
}

static uint64_t sum_all(const cpm_head *head, const void *surface, size_t surface_bytes, const cpm_entry *entries,
                        size_t texels) {
    cpm_head blank = *head;
    blank.checksum = 0;
    gonio_checksum sum = gonio_checksum_begin();
    gonio_checksum_add(&sum, &blank, sizeof blank);
    gonio_checksum_add(&sum, surface, surface_bytes);
    gonio_checksum_add(&sum, entries, texels * sizeof *entries);
    return gonio_checksum_end(&sum);
}

static void remove_parts(const char *folder, const cpm_head *head) {
    for (int level = 0; level < (int)head->levels; level++) {
        const size_t side = head->resolution >> level;
        for (size_t first = 0; first < side * side; first += CPM_PART) {
            char path[PATH_SIZE];
            name_part(folder, level, (uint32_t)first, path);
            unlink(path);
        }
    }
}

static gonio_status write_all(const char *folder, cpm_head *head, const void *surface, size_t surface_bytes,
                              cpm_entry *entries, size_t texels, gonio_error *error) {
    char path[PATH_SIZE];
    gonio_output *output;
    snprintf(path, sizeof path, "%s/map.cpm", folder);
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    memcpy(head->magic, MAGIC, sizeof head->magic);
    head->surface = sizeof *head;
    head->table = head->surface + surface_bytes;
    head->bytes = head->table + texels * sizeof *entries;
    fseeko(stream, (off_t)head->bytes, SEEK_SET);
    status = copy_parts(folder, head, stream, entries, &head->bytes, error);
    gonio_cpm_facts *facts = &head->facts;
    facts->mean_snr_db = facts->texels > 0 ? facts->mean_snr_db / (double)facts->texels : 0;
    facts->empty = texels - facts->texels;
    facts->bytes = head->bytes;
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    head->checksum = sum_all(head, surface, surface_bytes, entries, texels);
    fseeko(stream, 0, SEEK_SET);
    fwrite(head, sizeof *head, 1, stream);
    fwrite(surface, 1, surface_bytes, stream);
    fwrite(entries, sizeof *entries, texels, stream);
    return gonio_output_commit(output, error);
}

gonio_status gonio_cpm_store_join(const char *folder, cpm_head *head, const cpm_surface *surface, gonio_error *error) {
    const size_t texels = gonio_cpm_level_start((int)head->resolution, (int)head->levels);
    const size_t surface_bytes = (gonio_cpm_surface_bytes(surface) + 7) / 8 * 8;
    cpm_entry *entries = calloc(texels, sizeof *entries);
    void *packed = calloc(1, surface_bytes);
    gonio_status status = entries != NULL && packed != NULL
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for a map of %zu texels", texels);
    if (status == GONIO_OK) {
        gonio_cpm_surface_pack(surface, packed);
        status = write_all(folder, head, packed, surface_bytes, entries, texels, error);
    }
    if (status == GONIO_OK) {
        remove_parts(folder, head);
    }
    free(entries);
    free(packed);
    return status;
}

// ---- reading ----

void gonio_cpm_store_release(cpm_store *store) {
    gonio_cpm_surface_free(store->surface);
    if (store->data != NULL) {
        munmap((void *)store->data, store->size);
    }
    memset(store, 0, sizeof *store);
}

static bool is_sound(const cpm_store *s) {
    const cpm_head *h = &s->head;
    if (memcmp(h->magic, MAGIC, sizeof h->magic) != 0 || h->version != CPM_VERSION || h->bytes != s->size ||
        h->resolution < 1 || h->resolution > 1024 || (int)h->levels != gonio_cpm_levels((int)h->resolution) ||
        h->side < 4 || h->side > CPM_FACE_MAX || h->surface != sizeof *h || h->table < h->surface ||
        h->table > s->size) {
        return false;
    }
    const size_t texels = gonio_cpm_level_start((int)h->resolution, (int)h->levels);
    return texels * sizeof(cpm_entry) <= s->size - h->table &&
           h->checksum == sum_all(h, s->data + h->surface, (size_t)(h->table - h->surface),
                                  (const cpm_entry *)(const void *)(s->data + h->table), texels);
}

gonio_status gonio_cpm_store_open(const char *folder, cpm_store *s, gonio_error *error) {
    char path[PATH_SIZE];
    struct stat facts;
    memset(s, 0, sizeof *s);
    snprintf(path, sizeof path, "%s/map.cpm", folder);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &facts) != 0) {
        const int why = errno;
        if (fd >= 0) {
            close(fd);
        }
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(why));
    }
    s->size = (size_t)facts.st_size;
    void *data = s->size >= sizeof s->head ? mmap(NULL, s->size, PROT_READ, MAP_SHARED, fd, 0) : MAP_FAILED;
    close(fd);
    if (data != MAP_FAILED) {
        s->data = data;
        memcpy(&s->head, data, sizeof s->head);
    }
    if (data == MAP_FAILED || !is_sound(s)) {
        gonio_cpm_store_release(s);
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a characteristic point map, or a damaged one");
    }
    s->entries = (const cpm_entry *)(const void *)(s->data + s->head.table);
    // Its own length stands in front; what follows pads it to a multiple of 8.
    size_t bytes = (size_t)(s->head.table - s->head.surface);
    for (int pad = 0; pad < 8 && s->surface == NULL && bytes > 0; pad++, bytes--) {
        s->surface = gonio_cpm_surface_unpack(s->data + s->head.surface, bytes);
    }
    if (s->surface == NULL) {
        gonio_cpm_store_release(s);
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its mesh is damaged, or there is no memory for it");
    }
    return GONIO_OK;
}

const cpm_record *gonio_cpm_store_record(const cpm_store *s, int level, uint32_t texel, bool *damaged) {
    const cpm_entry *entry = &s->entries[gonio_cpm_level_start((int)s->head.resolution, level) + texel];
    *damaged = false;
    if (entry->offset == 0) {
        return NULL;
    }
    const cpm_record *record = (const cpm_record *)(const void *)(s->data + entry->offset);
    // Lengths are checked before they are added up: both are 32 bits.
    const bool fits = entry->offset % 8 == 0 && entry->offset <= s->size && s->size - entry->offset >= sizeof *record &&
                      gonio_cpm_record_bytes(record) <= s->size - entry->offset;
    *damaged = !fits || checksum_of(record, gonio_cpm_record_bytes(record)) != entry->checksum;
    return *damaged ? NULL : record;
}
