// oiio.cpp - the one place that speaks to OpenImageIO. See oiio.h and image.h.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>

// C lets a struct and a function share a name; C++ warns that one hides the other.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
extern "C" {
#include "base/alloc.h"
#include "renderer/image/oiio.h"
#include "renderer/image/reader.h"
#include "renderer/image/texture_system.h"
#include "renderer/image/writer.h"
}
#pragma GCC diagnostic pop

namespace
{

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

constexpr int max_channels = 256;
constexpr int image_limit_mb = 2048;

// Library-wide switches, once per process. Parallelism is above: images decode side by side.
void set_up_library()
{
    static std::once_flag once;
    std::call_once(once, [] {
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);
        OIIO::attribute("limits:imagesize_MB", image_limit_mb);
        OIIO::attribute("limits:channels", max_channels);
    });
}

// OpenImageIO's texts may have several lines; ours have one.
std::string one_line(std::string text)
{
    while (!text.empty() && (text.back() == '\n' || text.back() == ' '))
        text.pop_back();
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text.empty() ? "the decoder gave no reason" : text;
}

hg_status fail(hg_error *err, hg_status status, const char *name, const std::string &reason)
{
    return hg_error_set(err, status, name, nullptr, "%s", one_line(reason).c_str());
}

// Runs `work`, which returns a status, and turns what it throws into one.
template <class Work> hg_status guarded(const char *name, hg_error *err, Work work) noexcept
{
    try {
        return work();
    } catch (const std::bad_alloc &) {
        return hg_error_set(err, HG_E_NOMEM, name, nullptr, "no memory to decode or encode");
    } catch (const std::exception &e) {
        return hg_error_set(err, HG_E_FORMAT, name, nullptr, "%s", e.what());
    } catch (...) {
        return hg_error_set(err, HG_E_FORMAT, name, nullptr, "the image library failed");
    }
}

// An opened image; the reader borrows the proxy, so the order of members matters. Only the
// library's own proxies will do: its JPEG reader looks inside them.
struct Source {
    std::string label; // of the file, for messages
    std::unique_ptr<OIIO::Filesystem::IOProxy> bytes;
    std::unique_ptr<ImageInput> input;
    ImageSpec spec;

    explicit Source(const hg_image_bytes &file)
        : label(file.name),
          bytes(new OIIO::Filesystem::IOMemReader(const_cast<void *>(file.data), file.size))
    {
    }

    Source(FILE *file, const char *name)
        : label(name), bytes(new OIIO::Filesystem::IOFile(file, OIIO::Filesystem::IOProxy::Read))
    {
    }

    const char *name() const
    {
        return label.c_str();
    }
};

hg_status open_source(Source &source, const char *format, hg_error *err)
{
    const char *name = source.name();
    set_up_library();
    source.input = ImageInput::create(format, false, nullptr, nullptr, "");
    if (!source.input)
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + ": " + OIIO::geterror());
    ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    if (!source.input->set_ioproxy(source.bytes.get()))
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + " from memory");
    if (!source.input->open(std::string("memory.") + format, source.spec, config))
        return fail(err, HG_E_FORMAT, name, source.input->geterror());
    const ImageSpec &s = source.spec;
    if (s.width < 1 || s.height < 1 || s.depth > 1 || s.nchannels < 1)
        return fail(err, HG_E_FORMAT, name, "no pixels");
    return HG_OK;
}

// The library's own limit is meant for images that are read whole.
hg_status open_large_source(Source &source, const char *format, hg_error *err)
{
    static std::mutex lock;
    std::lock_guard<std::mutex> guard(lock);
    set_up_library();
    OIIO::attribute("limits:imagesize_MB", 1 << 18);
    hg_status st = open_source(source, format, err);
    OIIO::attribute("limits:imagesize_MB", image_limit_mb);
    return st;
}

hg_status check_limits(const ImageSpec &s, const char *name, size_t pixel_bytes,
    const hg_image_limits &l, hg_error *err)
{
    uint64_t width = uint64_t(s.width), height = uint64_t(s.height), pixels = width * height;
    if (width > l.max_side_px || height > l.max_side_px)
        return hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than %u a side",
            s.width, s.height, l.max_side_px);
    if (pixels > l.max_pixels || pixels > l.max_bytes / pixel_bytes)
        return hg_error_set(
            err, HG_E_LIMIT, name, "size", "%dx%d px is more than allowed", s.width, s.height);
    if (s.nchannels > max_channels)
        return hg_error_set(
            err, HG_E_LIMIT, name, "channels", "%d is more than %d", s.nchannels, max_channels);
    // One tile or one row is taken whole by the decoder.
    uint64_t tile = uint64_t(std::max(s.tile_width, 1)) * uint64_t(std::max(s.tile_height, 1));
    if (tile > l.max_pixels || tile > l.max_bytes / std::max<uint64_t>(s.pixel_bytes(true), 1))
        return hg_error_set(err, HG_E_LIMIT, name, "tile", "%dx%d px is more than allowed",
            s.tile_width, s.tile_height);
    return HG_OK;
}

