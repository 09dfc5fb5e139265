// Any bytes as an image file: hg_image_probe_memory and hg_image_read_memory, small limits. The
// first byte chooses the pixel format, the rest is the file. Every second PNG file has its sums put
// right.
#include "renderer/image/image.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/png_sums.h"

static const struct hg_image_limits limits = {
    .max_side_px = 4096, .max_pixels = 1 << 20, .max_bytes = 1 << 24};

static void read_image(const struct hg_image_bytes *file, enum hg_pixel_format format)
{
    struct hg_image_info info;
    struct hg_image image;
    struct hg_error err = {0};
    enum hg_status probed = hg_image_probe_memory(file, &info, &err);
    FUZZ_CHECK(probed || (info.width > 0 && info.height > 0 && info.channels > 0));
    err = (struct hg_error){0};
    enum hg_status st = hg_image_read_memory(file, format, &limits, &image, &err);
    if (st == HG_OK) {
        FUZZ_CHECK(probed == HG_OK);
        FUZZ_CHECK(image.width == info.width && image.height == info.height);
        FUZZ_CHECK(image.width <= limits.max_side_px && image.height <= limits.max_side_px);
        size_t bytes = (size_t)image.width * image.height * hg_pixel_bytes(format);
        FUZZ_CHECK(image.size_bytes == bytes && bytes <= limits.max_bytes);
        volatile uint8_t last = ((const uint8_t *)image.pixels)[bytes - 1];
        (void)last;
    } else {
        FUZZ_CHECK(!image.pixels && err.status == st && err.reason[0]);
    }
    hg_image_finish(&image);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint32_t sum = 0;
    if (size == 0)
        return 0;
    for (size_t i = 0; i < size; i++)
        sum += data[i];
    const bool mend = size > 1 && data[1] == 0x89 && sum % 2 == 0;
    uint8_t *mended = mend ? fuzz_png_sums(data + 1, size - 1) : NULL;
    read_image(&(struct hg_image_bytes){mended ? mended : data + 1, size - 1, "fuzz.tga"},
        (enum hg_pixel_format)(data[0] % 3));
    free(mended);
    return 0;
}
