// default_light.h - the environment of a scene for which none was chosen.
// Floor 2. Depends on the scene as it is posed alone, never on cameras or on earlier states.
//
// A scene without lights gets the built-in sky. One with lights of its own gets the sky's scattered
// light, without its sun, as a fill: two stops under the key light, so that shadows can be read and
// the lights still make the picture (a key-to-fill ratio of 4:1, which film lighting calls low
// key).
#ifndef HG_RENDERER_SCENE_DEFAULT_LIGHT_H
#define HG_RENDERER_SCENE_DEFAULT_LIGHT_H

#include "renderer/scene/scene.h"

#define HG_FILL_RATIO 0.25f // of fill to key

// Illuminance that the lights of the scene give its surfaces that face them, without shadows, lux:
// the upper quartile over its meshes, each at the distance of its bounding sphere. 0: no light
// reaches any. At most 256 meshes, evenly spread, are looked at. Call after hg_scene_update.
float hg_key_illuminance(const struct hg_scene *scene);

// Writes kind, sun and intensity of an environment that is `automatic`; others stay. Its revision
// is the scene's when that changes it. Calls hg_scene_update.
void hg_default_light_update(struct hg_scene *scene);

#endif