TypeDesc type_of(hg_pixel_format format)
{
    switch (format) {
    case HG_PIXEL_RGBA8:
        return TypeDesc::UINT8;
    case HG_PIXEL_RGBA16:
        return TypeDesc::UINT16;
    case HG_PIXEL_RGBA32F:
        break;
    }
    return TypeDesc::FLOAT;
}

// How many of the file's first channels are read: grey, grey + alpha, RGB or RGBA.
int channels_to_read(const ImageSpec &s)
{
    if (s.nchannels >= 4 && s.alpha_channel == 3)
        return 4;
    if (s.nchannels >= 3 && s.alpha_channel != 1)
        return 3;
    return s.nchannels >= 2 && s.alpha_channel == 1 ? 2 : 1;
}

// Spreads tightly packed pixels of n channels to RGBA in place, from the last pixel backwards.
template <class T> void spread_to_rgba(T *px, size_t count, int n, T one)
{
    for (size_t i = count; n < 4 && i-- > 0;) {
        const T *s = px + i * size_t(n);
        T r = s[0], g = n >= 3 ? s[1] : r, b = n >= 3 ? s[2] : r, a = n == 2 ? s[1] : one;
        T *d = px + i * 4;
        d[0] = r;
        d[1] = g;
        d[2] = b;
        d[3] = a;
    }
}

void spread(void *pixels, size_t count, hg_pixel_format format, int channels)
{
    if (format == HG_PIXEL_RGBA8)
        spread_to_rgba(static_cast<uint8_t *>(pixels), count, channels, uint8_t(255));
    else if (format == HG_PIXEL_RGBA16)
        spread_to_rgba(static_cast<uint16_t *>(pixels), count, channels, uint16_t(65535));
    else
        spread_to_rgba(static_cast<float *>(pixels), count, channels, 1.0f);
}

// Files that store colour times alpha (EXR, some TIFF) become straight alpha.
template <class T> void divide_alpha(T *px, size_t count, float one)
{
    for (size_t i = 0; i < count; i++, px += 4) {
        float a = float(px[3]) / one;
        if (a <= 0 || a >= 1)
            continue;
        for (int c = 0; c < 3; c++) {
            float v = float(px[c]) / a;
            px[c] = one == 1.0f ? T(v) : T(std::min(v, one) + 0.5f);
        }
    }
}

void make_straight(void *pixels, size_t count, hg_pixel_format format)
{
    if (format == HG_PIXEL_RGBA8)
        divide_alpha(static_cast<uint8_t *>(pixels), count, 255.0f);
    else if (format == HG_PIXEL_RGBA16)
        divide_alpha(static_cast<uint16_t *>(pixels), count, 65535.0f);
    else
        divide_alpha(static_cast<float *>(pixels), count, 1.0f);
}

// From the channels that were read, tightly packed, to straight RGBA in place.
void finish_pixels(const ImageSpec &s, void *pixels, size_t count, hg_pixel_format format)
{
    int channels = channels_to_read(s);
    spread(pixels, count, format, channels);
    if ((channels == 2 || channels == 4) && s.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0)
        make_straight(pixels, count, format);
}

bool has_alpha(const ImageSpec &s)
{
    int channels = channels_to_read(s);
    return channels == 2 || channels == 4;
}

hg_status read_pixels(Source &source, hg_image *image, hg_error *err)
{
    int channels = channels_to_read(source.spec);
    if (!source.input->read_image(0, 0, 0, channels, type_of(image->format), image->pixels))
        return fail(err, HG_E_FORMAT, source.name(), source.input->geterror());
    finish_pixels(source.spec, image->pixels, size_t(image->width) * image->height, image->format);
    image->has_alpha = has_alpha(source.spec);
    return HG_OK;
}

hg_status read_image(Source &source, hg_pixel_format format, const hg_image_limits &limits,
    hg_image *out, hg_error *err)
{
    const ImageSpec &s = source.spec;
    const char *name = source.name();
    hg_status st = check_limits(s, name, hg_pixel_bytes(format), limits, err);
    if (st)
        return st;
    st = hg_image_create(uint32_t(s.width), uint32_t(s.height), format, &limits, out);
    if (st)
        return hg_error_set(err, st, name, "size", "no memory for %dx%d px", s.width, s.height);
    st = read_pixels(source, out, err);
    if (st)
        hg_image_finish(out);
    return st;
}

