// yuv.h - 8-bit RGBA to planar Y'CbCr for video encoders.
// Floor 6, private to server/worker. Pure but for the planes' memory; one thread at a time.
//
// BT.709 matrix, limited range (Y' 16..235, Cb and Cr 16..240), from display values as they are:
// the transfer function stays sRGB's. 4:2:0 chroma is sited at the left: in line with even columns,
// between two rows; horizontally (1 2 1) / 4, vertically the mean. Alpha is dropped.
// Source: ITU-R BT.709-6, section 3; siting as chroma_sample_loc_type 0 of H.264, annex E.
#ifndef HG_SERVER_WORKER_ENCODE_YUV_H
#define HG_SERVER_WORKER_ENCODE_YUV_H

#include <stdbool.h>

#include "base/status.h"

struct hg_yuv {
    uint32_t width, height; // px, of the planes of luma
    bool full_chroma;       // 4:4:4
    uint8_t *planes[3];     // Y', Cb, Cr; in one block
    uint32_t strides[3];    // bytes
    int32_t *rows;          // chroma of two rows of pixels
};

// Planes for pictures of width x height (1..16384 px), padded to multiples of two, and to
// `least` px. HG_E_NOMEM.
enum hg_status hg_yuv_create(uint32_t width, uint32_t height, uint32_t least, bool full_chroma,
    struct hg_yuv *out) HG_MUST_CHECK;
void hg_yuv_finish(struct hg_yuv *yuv); // accepts a zeroed one

// rgba: [height][width] x 4 bytes, no larger than the planes; the rest repeats the last column and
// row.
void hg_yuv_convert(struct hg_yuv *yuv, const uint8_t *rgba, uint32_t width, uint32_t height);

#endif
