// view_params.h - what follows in the worker from the table protocol/view_params.def: decoding of
// view_set, the parameters' part of a frame's key, and their attributes in EXR files.
// Floor 6, private to server/worker. Pure; safe from any thread.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_PARAMS_H
#define HG_SERVER_WORKER_VIEW_VIEW_PARAMS_H

#include "protocol/view_params.h"
#include "renderer/renderer.h"

// What view_set says takes the place of what was there. Planes are the protocol's: see
// frame_planes.h.
void hg_view_params_apply(struct hg_view_params *params, const struct hgp_view_set *message);

// Appends what settled pictures depend on. after: key of the frame before in a series.
void hg_view_params_write_key(
    struct hg_writer *w, const struct hg_view_params *params, const uint8_t after[32]);

// Attributes of a frame, in one block that stays where it is.
struct hg_view_attributes {
    struct hg_image_attribute items[HGP_VIEW_PARAM_COUNT];
    uint32_t count;
    struct hg_view_params params; // filled
    float exposure;               // factor
    char words[HGP_VIEW_PARAM_COUNT][HGP_WORD_BYTES];
};
// Those that a picture with these parameters has.
void hg_view_params_attributes(const struct hg_view_params *params, struct hg_view_attributes *out);

#endif