bool is_exr(hg_image_file file)
{
    return file == HG_IMAGE_EXR_HALF || file == HG_IMAGE_EXR_FLOAT;
}

TypeDesc file_type(hg_image_file file)
{
    switch (file) {
    case HG_IMAGE_PNG16:
        return TypeDesc::UINT16;
    case HG_IMAGE_EXR_HALF:
        return TypeDesc::HALF;
    case HG_IMAGE_EXR_FLOAT:
        return TypeDesc::FLOAT;
    case HG_IMAGE_PNG8:
    case HG_IMAGE_JPEG:
        break;
    }
    return TypeDesc::UINT8;
}

// PNG keeps attributes as text; EXR keeps their types.
void add_text(ImageSpec &spec, const hg_image_attribute &a)
{
    char text[400] = "";
    size_t at = 0, count = a.type == hg_image_attribute::HG_ATTR_MAT4 ? 16 : 1;
    if (a.type == hg_image_attribute::HG_ATTR_STRING) {
        spec.attribute(a.name, a.string);
        return;
    }
    if (a.type == hg_image_attribute::HG_ATTR_INT)
        snprintf(text, sizeof text, "%d", a.integer);
    else if (a.type == hg_image_attribute::HG_ATTR_COUNT)
        snprintf(text, sizeof text, "%u", unsigned(a.count));
    else
        for (size_t i = 0; i < count && at < sizeof text; i++)
            at += size_t(
                snprintf(text + at, sizeof text - at, i ? " %.9g" : "%.9g", double(a.floats[i])));
    spec.attribute(a.name, text);
}

void add_typed(ImageSpec &spec, const hg_image_attribute &a)
{
    switch (a.type) {
    case hg_image_attribute::HG_ATTR_STRING:
        spec.attribute(a.name, a.string);
        break;
    case hg_image_attribute::HG_ATTR_INT:
        spec.attribute(a.name, a.integer);
        break;
    case hg_image_attribute::HG_ATTR_COUNT: {
        const double count = a.count;
        spec.attribute(a.name, TypeDesc::DOUBLE, &count);
        break;
    }
    case hg_image_attribute::HG_ATTR_FLOAT:
        spec.attribute(a.name, a.floats[0]);
        break;
    case hg_image_attribute::HG_ATTR_MAT4:
        spec.attribute(a.name, OIIO::TypeMatrix44, a.floats);
        break;
    }
}

void add_exr_defaults(ImageSpec &spec)
{
    static const float rec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
    spec.attribute("compression", "zip");
    spec.attribute("chromaticities", TypeDesc(TypeDesc::FLOAT, 8), rec709);
    spec.attribute("DateTime", ""); // else the writer puts the present time into the file
}

ImageSpec make_spec(const hg_image *image, const struct hg_image_encode *params)
{
    ImageSpec spec(
        int(image->width), int(image->height), params->opaque ? 3 : 4, file_type(params->file));
    if (is_exr(params->file)) {
        add_exr_defaults(spec);
    } else {
        spec.attribute("oiio:ColorSpace", "sRGB");
        spec.attribute("oiio:UnassociatedAlpha", 1);
        spec.attribute("png:compressionLevel", 3);
    }
    for (size_t i = 0; i < params->attribute_count; i++)
        (is_exr(params->file) ? add_typed : add_text)(spec, params->attributes[i]);
    return spec;
}

// EXR holds colour times alpha by definition of the format.
std::vector<float> multiply_alpha(const hg_image *image)
{
    size_t count = size_t(image->width) * image->height;
    const float *s = static_cast<const float *>(image->pixels);
    std::vector<float> out(s, s + count * 4);
    for (size_t i = 0; i < count; i++)
        for (int c = 0; c < 3; c++)
            out[i * 4 + size_t(c)] *= out[i * 4 + 3];
    return out;
}

// What is more than the largest half would be infinite in the file, and spread in every blur. Not
// a number stays so. The values themselves where none of them is.
const float *fit_halves(const float *values, size_t count, std::vector<float> &fitted)
{
    constexpr float most = 65504;
    const auto fits = [](float v) { return !(std::abs(v) > most); };
    if (std::all_of(values, values + count, fits))
        return values;
    fitted.assign(values, values + count);
    for (float &v : fitted)
        v = fits(v) ? v : std::copysign(most, v);
    return fitted.data();
}

