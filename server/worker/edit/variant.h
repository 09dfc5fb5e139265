// variant.h - material variants by name. Floor 6 (worker). Thread: the render thread.
#ifndef HG_SERVER_WORKER_EDIT_VARIANT_H
#define HG_SERVER_WORKER_EDIT_VARIANT_H

#include "protocol/hgp.h"
#include "renderer/scene/asset.h"

// *index: of the variant of that name; -1: the name is empty. HG_E_NOTFOUND lists those that there
// are, as far as they fit.
enum hg_status hg_variant_find(const struct hg_asset *asset, struct hgp_str name, int32_t *index,
    struct hg_error *err) HG_MUST_CHECK;

#endif
