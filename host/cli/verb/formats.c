// SPDX-License-Identifier: BSD-3-Clause
// gonio formats: what can be read and written, and with which options.
#include <stdio.h>

#include "gonio/io.h"
#include "host/cli/cli.h"

static json_t *options_json(const gonio_format_option *list) {
    json_t *options = json_array();
    for (const gonio_format_option *o = list; o->name != NULL; o++) {
        json_array_append_new(options, json_pack("{s:s,s:s,s:s,s:s}", "name", o->name, "argument", o->argument,
                                                 "default", o->standard, "help", o->help));
    }
    return options;
}

static json_t *aliases_json(const gonio_format_alias *list) {
    json_t *aliases = json_array();
    for (const gonio_format_alias *a = list; a->name != NULL; a++) {
        json_array_append_new(aliases, json_string(a->name));
    }
    return aliases;
}

static json_t *to_json(const gonio_format_facts *f) {
    return json_pack("{s:s,s:s,s:s,s:b,s:b,s:b,s:b,s:f,s:o,s:o,s:o}", "name", f->name, "summary", f->summary,
                     "extensions", f->extensions, "reads", f->reads, "reads_table", f->reads_table, "writes", f->writes,
                     "writes_table", f->writes_table, "precision", f->precision, "options", options_json(f->options),
                     "write_options", options_json(f->write_options), "aliases", aliases_json(f->aliases));
}

static void print(const gonio_format_facts *f) {
    printf("%-10s %-15s %-15s %-9s %s\n", f->name,
           f->reads_table ? "samples, model"
           : f->reads     ? "samples"
                          : "-",
           f->writes         ? "from samples"
           : f->writes_table ? "from a model"
                             : "-",
           f->extensions, f->summary);
    for (const gonio_format_alias *a = f->aliases; a->name != NULL; a++) {
        printf("%10s --to %s: the same%s%s%s%s\n", "", a->name, a->setting != NULL ? " with --" : "",
               a->setting != NULL ? a->setting : "", a->setting != NULL ? " " : "", a->setting != NULL ? a->value : "");
    }
    for (const gonio_format_option *o = f->options; o->name != NULL; o++) {
        printf("%10s --%s %s (%s): %s\n", "", o->name, o->argument, o->standard, o->help);
    }
    for (const gonio_format_option *o = f->write_options; o->name != NULL; o++) {
        printf("%10s --%s %s (written: %s): %s\n", "", o->name, o->argument, o->standard, o->help);
    }
}

static int run(int argc, char **argv) {
    extern const cli_verb cmd_formats;
    const cli_option options[] = {{0}};
    cli_common common;
    int count;
    if (!cli_parse(&cmd_formats, options, argc, argv, NULL, 0, 0, &count, &common)) {
        return 2;
    }
    json_t *all = json_array();
    gonio_format_facts f;
    if (!common.json) {
        printf("%-10s %-15s %-15s %-9s\n", "name", "read as", "written", "files");
    }
    for (int i = 0; gonio_format_get(i, &f); i++) {
        if (common.json) {
            json_array_append_new(all, to_json(&f));
        } else {
            print(&f);
        }
    }
    if (common.json) {
        return cli_json(json_pack("{s:o}", "formats", all));
    }
    json_decref(all);
    puts("\nFiles are recognised by what is in them; --channel NAME and --wavelength NM go with every one.\n"
         "A fitted model (.gonio) is no format of samples: `gonio convert` samples it and saves a spec as one.");
    return 0;
}

const cli_verb cmd_formats = {"formats", "", "the file formats: which are read and written, and their options", run};