hg_status write_pixels(
    ImageOutput &output, const hg_image *image, const struct hg_image_encode *params)
{
    OIIO::stride_t xstride = OIIO::stride_t(hg_pixel_bytes(image->format));
    const void *pixels = image->pixels;
    std::vector<float> associated, fitted;
    if (is_exr(params->file) && !params->opaque) {
        associated = multiply_alpha(image);
        pixels = associated.data();
    }
    if (params->file == HG_IMAGE_EXR_HALF)
        pixels = fit_halves(
            static_cast<const float *>(pixels), size_t(image->width) * image->height * 4, fitted);
    return output.write_image(type_of(image->format), pixels, xstride) ? HG_OK : HG_E_IO;
}

hg_status encode(
    const hg_image *image, const struct hg_image_encode *params, hg_writer *out, hg_error *err)
{
    set_up_library();
    const char *format = is_exr(params->file) ? "openexr" : "png";
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    std::unique_ptr<ImageOutput> output = ImageOutput::create(format);
    if (!output || !output->set_ioproxy(&memory))
        return fail(err, HG_E_UNSUPPORTED, format, OIIO::geterror());
    if (!output->open(std::string("memory.") + format, make_spec(image, params)))
        return fail(err, HG_E_IO, format, output->geterror());
    if (write_pixels(*output, image, params) || !output->close())
        return fail(err, HG_E_IO, format, output->geterror());
    hg_write_bytes(out, bytes.data(), bytes.size());
    return out->failed ? fail(err, HG_E_NOMEM, format, "no room for the file") : HG_OK;
}

// --- parts

ImageSpec part_spec(const uint32_t size_px[2], const hg_exr_part &p)
{
    TypeDesc type = p.type == HG_EXR_UINT    ? TypeDesc::UINT32
                    : p.type == HG_EXR_FLOAT ? TypeDesc::FLOAT
                                             : TypeDesc::HALF;
    const int width = int(size_px[0]), height = int(size_px[1]);
    ImageSpec spec(width, height, int(p.channel_count), type);
    for (uint32_t i = 0; i < p.channel_count; i++)
        spec.channelnames[i] = p.channels[i];
    add_exr_defaults(spec);
    for (uint32_t i = 0; i < p.attribute_count; i++)
        add_typed(spec, p.attributes[i]);
    return spec;
}

hg_status encode_part(
    const uint32_t size_px[2], const hg_exr_part &p, hg_writer *out, hg_error *err)
{
    set_up_library();
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    std::unique_ptr<ImageOutput> output = ImageOutput::create("openexr");
    if (!output || !output->set_ioproxy(&memory))
        return fail(err, HG_E_UNSUPPORTED, "openexr", OIIO::geterror());
    if (!output->open("memory.exr", part_spec(size_px, p)))
        return fail(err, HG_E_IO, p.name, output->geterror());
    TypeDesc from = p.type == HG_EXR_UINT ? TypeDesc::UINT32 : TypeDesc::FLOAT;
    const void *pixels = p.pixels;
    std::vector<float> fitted;
    if (p.type == HG_EXR_HALF)
        pixels = fit_halves(static_cast<const float *>(pixels),
            (size_t(size_px[0]) * size_px[1] - 1) * p.stride + p.channel_count, fitted);
    if (!output->write_image(from, pixels, OIIO::stride_t(p.stride) * 4) || !output->close())
        return fail(err, HG_E_IO, p.name, output->geterror());
    hg_write_bytes(out, bytes.data(), bytes.size());
    return out->failed ? fail(err, HG_E_NOMEM, p.name, "no room for the part") : HG_OK;
}

// Rows in bands, as stored; decoding is what checks them.
hg_status read_whole_part(Source &source, int part, hg_error *err)
{
    const char *name = source.name();
    ImageSpec s = source.input->spec(part);
    constexpr int band = 64;
    std::vector<unsigned char> rows(s.scanline_bytes(true) * band);
    if (s.tile_width) {
        rows.resize(s.image_bytes(true));
        if (!source.input->read_image(part, 0, 0, s.nchannels, TypeDesc::UNKNOWN, rows.data()))
            return fail(err, HG_E_FORMAT, name, source.input->geterror());
        return HG_OK;
    }
    for (int y = 0; y < s.height; y += band)
        if (!source.input->read_scanlines(part, 0, s.y + y, s.y + std::min(y + band, s.height), 0,
                0, s.nchannels, TypeDesc::UNKNOWN, rows.data()))
            return fail(err, HG_E_FORMAT, name, source.input->geterror());
    return HG_OK;
}

