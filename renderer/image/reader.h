// reader.h - an image file read piece by piece: rows in order, or rectangles of tiled files.
// Floor 1. A reader may be used by several threads; they take turns.
//
// Texels are those that hg_image_read_file gives for the same format. Memory: what the file's own
// compression needs (a strip, a row of tiles, the coefficients of a progressive JPEG).
#ifndef HG_RENDERER_IMAGE_READER_H
#define HG_RENDERER_IMAGE_READER_H

#include "renderer/image/image.h"

struct hg_image_reader;

struct hg_image_reader_info {
    uint32_t width, height;
    uint32_t tile_width, tile_height; // 0: rows
    uint32_t channels;                // as stored
    uint32_t mips;                    // mips in the file whose sides are max(1, side >> mip); >= 1
    bool is_float, is_16bit, has_alpha;
    char file_format[16];
    uint64_t file_bytes, file_time_ns, file_id, device_id; // of the file; last three 0 for bytes
    uint64_t row_buffer_bytes; // taken by the first call of hg_image_reader_rows
};

// Of a file (which stays open: a new file under its name changes nothing), or of encoded bytes,
// borrowed until close. HG_E_NOTFOUND, HG_E_PERM, HG_E_FORMAT, HG_E_UNSUPPORTED (a
// kind of its format that is not read), HG_E_LIMIT (sides of more than max_side_px, tiles of more
// than 2^24 texels), HG_E_NOMEM, HG_E_IO.
enum hg_status hg_image_reader_open(const char *path, uint32_t max_side_px,
    struct hg_image_reader **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_image_reader_open_memory(const struct hg_image_bytes *file, uint32_t max_side_px,
    struct hg_image_reader **out, struct hg_error *err) HG_MUST_CHECK;
void hg_image_reader_close(struct hg_image_reader *reader); // accepts NULL
const struct hg_image_reader_info *hg_image_reader_info(const struct hg_image_reader *reader);

// Whether the file has the size and time that it had when it was opened; of a reader that sleeps,
// whether it is also the same file.
bool hg_image_reader_is_unchanged(const struct hg_image_reader *reader);

// A reader that sleeps holds neither a descriptor nor the decoder; only what is said above may be
// asked of it. No other thread may use it meanwhile. Rows begin at the top again. Bytes cannot
// sleep.
bool hg_image_reader_can_sleep(const struct hg_image_reader *reader);
void hg_image_reader_sleep(struct hg_image_reader *reader);
// Opens it again, if it sleeps. HG_E_HASH: the file is not the one that was opened; HG_E_NOMEM (also
// for want of descriptors), HG_E_IO, HG_E_NOTFOUND: it sleeps on.
enum hg_status hg_image_reader_wake(
    struct hg_image_reader *reader, struct hg_error *err) HG_MUST_CHECK;

// SHA-256 of the file or the bytes. HG_E_NOMEM, HG_E_IO.
enum hg_status hg_image_reader_hash(struct hg_image_reader *reader, uint8_t digest[32],
    struct hg_error *err) HG_MUST_CHECK;

// The next `count` rows of mip 0, tight, from the top. HG_E_FORMAT, HG_E_INVAL (past the end).
enum hg_status hg_image_reader_rows(struct hg_image_reader *reader, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
// Skips rows of mip 0 (as many as there are). Compression may require decoding them.
void hg_image_reader_skip(struct hg_image_reader *reader, uint32_t count);
// A rectangle of a tiled file, rows tight. *bytes: of the tiles decoded for it. HG_E_INVAL (not
// inside the mip, or the file has no tiles), HG_E_FORMAT.
enum hg_status hg_image_reader_rect(struct hg_image_reader *reader,
    const struct hg_image_rect *rect, enum hg_pixel_format format, void *pixels, uint64_t *bytes,
    struct hg_error *err) HG_MUST_CHECK;

#endif
