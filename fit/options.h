// SPDX-License-Identifier: BSD-3-Clause
// The options of a fit: one table of all, and which of them a method has.
#ifndef GONIO_FIT_OPTIONS_H
#define GONIO_FIT_OPTIONS_H

#include "base/keys.h"
#include "fit/method.h"

// Every member of gonio_fit_options but the number of threads, the store and the callback with its context; ends with {0}. Those
// before GONIO_FIT_KEYS_COMMON are every method's.
extern const gonio_key gonio_fit_keys[];
enum { GONIO_FIT_KEYS_COMMON = 6, GONIO_FIT_KEYS = 35 };

// The method that the options ask for (the thesis' form is mba's); NULL: there is none of that name.
const gonio_method *gonio_fit_method_of(const gonio_fit_options *options);
bool gonio_method_has(const gonio_method *method, const gonio_key *key);
// The same by name and by the member of gonio_fit_options.
bool gonio_method_has_member(const char *method, size_t offset);
// GONIO_E_USAGE for an option that the method does not have, with those that it has.
gonio_status gonio_method_refuse(const gonio_method *method, const gonio_key *key, gonio_error *error);
// GONIO_E_USAGE where a value is impossible, or is not the default of an option that the method does not have.
gonio_status gonio_fit_options_check(const gonio_fit_options *options, const gonio_method *method, gonio_error *error);
// Ask for another method, which must exist: what it does not have goes back to the default.
void gonio_fit_options_for(gonio_fit_options *options, const char *method);
// What --help says of an option: what it may be, what it does, and the methods that have it where not all do.
void gonio_fit_option_help(const gonio_key *key, char *text, size_t size);

#endif