hg_status examine(Source &source, const char *format, const char *key,
    const hg_image_limits &limits, hg_image_told *out, hg_error *err)
{
    const char *name = source.name();
    hg_status st = open_source(source, format, err);
    if (!st)
        st = check_limits(source.spec, name, source.spec.pixel_bytes(true), limits, err);
    if (st)
        return st;
    out->width = uint32_t(source.spec.width);
    out->height = uint32_t(source.spec.height);
    snprintf(out->file_format, sizeof out->file_format, "%s", format);
    snprintf(out->value, sizeof out->value, "%s",
        std::string(source.spec.get_string_attribute(key)).c_str());
    for (int part = 0; !st && part < HG_EXR_MAX_PARTS; part++) {
        if (!source.input->seek_subimage(part, 0))
            break;
        st = check_limits(source.input->spec(part), name, 1, limits, err);
        if (!st)
            st = read_whole_part(source, part, err);
        out->parts++;
    }
    return st;
}

// --- piece by piece

constexpr uint64_t max_tile_px = 1 << 24;

} // namespace

struct hg_oiio_reader {
    Source source;
    struct hg_image_reader_info info = {};
    std::mutex lock;
    uint32_t next_row = 0;
    std::vector<unsigned char> band; // a row of tiles, for rows of tiled files
    uint32_t band_first = 0, band_rows = 0;
    hg_pixel_format band_format = HG_PIXEL_RGBA8;

    explicit hg_oiio_reader(const hg_image_bytes &bytes) : source(bytes)
    {
    }

    hg_oiio_reader(FILE *file, const char *name) : source(file, name)
    {
    }
};

namespace
{

// Mips whose sides are those that ours have.
uint32_t count_mips(ImageInput &input, uint32_t width, uint32_t height)
{
    uint32_t count = 1;
    for (; count < 32; count++) {
        ImageSpec s = input.spec_dimensions(0, int(count));
        uint32_t w = std::max(width >> count, 1u), h = std::max(height >> count, 1u);
        if (s.format == TypeDesc::UNKNOWN || uint32_t(s.width) != w || uint32_t(s.height) != h)
            break;
        if (w == 1 && h == 1)
            return count + 1;
    }
    return count;
}

hg_status describe(hg_oiio_reader &r, const char *format, uint32_t max_side_px, hg_error *err)
{
    const ImageSpec &s = r.source.spec;
    const char *name = r.source.name();
    if (uint32_t(s.width) > max_side_px || uint32_t(s.height) > max_side_px)
        return hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than %u a side",
            s.width, s.height, max_side_px);
    if (s.nchannels > max_channels)
        return hg_error_set(
            err, HG_E_LIMIT, name, "channels", "%d is more than %d", s.nchannels, max_channels);
    struct hg_image_reader_info &i = r.info;
    i.width = uint32_t(s.width);
    i.height = uint32_t(s.height);
    i.tile_width = uint32_t(std::max(s.tile_width, 0));
    i.tile_height = uint32_t(std::max(s.tile_height, 0));
    if (uint64_t(i.tile_width) * i.tile_height > max_tile_px)
        return hg_error_set(err, HG_E_LIMIT, name, "tile", "%ux%u px is more than allowed",
            i.tile_width, i.tile_height);
    if (!i.tile_width || !i.tile_height)
        i.tile_width = i.tile_height = 0;
    i.channels = uint32_t(s.nchannels);
    i.is_float = s.format.is_floating_point();
    i.is_16bit = s.format.size() == 2;
    i.has_alpha = has_alpha(s);
    i.mips = i.tile_width ? count_mips(*r.source.input, i.width, i.height) : 1;
    i.row_buffer_bytes = uint64_t(i.width) * i.tile_height * (i.is_float ? 16 : 4);
    snprintf(i.file_format, sizeof i.file_format, "%s", format);
    return HG_OK;
}

hg_status open_reader(hg_oiio_reader *r, const char *format, uint32_t max_side_px, hg_error *err)
{
    hg_status st = open_large_source(r->source, format, err);
    return st ? st : describe(*r, format, max_side_px, err);
}

hg_status read_scanlines(hg_oiio_reader &r, hg_pixel_format format, uint32_t y, uint32_t count,
    void *pixels, hg_error *err)
{
    const ImageSpec &s = r.source.spec;
    int first = s.y + int(y);
    if (!r.source.input->read_scanlines(
            0, 0, first, first + int(count), 0, 0, channels_to_read(s), type_of(format), pixels))
        return fail(err, HG_E_FORMAT, r.source.name(), r.source.input->geterror());
    finish_pixels(s, pixels, size_t(r.info.width) * count, format);
    return HG_OK;
}

// Decodes whole tiles, rows tight: the area begins at a tile and ends with one, or with the mip.
hg_status read_tiles(hg_oiio_reader &r, const hg_image_rect &area, hg_pixel_format format,
    void *pixels, hg_error *err)
{
    ImageInput &input = *r.source.input;
    int mip = int(area.mip), width = int(area.size[0]), height = int(area.size[1]);
    ImageSpec s = input.spec_dimensions(0, mip);
    int x = s.x + int(area.at[0]), y = s.y + int(area.at[1]);
    if (!input.read_tiles(0, mip, x, x + width, y, y + height, 0, 1, 0,
            channels_to_read(r.source.spec), type_of(format), pixels))
        return fail(err, HG_E_FORMAT, r.source.name(), input.geterror());
    finish_pixels(r.source.spec, pixels, size_t(area.size[0]) * area.size[1], format);
    return HG_OK;
}

