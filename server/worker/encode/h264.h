// h264.h - what the H.264 encoders have in common: quantisers and the decoder's configuration.
// Floor 6, private to server/worker. Pure; any thread.
#ifndef HG_SERVER_WORKER_ENCODE_H264_H
#define HG_SERVER_WORKER_ENCODE_H264_H

#include <stddef.h>
#include <stdint.h>

#include "server/worker/encode/encode_request.h"

enum {
    HG_H264_LEAST_PX = 16,         // side of a picture
    HG_H264_MOST_PX = 36000 * 256, // of a picture: level 5.2 less what is padded
};

// Quantiser 15..51 of a quality 1..100; 22 at 80.
int hg_h264_quantiser(uint8_t quality);

// "avc1.42c01f" from the sequence parameter set of an access unit (Annex B); "" where there is
// none. Source: RFC 6381, section 3.3; ISO/IEC 14496-10, 7.3.2.1.1.
void hg_h264_codec(const uint8_t *data, size_t size, char codec[ENCODER_CODEC_BYTES]);

#endif
