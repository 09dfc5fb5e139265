// input.h - image files opened for decoding, by rows.h (PNG, JPEG) or OpenImageIO (oiio.h)
// in this process or, for formats that are not needed all the time, by the latter in one of its own
// (base/isolate.h) for as long as they are open. Floor 1, private to renderer/image and to that
// process. One thread at a time per input.
#ifndef HG_RENDERER_IMAGE_INPUT_H
#define HG_RENDERER_IMAGE_INPUT_H

#include "base/isolate.h"
#include "renderer/image/oiio.h"

struct hg_input;

// All as the functions of oiio.h with these names; also HG_E_LIMIT: time or memory of the process.
// HG_E_NOMEM also when too many such processes run.
enum hg_status hg_input_open(FILE *file, const struct hg_image_bytes *bytes, const char *format,
    bool large, struct hg_input **out, struct hg_error *err) HG_MUST_CHECK;
void hg_input_close(struct hg_input *input); // accepts NULL
const char *hg_input_name(const struct hg_input *input);
const struct hg_oiio_header *hg_input_get_header(const struct hg_input *input);
enum hg_status hg_input_part_header(struct hg_input *input, int part, struct hg_oiio_header *out,
    struct hg_error *err) HG_MUST_CHECK;
bool hg_input_mip_size(struct hg_input *input, uint32_t mip, uint32_t size_px[2]);
enum hg_status hg_input_read_text(struct hg_input *input, const char *key, char *text,
    size_t size_bytes, struct hg_error *err) HG_MUST_CHECK;
// Of the part whose header was read last.
enum hg_status hg_input_read_image(struct hg_input *input, int part,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_input_read_rows(struct hg_input *input, int part, uint32_t y, uint32_t count,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_input_read_tiles(struct hg_input *input, const struct hg_image_rect *area,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;

// input_serve.c: the other side, of all HG_ISOLATE_IMAGE_ operations.
hg_isolate_serve_fn hg_input_serve HG_MUST_CHECK;

// What both sides write and read: fixed sizes, in this order.
enum hg_input_read { HG_INPUT_IMAGE, HG_INPUT_ROWS, HG_INPUT_TILES };
struct hg_input_area {
    enum hg_input_read kind;
    int part;
    uint32_t y, count; // ROWS
    struct hg_image_rect tiles;
    enum hg_oiio_type type;
    int channels;
};
// False: no header of an image.
bool hg_input_parse_header(const void *data, size_t size, struct hg_oiio_header *out);
void hg_input_write_area(struct hg_writer *w, const struct hg_input_area *area);
// Bytes of its pixels, of a part or mip of such a header; 0: none, or too many.
uint64_t hg_input_area_bytes(const struct hg_input_area *area, const struct hg_oiio_header *header);

#endif
