// SPDX-License-Identifier: BSD-3-Clause
// Light from infinitely far away all around: a picture over longitude and latitude.
#ifndef GONIO_SCENE_WORLD_ENVIRONMENT_H
#define GONIO_SCENE_WORLD_ENVIRONMENT_H

#include "gonio/direction.h"
#include "gonio/scene.h"
#include "scene/world/settings.h"

typedef struct world_environment world_environment;

// Of an environment's settings: its picture, or the same radiance everywhere where it has none. GONIO_E_INPUT for a
// picture that cannot be used.
gonio_status gonio_world_environment_new(const scene_light_settings *light, world_environment **out,
                                         gonio_error *error);
void gonio_world_environment_free(world_environment *environment); // NULL is allowed
bool gonio_world_environment_visible(const world_environment *environment);
void gonio_world_environment_radiance(const world_environment *environment, gonio_vec3 toward, double rgb[3]);
// Draws a direction in proportion to the light from there and returns its density (1/sr), 0 where there is no light.
double gonio_world_environment_sample(const world_environment *environment, const double u[2], gonio_vec3 *toward,
                                      double rgb[3]);
double gonio_world_environment_pdf(const world_environment *environment, gonio_vec3 toward);

#endif
