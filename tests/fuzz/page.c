// Any bytes as a compressed page: byte 0 chooses the texel size, bytes 1 and 2 the sides, the rest
// is the block. What is accepted must survive being encoded and decoded again.
#include "renderer/texture/source/page_codec.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

enum { TEXELS = HG_PAGE_CODEC_SIDE * HG_PAGE_CODEC_SIDE };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 3)
        return 0;
    const uint32_t texel = data[0] & 1 ? 8 : 4;
    const uint32_t w = 1 + data[1] % HG_PAGE_CODEC_SIDE, h = 1 + data[2] % HG_PAGE_CODEC_SIDE;
    const struct hg_texel_layout layout = {w, h, texel, (size_t)w * texel};
    uint8_t *texels = calloc(TEXELS, 8), *again = calloc(TEXELS, 8);
    struct hg_page_codec *codec = hg_page_codec_create();
    FUZZ_CHECK(codec && texels && again);
    enum hg_status status = hg_page_decode(codec, data + 3, size - 3, &layout, texels);
    FUZZ_CHECK(status == HG_OK || status == HG_E_FORMAT);
    if (status == HG_OK) {
        struct hg_writer out = {0};
        FUZZ_CHECK(hg_page_encode(codec, texels, &layout, 1, &out) == HG_OK);
        FUZZ_CHECK(hg_page_decode(codec, out.data, out.size, &layout, again) == HG_OK);
        FUZZ_CHECK(memcmp(texels, again, (size_t)w * h * texel) == 0);
        hg_writer_finish(&out);
    }
    hg_page_codec_destroy(codec);
    free(texels);
    free(again);
    return 0;
}