hg_status fill_band(hg_oiio_reader &r, hg_pixel_format format, uint32_t y, hg_error *err)
{
    const struct hg_image_reader_info &i = r.info;
    uint32_t first = y / i.tile_height * i.tile_height;
    const uint32_t rows = std::min(first + i.tile_height, i.height) - first;
    const hg_image_rect area = {0, {0, first}, {i.width, rows}};
    r.band.resize(size_t(i.width) * i.tile_height * hg_pixel_bytes(format));
    r.band_rows = 0;
    hg_status st = read_tiles(r, area, format, r.band.data(), err);
    if (st)
        return st;
    r.band_first = first;
    r.band_rows = rows;
    r.band_format = format;
    return HG_OK;
}

hg_status read_rows_of_tiles(hg_oiio_reader &r, hg_pixel_format format, uint32_t y, uint32_t count,
    void *pixels, hg_error *err)
{
    size_t row = size_t(r.info.width) * hg_pixel_bytes(format);
    auto *dst = static_cast<unsigned char *>(pixels);
    for (uint32_t end = y + count; y < end; y++, dst += row) {
        bool there = r.band_format == format && y >= r.band_first && y - r.band_first < r.band_rows;
        hg_status st = there ? HG_OK : fill_band(r, format, y, err);
        if (st)
            return st;
        memcpy(dst, r.band.data() + (y - r.band_first) * row, row);
    }
    return HG_OK;
}

hg_status read_rect(hg_oiio_reader &r, const hg_image_rect &rect, hg_pixel_format format,
    void *pixels, uint64_t *bytes, hg_error *err)
{
    const uint32_t tile[2] = {r.info.tile_width, r.info.tile_height};
    const uint32_t *at = rect.at, *size = rect.size;
    hg_image_rect area = {rect.mip, {0, 0}, {0, 0}};
    for (int i = 0; i < 2; i++) {
        if (!tile[i] || rect.mip >= r.info.mips)
            return hg_error_set(err, HG_E_INVAL, r.source.name(), nullptr, "no such rectangle");
        uint32_t side = std::max((i == 0 ? r.info.width : r.info.height) >> rect.mip, 1u);
        if (!size[i] || at[i] >= side || size[i] > side - at[i])
            return hg_error_set(err, HG_E_INVAL, r.source.name(), nullptr, "no such rectangle");
        area.at[i] = at[i] / tile[i] * tile[i];
        area.size[i] =
            std::min((at[i] + size[i] + tile[i] - 1) / tile[i] * tile[i], side) - area.at[i];
    }
    size_t texel = hg_pixel_bytes(format), wide = area.size[0];
    std::vector<unsigned char> tiles(wide * area.size[1] * texel);
    hg_status st = read_tiles(r, area, format, tiles.data(), err);
    if (st)
        return st;
    *bytes = tiles.size();
    for (uint32_t y = 0; y < size[1]; y++)
        memcpy(static_cast<unsigned char *>(pixels) + y * size[0] * texel,
            tiles.data() + ((at[1] - area.at[1] + y) * wide + at[0] - area.at[0]) * texel,
            size[0] * texel);
    return HG_OK;
}

} // namespace

hg_status hg_oiio_probe(
    const hg_image_bytes *file, const char *format, hg_image_info *out, hg_error *err)
{
    return guarded(file->name, err, [&]() -> hg_status {
        Source source(*file);
        hg_status st = open_source(source, format, err);
        if (st)
            return st;
        const ImageSpec &s = source.spec;
        out->width = uint32_t(s.width);
        out->height = uint32_t(s.height);
        out->channels = uint32_t(s.nchannels);
        out->is_float = s.format.is_floating_point();
        out->is_16bit = s.format.size() == 2;
        snprintf(out->file_format, sizeof out->file_format, "%s", format);
        return HG_OK;
    });
}

hg_status hg_oiio_read(const hg_image_bytes *file, const char *format, hg_pixel_format pixels,
    const hg_image_limits *limits, hg_image *out, hg_error *err)
{
    hg_status st = guarded(file->name, err, [&]() -> hg_status {
        Source source(*file);
        hg_status opened = open_source(source, format, err);
        return opened ? opened : read_image(source, pixels, *limits, out, err);
    });
    if (st)
        hg_image_finish(out);
    return st;
}

