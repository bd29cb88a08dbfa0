// SPDX-License-Identifier: BSD-3-Clause
// gonio kinds: the kinds of model, and the analytic formulae that a SPEC can name.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "brdf/analytic/formula.h"
#include "brdf/kind.h"
#include "host/cli/cli.h"

// What a kind has of its own; where it has not, eval stands in (a gradient comes from differences).
static const struct {
    const char *name;
    size_t offset;
} abilities[] = {
    {"save", offsetof(gonio_model_ops, save)},
    {"f32", offsetof(gonio_model_ops, eval_f32)},
    {"channel", offsetof(gonio_model_ops, eval_channel)},
    {"many", offsetof(gonio_model_ops, eval_many)},
    {"gradient", offsetof(gonio_model_ops, gradient)},
    {"sigma", offsetof(gonio_model_ops, sigma)},
    {"sample", offsetof(gonio_model_ops, sample)},
    {"support", offsetof(gonio_model_ops, support)},
};
#define ABILITIES (sizeof abilities / sizeof *abilities)

static bool has(const gonio_kind *kind, size_t ability) {
    void (*function)(void);
    memcpy(&function, (const char *)kind->ops + abilities[ability].offset, sizeof function);
    return function != NULL;
}

static json_t *kind_json(const gonio_kind *kind) {
    json_t *object = json_pack("{s:s,s:s}", "name", kind->name, "summary", kind->summary);
    for (size_t a = 0; a < ABILITIES; a++) {
        json_object_set_new(object, abilities[a].name, json_boolean(has(kind, a)));
    }
    return object;
}

static json_t *formula_json(const gonio_formula *formula) {
    json_t *parameters = json_array();
    for (int k = 0; k < formula->n; k++) {
        const gonio_formula_parameter *p = &formula->parameters[k];
        json_array_append_new(parameters,
                              json_pack("{s:s,s:f,s:f,s:o,s:s}", "name", p->name, "minimum", p->minimum, "maximum",
                                        p->maximum, "initial", cli_json_real(p->initial), "text", p->text));
    }
    return json_pack("{s:s,s:s,s:s,s:s?,s:o}", "name", formula->name, "summary", formula->summary, "source",
                     formula->source, "alias", formula->alias.name, "parameters", parameters);
}

static int print_json(void) {
    json_t *kinds = json_array(), *formulae = json_array();
    for (const gonio_kind *const *k = gonio_kinds(); *k != NULL; k++) {
        json_array_append_new(kinds, kind_json(*k));
    }
    for (const gonio_formula *const *f = gonio_formulae(); *f != NULL; f++) {
        json_array_append_new(formulae, formula_json(*f));
    }
    return cli_json(json_pack("{s:o,s:o}", "kinds", kinds, "formulae", formulae));
}

static void print_kinds(void) {
    printf("# Kinds of model\n\n| %-11s |", "kind");
    for (size_t a = 0; a < ABILITIES; a++) {
        printf(" %-8s |", abilities[a].name);
    }
    printf(" what it is |\n|-------------|");
    for (size_t a = 0; a < ABILITIES; a++) {
        printf("----------|");
    }
    printf("---|\n");
    for (const gonio_kind *const *k = gonio_kinds(); *k != NULL; k++) {
        printf("| %-11s |", (*k)->name);
        for (size_t a = 0; a < ABILITIES; a++) {
            printf(" %-8s |", has(*k, a) ? "yes" : "");
        }
        printf(" %s |\n", (*k)->summary);
    }
    puts("\nWhere a kind has no function of its own, `eval` stands in; a gradient then comes from differences. "
         "`sigma`\n"
         "and `support`: models that were fitted with an uncertainty.");
}

static void print_formula(const gonio_formula *formula) {
    printf(
        "\n## %s\n\n%s. %s.\n\n| %-9s | %-14s | %-8s | what it is |\n|-----------|----------------|----------|---|\n",
        formula->name, formula->summary, formula->source, "parameter", "bounds", "left out");
    for (int k = 0; k < formula->n; k++) {
        const gonio_formula_parameter *p = &formula->parameters[k];
        char bounds[48], initial[24] = "an error";
        snprintf(bounds, sizeof bounds, "%g to %g", p->minimum, p->maximum);
        if (!isnan(p->initial)) {
            snprintf(initial, sizeof initial, "%g", p->initial);
        }
        printf("| %-9s | %-14s | %-8s | %s |\n", p->name, bounds, initial, p->text);
    }
    const gonio_formula_alias *alias = &formula->alias;
    if (alias->name != NULL) {
        printf("| %-9s | %-14s | %-8s | %s%s%s, times %g |\n", alias->name, "", "",
               formula->parameters[alias->first].name, alias->last > alias->first ? " and " : "",
               alias->last > alias->first ? formula->parameters[alias->last].name : "", alias->scale);
    }
}

// A page that is docs/kinds.md as it stands (tests/system/kinds.sh compares them).
static void print_page(void) {
    print_kinds();
    puts(
        "\n# Analytic formulae\n\nA SPEC names them, as in `ward:rho_d=0.3,rho_s=0.2,alpha=0.15`; a value a channel is "
        "`rho_d=0.3/0.2/0.1`, and\n`+` adds terms. Made a model file by `gonio convert spec:SPEC OUT.gonio`.\n\n"
        "Published fits of measured materials have names, `sgd:NAME` (Bagher et al. 2012), `ngan-ward:NAME`,\n"
        "`ngan-blinn-phong:NAME`, `ngan-cook-torrance:NAME` and `ngan-lafortune:NAME` (Ngan et al. 2005): three "
        "channels,\nread from the tables in `$GONIO_DATA/fits`.\n\n"
        "A thin sheet is `SPEC|SPEC|SPEC|SPEC`: reflection, transmission, reflection-back, transmission-back, of which "
        "any may be empty.\n"
        "`translucent:rho=0.2,rho_s=0.1,tau=0.3,tau_s=0.2,alpha=0.2,alpha_t=0.3` has two like faces, each diffuse with "
        "a lobe of ward's about\n"
        "the mirror direction (alpha) and about the way straight through (alpha_t); the first four are 0 where left "
        "out and sum to at most 1.");
    for (const gonio_formula *const *f = gonio_formulae(); *f != NULL; f++) {
        print_formula(*f);
    }
}

static int run(int argc, char **argv) {
    extern const cli_verb cmd_kinds;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_kinds, NULL, argc, argv, NULL, 0, 0, &count, &common)) {
        return 2;
    }
    if (common.json) {
        return print_json();
    }
    print_page();
    return 0;
}

const cli_verb cmd_kinds = {"kinds", "[--json]", "the kinds of model and the analytic formulae that there are", run};
