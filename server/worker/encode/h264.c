#include "server/worker/encode/h264.h"

#include <stdio.h>

int hg_h264_quantiser(uint8_t quality)
{
    return 51 - (37 * (quality - 1) + 50) / 101;
}

void hg_h264_codec(const uint8_t *data, size_t size, char codec[ENCODER_CODEC_BYTES])
{
    enum { SEQUENCE_PARAMETER_SET = 7 };
    codec[0] = 0;
    for (size_t i = 0; i + 7 <= size; i++)
        if (data[i] == 0 && data[i + 1] == 0 && data[i + 2] == 1 &&
            (data[i + 3] & 31) == SEQUENCE_PARAMETER_SET) {
            (void)snprintf(codec, ENCODER_CODEC_BYTES, "avc1.%02x%02x%02x", data[i + 4],
                data[i + 5], data[i + 6]);
            return;
        }
}
