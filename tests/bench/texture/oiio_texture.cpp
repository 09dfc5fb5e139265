// oiio_texture.cpp - see oiio_texture.h.
#include "tests/bench/texture/oiio_texture.h"

#include <algorithm>
#include <memory>
#include <vector>

#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>

struct oiio_textures {
    OIIO::TextureSystem *system;
    OIIO::TextureSystem::Perthread *thread;
    std::vector<OIIO::TextureSystem::TextureHandle *> handles;
    OIIO::TextureOpt options;
};

struct oiio_textures *oiio_textures_create(float memory_mb)
{
    auto *t = new oiio_textures;
    t->system = OIIO::TextureSystem::create(false);
    t->system->attribute("max_memory_MB", memory_mb);
    t->system->attribute("max_open_files", 1000);
    t->thread = t->system->get_perthread_info();
    t->options.swrap = t->options.twrap = OIIO::TextureOpt::WrapPeriodic;
    t->options.mipmode = OIIO::TextureOpt::MipModeTrilinear;
    t->options.interpmode = OIIO::TextureOpt::InterpBilinear;
    return t;
}

void oiio_textures_destroy(struct oiio_textures *t, uint64_t *bytes_read, uint64_t *peak_bytes)
{
    long long bytes = 0, memory = 0;
    t->system->getattribute("stat:bytes_read", OIIO::TypeDesc::INT64, &bytes);
    t->system->getattribute("stat:cache_memory_used", OIIO::TypeDesc::INT64, &memory);
    *bytes_read = uint64_t(bytes);
    *peak_bytes = uint64_t(memory);
    OIIO::TextureSystem::destroy(t->system, true);
    delete t;
}

bool oiio_textures_sample(struct oiio_textures *t, const char *const *paths, uint32_t texture,
    float u, float v, float footprint, float rgba[4])
{
    if (texture >= t->handles.size())
        t->handles.resize(texture + 1);
    auto *&handle = t->handles[texture];
    if (!handle)
        handle = t->system->get_texture_handle(OIIO::ustring(paths[texture]), t->thread);
    rgba[3] = 1;
    return t->system->texture(
        handle, t->thread, t->options, u, v, footprint, 0, 0, footprint, 4, rgba);
}

bool oiio_write_tx(
    const char *path, uint32_t width, uint32_t height, uint32_t mips, const uint8_t *const levels[])
{
    std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create("tiff");
    OIIO::ImageSpec spec(int(width), int(height), 4, OIIO::TypeDesc::UINT8);
    spec.tile_width = spec.tile_height = 64;
    spec.attribute("textureformat", "Plain Texture");
    spec.attribute("compression", "zip");
    spec.attribute("oiio:UnassociatedAlpha", 1);
    spec.attribute("wrapmodes", "periodic,periodic");
    bool good = out != nullptr;
    for (uint32_t i = 0; good && i < mips; i++) {
        spec.width = spec.full_width = int(std::max(width >> i, 1u));
        spec.height = spec.full_height = int(std::max(height >> i, 1u));
        good = out->open(
                   path, spec, i ? OIIO::ImageOutput::AppendSubimage : OIIO::ImageOutput::Create) &&
               out->write_image(OIIO::TypeDesc::UINT8, levels[i]);
    }
    return good && out->close();
}

bool oiio_write_large(const char *path, uint32_t width, uint32_t height)
{
    std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create("tiff");
    OIIO::ImageSpec spec(int(width), int(height), 3, OIIO::TypeDesc::UINT8);
    spec.attribute("compression", "lzw");
    spec.attribute("tiff:bigtiff", 1);
    if (!out || !out->open(path, spec))
        return false;
    std::vector<uint8_t> row(size_t(width) * 3);
    uint32_t noise = 1;
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            noise = noise * 1664525u + 1013904223u;
            row[x * 3] = uint8_t((x >> 7) + (y >> 6) + (noise >> 30));
            row[x * 3 + 1] = uint8_t((x ^ y) >> 5);
            row[x * 3 + 2] = uint8_t((x * 3 + y) >> 8);
        }
        if (!out->write_scanline(int(y), 0, OIIO::TypeDesc::UINT8, row.data()))
            return false;
    }
    return out->close();
}
