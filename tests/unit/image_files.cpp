// image_files.cpp - see image_files.h.
#include "tests/unit/image_files.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>

namespace
{

bool write_level(OIIO::ImageOutput &out, const OIIO::ImageSpec &spec, const uint8_t *level)
{
    std::vector<uint8_t> rgb(size_t(spec.width) * size_t(spec.height) * 3);
    for (size_t i = 0; i < rgb.size(); i++)
        rgb[i] = level[i / 3 * 4 + i % 3];
    return out.write_image(OIIO::TypeDesc::UINT8, rgb.data());
}

} // namespace

bool write_tiled_file(const char *path, const struct tiled_layout *layout, uint32_t mips,
    const uint8_t *const levels[])
{
    std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(int(layout->width), int(layout->height), 3,
        layout->is_float ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
    spec.tile_width = spec.tile_height = int(layout->tile);
    spec.attribute("textureformat", "Plain Texture");
    spec.attribute("openexr:levelmode", 1);
    spec.attribute("openexr:roundingmode", 0);
    bool good = out != nullptr;
    for (uint32_t i = 0; good && i < mips; i++) {
        spec.width = spec.full_width = int(std::max(layout->width >> i, 1u));
        spec.height = spec.full_height = int(std::max(layout->height >> i, 1u));
        // TIFF has no mips of its own: a "textureformat" says what its images are.
        OIIO::ImageOutput::OpenMode mode = !i ? OIIO::ImageOutput::Create
                                           : out->supports("mipmap")
                                               ? OIIO::ImageOutput::AppendMIPLevel
                                               : OIIO::ImageOutput::AppendSubimage;
        good = out->open(path, spec, mode) && write_level(*out, spec, levels[i]);
    }
    if (!good && out)
        fprintf(stderr, "%s: %s\n", path, out->geterror().c_str());
    return good && out->close();
}

bool write_large_file(const char *path, uint32_t width, uint32_t height)
{
    std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(int(width), int(height), 3, OIIO::TypeDesc::UINT8);
    spec.attribute("png:compressionLevel", 1);
    spec.attribute("compression", "lzw");
    if (!out || !out->open(path, spec))
        return false;
    std::vector<uint8_t> row(size_t(width) * 3);
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++)
            large_texel(x, y, &row[size_t(x) * 3]);
        if (!out->write_scanline(int(y), 0, OIIO::TypeDesc::UINT8, row.data()))
            return false;
    }
    return out->close();
}
