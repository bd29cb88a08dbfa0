// SPDX-License-Identifier: BSD-3-Clause
// Everything that Gonio offers: measure, calibrate, fit, evaluate. What a program needs of it can be included alone; a
// renderer needs model.h only.
//
// Everywhere: a call returns a gonio_status (0 is success) and writes what went wrong into the gonio_error that it was
// given (NULL is allowed). The library never prints and never exits, and leaves the process as it is: locale, umask,
// signals, environment, working folder and standard streams. (One exception: building the thesis' hashed CBMBA form,
// fit option storage "hash", lends rand() another state for its duration.) Calls on different objects may run in
// different threads at once; two calls on one object may not, unless the object's header says so (a model may be
// evaluated by any number of threads). Directions are unit vectors away from the surface, angles are in radians except
// where a name ends in _deg, BRDF values in 1/sr.
#ifndef GONIO_GONIO_H
#define GONIO_GONIO_H

#include "gonio/acquire.h"
#include "gonio/alignment.h"
#include "gonio/characterise.h"
#include "gonio/check.h"
#include "gonio/coverage.h"
#include "gonio/cpm.h"
#include "gonio/direction.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "gonio/library.h"
#include "gonio/metrics.h"
#include "gonio/model.h"
#include "gonio/needs.h"
#include "gonio/output.h"
#include "gonio/patch.h"
#include "gonio/plan.h"
#include "gonio/render.h"
#include "gonio/rig.h"
#include "gonio/sample.h"
#include "gonio/scene.h"
#include "gonio/scene_needs.h"
#include "gonio/session.h"
#include "gonio/session_calibration.h"
#include "gonio/sim.h"
#include "gonio/status.h"
#include "gonio/version.h"

#endif