hg_status hg_oiio_encode(
    const hg_image *image, const struct hg_image_encode *params, hg_writer *out, hg_error *err)
{
    return guarded("image", err, [&] { return encode(image, params, out, err); });
}

hg_status hg_oiio_encode_part(
    const uint32_t size_px[2], const hg_exr_part *part, hg_writer *out, hg_error *err)
{
    return guarded(part->name, err, [&] { return encode_part(size_px, *part, out, err); });
}

hg_status hg_oiio_examine(const hg_image_bytes *file, const char *format, const char *key,
    const hg_image_limits *limits, hg_image_told *out, hg_error *err)
{
    return guarded(file->name, err, [&]() -> hg_status {
        Source source(*file);
        return examine(source, format, key, *limits, out, err);
    });
}

hg_status hg_oiio_reader_open(FILE *file, const hg_image_bytes *bytes, const char *format,
    uint32_t max_side_px, hg_oiio_reader **out, hg_error *err)
{
    *out = nullptr;
    hg_oiio_reader *reader = nullptr;
    hg_status st = guarded(bytes->name, err, [&]() -> hg_status {
        reader = file ? new hg_oiio_reader(file, bytes->name) : new hg_oiio_reader(*bytes);
        return open_reader(reader, format, max_side_px, err);
    });
    if (st)
        hg_oiio_reader_close(reader);
    else
        *out = reader;
    return st;
}

void hg_oiio_reader_close(hg_oiio_reader *reader)
{
    (void)guarded("image", nullptr, [&]() -> hg_status {
        delete reader;
        return HG_OK;
    });
}

const struct hg_image_reader_info *hg_oiio_reader_info(const hg_oiio_reader *reader)
{
    return &reader->info;
}

hg_status hg_oiio_reader_rows(
    hg_oiio_reader *r, hg_pixel_format format, uint32_t count, void *pixels, hg_error *err)
{
    return guarded(r->source.name(), err, [&]() -> hg_status {
        std::lock_guard<std::mutex> guard(r->lock);
        uint32_t y = r->next_row;
        if (count > r->info.height - y)
            return hg_error_set(err, HG_E_INVAL, r->source.name(), nullptr, "no more rows");
        hg_status st = r->info.tile_width ? read_rows_of_tiles(*r, format, y, count, pixels, err)
                                          : read_scanlines(*r, format, y, count, pixels, err);
        r->next_row += st ? 0 : count;
        return st;
    });
}

void hg_oiio_reader_skip(hg_oiio_reader *r, uint32_t count)
{
    std::lock_guard<std::mutex> guard(r->lock);
    r->next_row += std::min(count, r->info.height - r->next_row);
}

hg_status hg_oiio_reader_rect(hg_oiio_reader *r, const hg_image_rect *rect, hg_pixel_format format,
    void *pixels, uint64_t *bytes, hg_error *err)
{
    *bytes = 0;
    return guarded(r->source.name(), err, [&]() -> hg_status {
        std::lock_guard<std::mutex> guard(r->lock);
        return read_rect(*r, *rect, format, pixels, bytes, err);
    });
}

// --- files written piece by piece

struct hg_image_writer {
    std::unique_ptr<ImageOutput> output;
    ImageSpec spec;
    std::string path;
    uint32_t width = 0, height = 0, mip = 0;
    int next_row = 0;
};

namespace
{

hg_status fail_write(const hg_image_writer &w, hg_error *err)
{
    return fail(err, HG_E_IO, w.path.c_str(), w.output->geterror());
}

hg_status begin_file(hg_image_writer &w, const hg_image_writer_params &p, hg_error *err)
{
    set_up_library();
    w.path = p.path;
    w.width = p.width;
    w.height = p.height;
    w.spec = ImageSpec(int(p.width), int(p.height), int(p.channels), TypeDesc::UINT8);
    w.spec.tile_width = w.spec.tile_height = int(p.tile_px);
    w.spec.attribute("oiio:UnassociatedAlpha", 1);
    if (strcmp(p.format, "tiff") == 0)
        w.spec.attribute("compression", "zip");
    else
        w.spec.attribute("png:compressionLevel", 1);
    if (w.spec.image_bytes(true) > UINT64_C(2) << 30)
        w.spec.attribute("tiff:bigtiff", 1);
    if (p.tile_px) { // for programs that look for textures
        w.spec.attribute("textureformat", "Plain Texture");
        w.spec.attribute("wrapmodes", "periodic,periodic");
    }
    w.output = ImageOutput::create(p.format);
    if (!w.output)
        return fail(err, HG_E_UNSUPPORTED, p.path, OIIO::geterror());
    return w.output->open(w.path, w.spec) ? HG_OK : fail_write(w, err);
}

} // namespace

