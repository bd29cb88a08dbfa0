#include "gonio/version.h"

const char *gonio_version(void) { return GONIO_VERSION; }
