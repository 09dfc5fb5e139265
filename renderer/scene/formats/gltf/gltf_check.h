// gltf_check.h - the parts of hg_gltf_check_rules. Floor 2, private to scene/. They warn only.
#ifndef HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_CHECK_H
#define HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_CHECK_H

#include "renderer/scene/formats/gltf/gltf.h"

void hg_gltf_check_meshes(struct hg_gltf *g);
void hg_gltf_check_animations(struct hg_gltf *g);

#endif