hg_status hg_image_writer_begin(
    const struct hg_image_writer_params *params, hg_image_writer **out, hg_error *err)
{
    *out = nullptr;
    hg_image_writer *writer = nullptr;
    hg_status st = guarded(params->path, err, [&]() -> hg_status {
        writer = new hg_image_writer;
        return begin_file(*writer, *params, err);
    });
    if (st)
        hg_image_writer_abort(writer);
    else
        *out = writer;
    return st;
}

hg_status hg_image_writer_rows(
    hg_image_writer *w, uint32_t count, const void *pixels, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        int first = w->next_row;
        w->next_row += int(count);
        return w->output->write_scanlines(first, w->next_row, 0, TypeDesc::UINT8, pixels)
                   ? HG_OK
                   : fail_write(*w, err);
    });
}

hg_status hg_image_writer_tile(
    hg_image_writer *w, uint32_t x, uint32_t y, const void *pixels, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        return w->output->write_tile(int(x), int(y), 0, TypeDesc::UINT8, pixels)
                   ? HG_OK
                   : fail_write(*w, err);
    });
}

hg_status hg_image_writer_next_mip(hg_image_writer *w, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        w->mip++;
        w->spec.width = w->spec.full_width = int(std::max(w->width >> w->mip, 1u));
        w->spec.height = w->spec.full_height = int(std::max(w->height >> w->mip, 1u));
        return w->output->open(w->path, w->spec, ImageOutput::AppendSubimage) ? HG_OK
                                                                              : fail_write(*w, err);
    });
}

hg_status hg_image_writer_end(hg_image_writer *w, hg_error *err)
{
    hg_status st = guarded(w->path.c_str(), err,
        [&]() -> hg_status { return w->output->close() ? HG_OK : fail_write(*w, err); });
    hg_image_writer_abort(w);
    return st;
}

void hg_image_writer_abort(hg_image_writer *w)
{
    (void)guarded("image", nullptr, [&]() -> hg_status {
        delete w;
        return HG_OK;
    });
}

// --- the library's texture system

struct hg_texture_system {
    decltype(OIIO::TextureSystem::create(false)) system; // a pointer, shared in later versions
    OIIO::TextureSystem::Perthread *thread;
    std::vector<OIIO::TextureSystem::TextureHandle *> handles;
    OIIO::TextureOpt options;
};

hg_status hg_texture_system_create(uint64_t memory_bytes, hg_texture_system **out, hg_error *err)
{
    *out = nullptr;
    return guarded("textures", err, [&]() -> hg_status {
        set_up_library();
        std::unique_ptr<hg_texture_system> t(new hg_texture_system);
        t->system = OIIO::TextureSystem::create(false);
        t->system->attribute("max_memory_MB", float(double(memory_bytes) / 1048576.0));
        t->system->attribute("max_open_files", 1000);
        t->thread = t->system->get_perthread_info();
        t->options.swrap = t->options.twrap = OIIO::TextureOpt::WrapPeriodic;
        t->options.mipmode = OIIO::TextureOpt::MipModeTrilinear;
        t->options.interpmode = OIIO::TextureOpt::InterpBilinear;
        *out = t.release();
        return HG_OK;
    });
}

void hg_texture_system_destroy(hg_texture_system *t)
{
    (void)guarded("textures", nullptr, [&]() -> hg_status {
        if (t)
            OIIO::TextureSystem::destroy(t->system, true);
        delete t;
        return HG_OK;
    });
}

hg_status hg_texture_system_add(hg_texture_system *t, const char *path, hg_error *err)
{
    return guarded(path, err, [&]() -> hg_status {
        auto *handle = t->system->get_texture_handle(OIIO::ustring(path), t->thread);
        if (!handle || !t->system->good(handle))
            return fail(err, HG_E_IO, path, t->system->geterror());
        t->handles.push_back(handle);
        return HG_OK;
    });
}

bool hg_texture_system_sample(
    hg_texture_system *t, uint32_t texture, float u, float v, float footprint, float rgba[4])
{
    return guarded("textures", nullptr, [&]() -> hg_status {
        return t->system->texture(t->handles[texture], t->thread, t->options, u, v, footprint, 0, 0,
                   footprint, 4, rgba)
                   ? HG_OK
                   : HG_E_IO;
    }) == HG_OK;
}

uint64_t hg_texture_system_decoded_bytes(const hg_texture_system *t)
{
    long long bytes = 0;
    t->system->getattribute("stat:bytes_read", TypeDesc::INT64, &bytes);
    return uint64_t(bytes);
}

const char *hg_texture_system_version(void)
{
    return "OpenImageIO " OIIO_VERSION_STRING;
}
