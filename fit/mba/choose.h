// Which coordinates, domain and level a multilevel fit should use, from the training samples alone.
#ifndef GONIO_FIT_MBA_CHOOSE_H
#define GONIO_FIT_MBA_CHOOSE_H

#include "fit/prepare/scatter.h"

typedef struct gonio_mba_choice {
    gonio_scatter_options scatter;
    int level;
    double score; // of the choice; NaN where nothing was open
    char note[256];
} gonio_mba_choice;

// Fill *choice from the options; what they leave open is chosen by the error on inner folds of the samples. A method
// named by hand works in Nusselt coordinates and the linear domain unless told otherwise; the default method chooses
// them too.
gonio_status gonio_mba_choose(const gonio_samples *samples, const gonio_fit_options *options, gonio_mba_choice *choice,
                              gonio_error *error);

#endif
