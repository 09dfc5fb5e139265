// image_ktx2_files.h - the KTX2 files in tests/unit/ktx2, and changed copies of them.
//
// They were made with the Basis Universal encoder, the PNG files beside them from texels of its
// transcoder. That one rounds sRGB as linear: colours of uastc_zstd are those of an ASTC decoder,
// which was given what the file transcodes to without loss.
#ifndef HG_TESTS_UNIT_IMAGE_KTX2_FILES_H
#define HG_TESTS_UNIT_IMAGE_KTX2_FILES_H

#include "renderer/image/reader.h"

enum {
    UASTC,       // 45 x 18, raw, alpha, linear; blocks of all 19 modes
    UASTC_ZSTD,  // 37 x 23, alpha, sRGB, 6 mips
    ETC1S,       // 121 x 125, sRGB, 7 mips; long runs
    ETC1S_ALPHA, // 37 x 23, sRGB
    FILES
};

// Places in the header.
enum {
    FORMAT = 12,
    TYPE_SIZE = 16,
    WIDTH = 20,
    HEIGHT = 24,
    DEPTH = 28,
    LAYERS = 32,
    FACES = 36,
    LEVELS = 40,
    SCHEME = 44,
    DESCRIPTOR = 48, // offset, length
    KEYS = 56,
    GLOBALS = 64, // of 64 bits each, like those of the level
    LEVEL = 80,
    LEVEL_SIZE = 96,
};

struct bytes {
    uint8_t *data;
    size_t size;
};

extern const char *const ktx2_names[FILES];
extern struct bytes ktx2_files[FILES];
extern struct hg_image ktx2_wanted[FILES];

int ktx2_read_all(void **state); // set-up and tear-down of a group
int ktx2_free_all(void **state);
// A file with room for more behind it.
struct bytes ktx2_copy(unsigned file, size_t more);
uint32_t get32(const struct bytes *b, size_t at);
void put32(struct bytes *b, size_t at, uint32_t value);
void put64(struct bytes *b, size_t at, uint64_t value);
struct hg_image ktx2_decode(const struct bytes *b, enum hg_pixel_format format);
// Read as a picture: the status; an error has to say what of which file.
enum hg_status ktx2_try_decode(const uint8_t *data, size_t size, struct hg_error *err);
void ktx2_expect(const struct bytes *b, enum hg_status want, const char *where);

#endif
