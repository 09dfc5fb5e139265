// up_axis.h - which axis of a file points up, and the turn that makes it +Y.
// Floor 2, private to scene/.
#ifndef HG_RENDERER_SCENE_UP_AXIS_H
#define HG_RENDERER_SCENE_UP_AXIS_H

#include "renderer/scene/load.h"

// Decides the axis and turns the asset by a node above its roots. In this order: params->up; the
// axis that the format prescribes or the file declares (glTF, FBX, Collada, height maps: +Y once
// loaded); STL files are Z-up; exporters that name themselves in the comments of an OBJ or PLY file
// and are known for an axis; coordinates of a map, or geometry that stands on the plane z = 0 (OBJ,
// PLY, OFF); else +Y. Fills the asset's file.up and file.up_reason. `data` are the bytes of the
// file, NULL where its header does not matter. HG_E_NOMEM.
enum hg_status hg_up_axis_apply(const struct hg_load_params *params, const struct hg_refbuf *data,
    struct hg_asset *asset) HG_MUST_CHECK;

#endif
